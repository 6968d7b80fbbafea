"""Recursive estimators against the batch estimate of the same record: what one pass reaches, from where.

Distances are N (V - V*) / V* over the whole record, V* the loss of the batch estimate: about 0 where nothing is lost,
p (the number of parameters) where half of the information is. P1 has condition 4e8.
"""

import sys
import warnings
from time import perf_counter

import numpy as np

import sysid
from scenarios.problems.registry import problem
from tests.benchmarks.tables import heading, row, timed
from tests.sysid.systems import excess_loss

CASES = [
    ("P1 rarmax", "p1", sysid.rarmax, sysid.armax, (5, 3, 5, 2)),
    ("P3 rarmax", "p3", sysid.rarmax, sysid.armax, (2, 2, 2, 1)),
    ("P2 roe", "p2", sysid.roe, sysid.oe, (2, 2, 1)),
    ("P1 rarx", "p1", sysid.rarx, sysid.arx, (5, 3, 2)),
]


def main():
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    heading("problem", "begins with", "N dV/V, median", "90 %", "deviations by batch's", "warned", "us per sample")
    for label, name, recursive, batch, orders in CASES:
        records = [problem(name).draw(seed) for seed in range(draws)]
        wholes = [batch(data, *orders) for data in records]
        # Samples of the record that an estimate to begin with is made of.
        for first in (0, 300, 600, 1000):
            distances, ratios, warned, seconds = [], [], 0, 0.0
            for data, whole in zip(records, wholes, strict=True):
                with warnings.catch_warnings(record=True) as caught:
                    warnings.simplefilter("always")
                    start = batch(data[:first], *orders) if first else None
                    caught.clear()
                    estimate, taken = timed(recursive, data[first:], *orders, start=start, clock=perf_counter)
                    seconds += taken
                    warned += any("still far from the minimum" in str(w.message) for w in caught)
                distances.append(excess_loss(estimate.final.model, whole.model, data))
                ratios.append(np.median(np.sqrt(np.diag(estimate.final.covariance) / np.diag(whole.covariance))))
            where = f"an estimate from {first} samples" if first else "zero"
            speed = 1e6 * seconds / sum(len(data) - first for data in records)
            quantiles = f"{np.median(distances):.2g}", f"{np.quantile(distances, 0.9):.2g}"
            row(label, where, *quantiles, f"{np.median(ratios):.2f}", f"{warned} of {draws}", f"{speed:.0f}")


if __name__ == "__main__":
    main()
