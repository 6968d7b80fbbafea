"""Peaks and zero crossings of signals whose own are known."""

import numpy as np
import pytest

from scenarios.thesis.simulated_outputs import crossing_distance, peak_share, simulated, unchanged_fit, zero_crossings
from sysid import IOData, StateSpace

T = np.arange(1000)


def test_a_model_of_half_the_gain_reaches_half_of_the_peaks():
    measured = np.sin(2 * np.pi * T / 50 + 0.1)
    assert peak_share(measured, measured) == pytest.approx(1.0)
    assert peak_share(measured, 0.5 * measured) == pytest.approx(0.5)
    assert peak_share(measured, -measured) == pytest.approx(-1.0)
    # Only the peaks count.
    assert peak_share(measured, np.where(np.abs(measured) > 0.95, measured, 0.0)) == pytest.approx(1.0)


def test_crossings_are_interpolated():
    assert zero_crossings(np.array([-1.0, 3.0, 1.0, 0.0, -1.0])) == pytest.approx([0.25, 3.0])
    assert zero_crossings(np.array([1.0, -1.0, 1.0])) == pytest.approx([0.5, 1.5])
    assert len(zero_crossings(np.ones(4))) == 0


@pytest.mark.parametrize("late", [0.0, 0.4, 3.0])
def test_the_distance_of_crossings_is_the_lateness(late):
    measured, later = (np.sin(2 * np.pi * (T - by) / 50 + 0.1) for by in (0.0, late))
    assert crossing_distance(measured, 0.3 * later) == pytest.approx(late, abs=0.01)
    assert crossing_distance(measured, np.ones(1000)) == np.inf
    assert crossing_distance(np.ones(1000), measured) == np.inf
    one_crossing = np.where(T < 500, -1.0, 1.0)
    assert crossing_distance(one_crossing, one_crossing) == 0.0


def test_standing_still_follows_slow_motion():
    slow, fast = (np.sin(2 * np.pi * T / period)[:, None] for period in (500, 5))
    assert unchanged_fit(IOData(slow, slow, 0.02)) == pytest.approx(100 - 100 * 2 * np.sin(np.pi / 500), abs=0.1)
    assert unchanged_fit(IOData(fast, fast, 0.02)) < 0


def test_the_simulated_output_is_that_of_the_model():
    u = np.random.default_rng(1).standard_normal(200)
    y = np.zeros(200)
    for k in range(1, 200):
        y[k] = 0.8 * y[k - 1] + 0.2 * u[k - 1]
    model = StateSpace([[0.8]], [[0.2]], [[1.0]], [[0.0]], [[0.5]], 0.02)
    assert simulated(model, IOData(u[:, None], y[:, None], 0.02)) == pytest.approx(y, abs=1e-6)
