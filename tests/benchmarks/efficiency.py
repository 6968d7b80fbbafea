"""Efficiency, coverage and time of the prediction-error estimators, each on problems of its class.

Run by hand from the root of the repository:

    PYTHONPATH=. python tests/benchmarks/efficiency.py 400
    PYTHONPATH=. python tests/benchmarks/efficiency.py 400 --samples 500 --snr 0

Per problem it writes the mean of error' J error / p (1 is the Cramer-Rao bound), the coverage of nominal 95 % intervals
of parameters and bandwidth, how many predictors and models are unstable, how many fits explain less than nothing or did
not converge, and the processor time. J is the information at the true parameters: with little data and much noise the
error leaves the region where it describes the criterion, the more so the nearer the structure is to being redundant.
"""

import argparse
import sys
import time
import warnings
from dataclasses import replace
from typing import Any

import numpy as np

import sysid
from tests.sysid import conftest as problems

BURN_IN = 500


def harder(problem: Any, samples: int | None, snr_db: float | None) -> Any:
    """The same system in a record of another length, its disturbance of another power."""
    shorter = problem if samples is None else replace(problem, samples=samples)
    if snr_db is None:
        return shorter
    disturbance = shorter.output(shorter.innovations(0)) - shorter.noise_free
    ratio = float(np.var(shorter.noise_free[BURN_IN:]) / np.var(disturbance)) / 10.0 ** (snr_db / 10.0)
    return replace(shorter, variance=shorter.variance * ratio)


def measure(problem: Any, estimator: Any, orders: tuple[int, ...], draws: int, first: int) -> dict[str, float]:
    """Run one problem over `draws` noise realisations."""
    information, hz = problem.information(), problem.model.bandwidth()[0, 0]
    errors, covered, bandwidths, responses, seconds = [], [], [], [], []
    f = np.geomspace(0.01, 0.8, 12) * 0.5 / problem.model.dt
    magnitude = np.abs(problem.model.frequency_response(f))
    unstable = runaway = diverged = failed = 0
    for seed in range(first, first + draws):
        data = problem.draw(seed)
        begin = time.process_time()
        estimate = estimator(data, *orders)
        seconds.append(time.process_time() - begin)
        error = estimate.parameters - problem.parameters
        errors.append(error @ information @ error / len(error))
        covered.append(np.mean(np.abs(error) <= 1.96 * np.sqrt(np.diag(estimate.covariance))))
        bandwidths.append(bool(estimate.bandwidth().covers(hz)[0, 0]))
        low, high = estimate.frequency_response(f).magnitude_ci95()
        responses.append(np.mean((low <= magnitude) & (magnitude <= high)))
        m = estimate.model
        unstable += not m.is_stable()
        runaway += bool(np.abs(np.linalg.eigvals(m.A - m.gain @ m.C)).max() >= 1.0)
        cost = estimate.diagnostics.get(
            "sum_of_squares", float(estimate.residuals.ravel() @ estimate.residuals.ravel())
        )
        diverged += not (np.isfinite(estimate.parameters).all() and cost <= float(np.sum(data.y**2)))
        failed += not estimate.diagnostics["converged"]
    return {
        "error' J error / p": float(np.mean(errors)),
        "its standard error": float(np.std(errors) / np.sqrt(draws)),
        "coverage, parameters": float(np.mean(covered)),
        "coverage, bandwidth": float(np.mean(bandwidths)),
        "coverage, response": float(np.mean(responses)),
        "model unstable": unstable,
        "predictor unstable": runaway,
        "diverged": diverged,
        "not converged": failed,
        "median ms": 1e3 * float(np.median(seconds)),
    }


def main() -> None:
    """Measure all and write a line per figure."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("draws", nargs="?", type=int, default=400, help="noise realisations of each problem")
    parser.add_argument("--samples", type=int, help="length of the records; by default each problem's own")
    parser.add_argument("--snr", type=float, metavar="DB", help="signal to noise; by default each problem's own")
    parser.add_argument("--seed", type=int, default=0, help="first seed of the noise")
    asked = parser.parse_args()
    warnings.simplefilter("ignore", sysid.SysidWarning)
    plan = {
        "p1": (sysid.armax, (5, 3, 5, 2)),
        "p2": (sysid.oe, (2, 2, 1)),
        "p3": (sysid.armax, (2, 2, 2, 1)),
        "p4": (sysid.bj, (2, 2, 2, 2, 1)),
        "p5": (sysid.arx, (3, 3, 2)),
    }
    for name, (estimator, orders) in plan.items():
        problem = harder(getattr(problems, f"make_{name}")(), asked.samples, asked.snr)
        for figure, value in measure(problem, estimator, orders, asked.draws, asked.seed).items():
            sys.stdout.write(f"{name} {estimator.__name__:6s}{figure:24s}{value:10.3f}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
