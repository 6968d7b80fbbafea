"""Efficiency, coverage and time of the prediction-error estimators, each on problems of its class.

Run by hand: `python tests/benchmarks/efficiency.py [draws]`. Per problem it writes the mean of error' J error / p (1 is
the Cramer-Rao bound), the coverage of nominal 95 % intervals of parameters and bandwidth, the number of unstable models
and of runs that did not converge, and the median time.
"""

import importlib.util
import sys
import time
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import sysid


def problems() -> ModuleType:
    """The problems stand beside the tests of the analyst."""
    path = Path(__file__).parents[1] / "sysid" / "conftest.py"
    spec = importlib.util.spec_from_file_location("problems", path)
    if spec is None or spec.loader is None:
        raise ImportError(f"cannot load {path}")
    module = importlib.util.module_from_spec(spec)
    sys.modules["problems"] = module
    spec.loader.exec_module(module)
    return module


def measure(problem: Any, estimator: Any, orders: tuple[int, ...], draws: int) -> dict[str, float]:
    """Run one problem over `draws` noise realisations."""
    information, hz = problem.information(), problem.model.bandwidth()[0, 0]
    errors, covered, bandwidths, responses, seconds = [], [], [], [], []
    f = np.geomspace(0.01, 0.8, 12) * 0.5 / problem.model.dt
    magnitude = np.abs(problem.model.frequency_response(f))
    unstable = failed = 0
    for seed in range(draws):
        data = problem.draw(seed)
        begin = time.perf_counter()
        estimate = estimator(data, *orders)
        seconds.append(time.perf_counter() - begin)
        error = estimate.parameters - problem.parameters
        errors.append(error @ information @ error / len(error))
        covered.append(np.mean(np.abs(error) <= 1.96 * np.sqrt(np.diag(estimate.covariance))))
        bandwidths.append(bool(estimate.bandwidth().covers(hz)[0, 0]))
        low, high = estimate.frequency_response(f).magnitude_ci95()
        responses.append(np.mean((low <= magnitude) & (magnitude <= high)))
        unstable += not estimate.model.is_stable()
        failed += not estimate.diagnostics["converged"]
    return {
        "error' J error / p": float(np.mean(errors)),
        "its standard error": float(np.std(errors) / np.sqrt(draws)),
        "coverage, parameters": float(np.mean(covered)),
        "coverage, bandwidth": float(np.mean(bandwidths)),
        "coverage, response": float(np.mean(responses)),
        "unstable": unstable,
        "not converged": failed,
        "median ms": 1e3 * float(np.median(seconds)),
    }


def main() -> None:
    """Measure all and write a line per figure."""
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 400
    made = problems()
    plan = {
        "p1": (sysid.armax, (5, 3, 5, 2)),
        "p2": (sysid.oe, (2, 2, 1)),
        "p3": (sysid.armax, (2, 2, 2, 1)),
        "p4": (sysid.bj, (2, 2, 2, 2, 1)),
        "p5": (sysid.arx, (3, 3, 2)),
    }
    for name, (estimator, orders) in plan.items():
        problem = getattr(made, f"make_{name}")()
        for figure, value in measure(problem, estimator, orders, draws).items():
            sys.stdout.write(f"{name} {estimator.__name__:6s}{figure:24s}{value:10.3f}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
