"""Efficiency, coverage and time of the prediction-error estimators, each on problems of its class.

Per problem it writes the mean of error' J error / p (1 is the Cramer-Rao bound), the coverage of nominal 95 % intervals
of parameters and bandwidth, how many predictors and models are unstable, how many fits explain less than nothing or did
not converge, and the processor time. J is the information at the true parameters: with little data and much noise the
error leaves the region where it describes the criterion, the more so the nearer the structure is to being redundant.
"""

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import sysid
from scenarios.problems.linear_problem import noise_variance
from scenarios.problems.registry import problem
from tests.benchmarks.tables import options, timed
from tests.sysid.systems import covered, parameters_covered

STRUCTURES = {
    "p1": (sysid.armax, (5, 3, 5, 2)),
    "p2": (sysid.oe, (2, 2, 1)),
    "p3": (sysid.armax, (2, 2, 2, 1)),
    "p4": (sysid.bj, (2, 2, 2, 2, 1)),
    "p5": (sysid.arx, (3, 3, 2)),
}
"""Estimator and orders that have the truth of each problem."""

FIGURES: dict[str, Callable[[list[float]], Any]] = {
    "error' J error / p": np.mean,
    "coverage, parameters": np.mean,
    "coverage, bandwidth": np.mean,
    "coverage, response": np.mean,
    "model unstable": np.sum,
    "predictor unstable": np.sum,
    "diverged": np.sum,
    "not converged": np.sum,
    "median ms": np.median,
}
"""Figures of a problem, and how each is computed from those of its draws."""


def harder(name, samples, snr_db):
    """The same system in a record of another length, its disturbance of another power."""
    system = problem(name if samples is None else f"{name}@{samples}")
    if snr_db is None:
        return system
    return replace(system, variance=noise_variance(system.polynomials, system.reference, snr_db))


def measure(system, estimator, orders, draws):
    """Run one problem over `draws` noise realisations."""
    bound, truth = system.bound(None), system.truth
    information, hz = np.linalg.inv(bound.covariance), truth.bandwidth()[0, 0]
    figures: dict[str, list[float]] = {name: [] for name in FIGURES}
    f = np.geomspace(0.01, 0.8, 12) * 0.5 / truth.dt
    magnitude = np.abs(truth.frequency_response(f))
    for seed in range(draws):
        data = system.draw(seed)
        estimate, seconds = timed(estimator, data, *orders)
        error, m = estimate.parameters - bound.parameters, estimate.model
        cost = estimate.diagnostics.get("sum_of_squares", float(np.sum(estimate.residuals**2)))
        of_draw = (
            error @ information @ error / len(error),
            np.mean(parameters_covered(estimate, bound.parameters)),
            estimate.bandwidth().covers(hz)[0, 0],
            np.mean(covered(estimate.frequency_response(f).magnitude_ci95(), magnitude)),
            not m.is_stable(),
            np.abs(np.linalg.eigvals(m.A - m.gain @ m.C)).max() >= 1.0,
            not (np.isfinite(estimate.parameters).all() and cost <= float(np.sum(data.y**2))),
            not estimate.diagnostics["converged"],
            1e3 * seconds,
        )
        for values, value in zip(figures.values(), of_draw, strict=True):
            values.append(float(value))
    summary = {name: float(FIGURES[name](values)) for name, values in figures.items()}
    errors = figures["error' J error / p"]
    return {**summary, "its standard error": float(np.std(errors) / np.sqrt(draws))}


def main():
    parser = options(__doc__)
    parser.add_argument("draws", nargs="?", type=int, default=400, help="noise realisations of each problem")
    parser.add_argument("--samples", type=int, help="length of the records; by default each problem's own")
    parser.add_argument("--snr", type=float, metavar="DB", help="signal to noise; by default each problem's own")
    asked = parser.parse_args()
    warnings.simplefilter("ignore", sysid.SysidWarning)
    for name, (estimator, orders) in STRUCTURES.items():
        system = harder(name, asked.samples, asked.snr)
        for figure, value in measure(system, estimator, orders, asked.draws).items():
            print(f"{name} {estimator.__name__:6s}{figure:24s}{value:10.3f}", flush=True)


if __name__ == "__main__":
    main()
