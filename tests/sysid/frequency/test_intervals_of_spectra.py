"""Nominal 95 % intervals of the nonparametric estimates, counted."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.signal.windows import parzen

from sysid import FrequencyResponse, IOData, arx, etfe, spa, welch
from tests.sysid.refusals import refused

DT = 0.1
F = np.linspace(0.3, 4.7, 23)


def record(seed: int) -> IOData:
    """First-order system, coloured disturbance, steady state."""
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal((2, 2100))
    y = lfilter([0, 0.5], [1, -0.8], u) + lfilter([0.5], [1, -0.5], e)
    return IOData(u, y, DT)[100:]


@pytest.mark.parametrize(
    "estimate",
    [
        lambda d: spa(d, frequencies=F),
        lambda d: spa(d, lag=60, frequencies=F),
        lambda d: spa(d, lag=120, window=parzen, frequencies=F),
        lambda d: welch(d, segment=200),
        lambda d: etfe(d, smoothing=10),
    ],
    ids=["spa", "spa short", "spa parzen", "welch", "etfe"],
)
def test_coverage(estimate: Callable[[IOData], FrequencyResponse]) -> None:
    magnitude, phase, noise = [], [], []
    for seed in range(80):
        found = estimate(record(seed))
        keep = (found.frequencies > 0.2) & (found.frequencies < 4.8)
        z = np.exp(-2j * np.pi * DT * found.frequencies[keep])
        g, spectrum = 0.5 * z / (1 - 0.8 * z), 0.25 * DT / np.abs(1 - 0.5 * z) ** 2
        low, high = (edge[keep, 0, 0] for edge in found.magnitude_ci95())
        magnitude.append(np.mean((low <= np.abs(g)) & (np.abs(g) <= high)))
        low, high = (edge[keep, 0, 0] for edge in found.phase_ci95())
        away = np.angle(np.exp(1j * (0.5 * (low + high) - np.angle(g))))
        phase.append(np.mean(np.abs(away) <= 0.5 * (high - low)))
        low, high = (edge[keep, 0] for edge in found.noise_ci95())
        noise.append(np.mean((low <= spectrum) & (spectrum <= high)))
    # about 80 * 15 independent intervals: a standard error of 0.006
    for covered in (magnitude, phase, noise):
        assert 0.93 <= np.mean(covered) <= 0.97


def test_too_little_smoothing_is_refused() -> None:
    data = record(0)
    two = IOData(np.hstack((data.u, data.u[::-1])), data.y, DT)
    refused(r"1\.28 independent averages, with 2 input", lambda: spa(two, lag=1960))
    refused("1 independent averages", lambda: welch(data, segment=2000))


def test_a_parametric_response_has_normal_intervals() -> None:
    response = arx(record(0), 1, 1).frequency_response(F)
    assert response.quantile_95 == pytest.approx(1.959964)
    assert spa(record(0)).quantile_95 == pytest.approx(2.07, abs=0.03)
    refused("no disturbance spectrum", lambda: response.noise_ci95())


def test_a_response_lost_in_noise_is_not_claimed_to_be_above_zero() -> None:
    covered = []
    for seed in range(30):
        u, e = np.random.default_rng(seed).standard_normal((2, 2000))
        found = spa(IOData(u, np.roll(u, 1) + np.sqrt(10.0) * e, 0.1), lag=100)
        low, high = (edge[5:-5, 0, 0] for edge in found.magnitude_ci95())
        covered.append(np.mean((low <= 1.0) & (high >= 1.0)))
    assert 0.94 < np.mean(covered) < 0.99
    still = FrequencyResponse(
        np.array([1.0]), np.array([[[0.3 + 0.0j]]]), 0.1, "none", covariance=np.eye(2).reshape(1, 1, 1, 2, 2)
    )
    low, high = still.magnitude_ci95()
    assert low[0, 0, 0] == pytest.approx(0.0, abs=1e-9)
    assert high[0, 0, 0] == pytest.approx(np.sqrt(6.9491), rel=1e-3)  # noncentral chi-square by tables
