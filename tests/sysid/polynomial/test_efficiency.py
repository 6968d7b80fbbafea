"""Prediction-error estimates reach the Cramer-Rao bound, and their intervals cover."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sysid import Estimate, IOData, armax, bj, oe

# problem, estimator, draws, deviation of the mean normalised error from 1 and range of the coverage (about three
# standard deviations of a mean of so many chi-squares and correlated hits), least coverage of the bandwidth
CASES: dict[str, tuple[str, Callable[[IOData], Estimate], int, float, tuple[float, float], float]] = {
    "armax": ("p3", lambda d: armax(d, 2, 2, 2, 1), 150, 0.15, (0.92, 0.975), 0.90),
    "oe": ("p2", lambda d: oe(d, 2, 2, 1), 100, 0.22, (0.90, 1.0), 0.88),
    "bj": ("p4", lambda d: bj(d, 2, 2, 2, 2), 100, 0.15, (0.92, 0.975), 0.88),
}


@pytest.mark.parametrize("method", CASES)
def test_efficient_and_covered(method: str, request: pytest.FixtureRequest) -> None:
    """The normalised error of the parameters is chi-square over the Cramer-Rao bound."""
    name, identify, draws, tolerance, (lowest, highest), least = CASES[method]
    problem: Any = request.getfixturevalue(name)
    information, true_hz = problem.information(), problem.model.bandwidth()[0, 0]
    normalised, hits, bandwidths = [], [], []
    for seed in range(draws):
        estimate = identify(problem.draw(seed))
        error = estimate.parameters - problem.parameters
        normalised.append(error @ information @ error / len(error))
        hits.append(np.abs(error) <= 1.96 * np.sqrt(np.diag(estimate.covariance)))
        bandwidths.append(bool(estimate.bandwidth().covers(true_hz)[0, 0]))
        assert method == "oe" or estimate.diagnostics["converged"]
        assert method != "bj" or estimate.model.is_stable()
    assert abs(np.mean(normalised) - 1.0) < tolerance
    assert lowest < np.mean(hits) < highest
    assert np.mean(bandwidths) > least
