"""Delays found, and the rate at which the tests err."""

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, delayest
from tests.sysid.refusals import refused


def record(delay: int, seed: int, hold: int = 1, samples: int = 1500, noise: float = 0.3) -> IOData:
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], samples // hold + 1), hold)[:samples] + 2.0
    e = lfilter([1.0], [1, -0.7], rng.standard_normal(samples))
    return IOData(u, lfilter(np.r_[np.zeros(delay), 1.0, 0.5], [1, -1.3, 0.5], u) + noise * e + 5.0, 0.02)


@pytest.mark.parametrize("delay", [0, 1, 4, 11])
def test_both_ways_find_the_delay(delay: int) -> None:
    found = delayest(record(delay, seed=delay))
    assert found.arx[0, 0] == found.correlation[0, 0] == delay
    assert found.p_values.shape == found.correlations.shape == (21, 1, 1)


def test_a_held_input_too() -> None:
    """Neighbouring lags of an input held for five samples are nearly the same."""
    assert [delayest(record(6, seed, hold=5)).arx[0, 0] for seed in range(5)] == [6] * 5


def test_delay_is_missed_only_at_the_rate_of_the_test() -> None:
    by_arx, by_correlation = zip(
        *((f.arx[0, 0], f.correlation[0, 0]) for f in (delayest(record(5, seed, samples=600)) for seed in range(60))),
        strict=True,
    )
    # at every lag before the delay 1 % may go wrong, in the correlation 1 % altogether
    assert by_arx.count(5) >= 55
    assert by_correlation.count(5) >= 57


def test_without_noise_and_with_several_channels() -> None:
    u = np.random.default_rng(0).standard_normal((600, 2))
    y = np.column_stack((lfilter([0, 0, 1.0], 1, u[:, 0]), lfilter([0, 0, 0, 0, 1.0], [1, -0.5], u[:, 1])))
    found = delayest(IOData(u, y, 1.0), largest=8)
    np.testing.assert_array_equal(found.arx, [[2, -1], [-1, 4]])
    np.testing.assert_array_equal(found.correlation, [[2, -1], [-1, 4]])


def test_two_experiments() -> None:
    parts = [record(3, 0, samples=400), record(3, 1, samples=700)]
    assert delayest(parts).arx[0, 0] == 3
    assert delayest(parts).correlation[0, 0] == 3


def test_refusals() -> None:
    data = record(1, 0, samples=60)
    refused("too little data: 40 lags", lambda: delayest(data[:45]))
    refused("largest must be", lambda: delayest(data, largest=-1))
    refused("level", lambda: delayest(data, level=1.0))
