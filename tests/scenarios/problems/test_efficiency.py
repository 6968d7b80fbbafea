"""Prediction-error estimates reach the Cramer-Rao bound, and their intervals cover, on problems of the bench."""

import pytest

from scenarios.problems.registry import problem
from tests.benchmarks.efficiency import STRUCTURES, measure

# of each problem: draws, deviation of the mean normalised error from 1 and range of the coverage (about three standard
# deviations of a mean of so many chi-squares and correlated hits), least coverage of the bandwidth
CASES = {
    "p5": (150, 0.15, (0.92, 0.975), 0.90),
    "p3": (150, 0.15, (0.92, 0.975), 0.90),
    "p2": (100, 0.22, (0.90, 1.0), 0.88),
    "p4": (100, 0.15, (0.92, 0.975), 0.88),
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", CASES)
def test_efficient_and_covered(name):
    """The normalised error of the parameters is chi-square over the Cramer-Rao bound."""
    draws, tolerance, (lowest, highest), least = CASES[name]
    figures = measure(problem(name), *STRUCTURES[name], draws)
    assert abs(figures["error' J error / p"] - 1.0) < tolerance
    assert lowest < figures["coverage, parameters"] < highest
    assert figures["coverage, bandwidth"] > least
    assert figures["not converged"] == figures["model unstable"] == 0.0
