"""Resonances that last as long as the record, and plants that are unstable in their loop."""

import warnings

import numpy as np
import pytest
from scipy.signal import chirp, cont2discrete, lfilter

from sysid import IOData, SysidWarning, tfest

DT = 0.01


def _response(b, a, u):
    """Response from rest to a held input, by SciPy."""
    numerator, denominator, _ = cont2discrete((b, a), DT, "zoh")
    return lfilter(np.ravel(numerator), denominator, u)


def _light_damping(seed):
    """Numerator, denominator of two modes up to 0.8 of the Nyquist frequency, damping 0 to 0.05."""
    rng = np.random.default_rng(seed)
    a = np.ones(1)
    for _ in range(2):
        frequency, damping = rng.uniform(0.05, 0.8) * np.pi / DT, rng.choice([0.0, 1e-4, 2e-3, 0.01, 0.05])
        a = np.convolve(a, [1.0, 2.0 * damping * frequency, frequency**2])
    return a[-1:], a


@pytest.mark.parametrize("seed", range(6))
def test_two_lightly_damped_modes(seed):
    b, a = _light_damping(seed)
    rng = np.random.default_rng(100 + seed)
    u = rng.standard_normal(1500)
    y = _response(b, a, u)
    noise = 0.02 * np.std(y) * rng.standard_normal(len(u))
    estimate = tfest(IOData(u, y + noise, DT), 4, 0)
    # the minimum lies below the errors of the truth, up to what an undamped pole moved inside costs
    assert estimate.diagnostics["sum_of_squares"][0] < 1.001 * noise @ noise
    poles, truth = np.sort_complex(estimate.continuous.poles()), np.sort_complex(np.roots(a))
    np.testing.assert_allclose(np.abs(poles), np.abs(truth), rtol=2e-3)


def test_undamped_resonance_and_notch_by_a_chirp():
    """Poles at 80 Hz and zeros at 10 Hz without damping, 10,000 samples at 1 kHz."""
    dt, notch, resonance = 1e-3, 2.0 * np.pi * 10.0, 2.0 * np.pi * 80.0
    time = dt * np.arange(10_000)
    u = chirp(time, 1.0, time[-1], 150.0)
    numerator, denominator, _ = cont2discrete(([1.0, 0.0, notch**2], [1.0, 0.0, resonance**2]), dt, "zoh")
    data = IOData(u, lfilter(np.ravel(numerator), denominator, u), dt)
    with pytest.warns(SysidWarning, match="edge of stability"):
        estimate = tfest(data, 2, 2)
    np.testing.assert_allclose(np.abs(estimate.zeros()), notch, rtol=1e-3)
    np.testing.assert_allclose(np.abs(estimate.poles()), resonance, rtol=1e-5)


def _balanced_record(growth, noise):
    """Position that grows at a rate in 1/s under a PD controller, theta'' = growth^2 theta + 10 u."""
    rng = np.random.default_rng(1)
    A, B, *_ = cont2discrete(
        (np.array([[0.0, 1.0], [growth**2, 0.0]]), np.array([[0.0], [10.0]]), np.eye(2), np.zeros((2, 1))), DT
    )
    reference = np.repeat(rng.choice([-1.0, 1.0], 150), 10)
    state, last, u, y = np.zeros(2), 0.0, [], []
    for value in reference:
        y.append(state[0] + noise * rng.standard_normal())
        u.append(value - 8.0 * y[-1] - 0.6 * (y[-1] - last) / DT)
        last = y[-1]
        state = A @ state + B[:, 0] * u[-1]
    return IOData(np.array(u), np.array(y), DT)


@pytest.mark.parametrize("growth", [3.0, 5.0])
def test_unstable_plants_are_named(growth):
    data = _balanced_record(growth, 1e-3)
    with pytest.warns(SysidWarning, match=rf"modulus {np.exp(growth * DT):.3f}"):
        tfest(data, 2, 0)


@pytest.mark.parametrize("seed", range(5))
def test_stable_plants_beside_a_random_walk_are_not_called_unstable(seed):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(800)
    walk = np.cumsum(rng.standard_normal(800))
    y = _response([25.0], [1.0, 3.0, 25.0], u) + 0.1 * (walk - walk.mean())
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        tfest(IOData(u, y, DT), 2, 0)
    assert not any("may be unstable" in str(warning.message) for warning in caught)
