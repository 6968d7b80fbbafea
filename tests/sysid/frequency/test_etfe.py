"""Empirical transfer function estimates."""

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, SysidError, etfe
from tests.sysid.refusals import refused

B, A = [0, 0.5], [1, -0.5]


def periodic(seed: int, noise: float = 0.0) -> IOData:
    """Third period of a periodic input: the transient is gone."""
    rng = np.random.default_rng(seed)
    u = np.tile(np.random.default_rng(99).standard_normal(200), 3)
    return IOData(u, lfilter(B, A, u) + noise * rng.standard_normal(600), 0.1)[400:]


def test_exact_on_a_whole_period() -> None:
    found = etfe(periodic(0))
    z = np.exp(-2j * np.pi * found.frequencies * 0.1)
    np.testing.assert_allclose(found.response[:, 0, 0], 0.5 * z / (1 - 0.5 * z), rtol=1e-9)
    assert len(found.frequencies) == 100
    assert found.covariance is None


def test_silent_frequencies_are_left_out() -> None:
    t = np.arange(400)
    u = np.sin(2 * np.pi * 10 * t / 400) + np.sin(2 * np.pi * 30 * t / 400)
    np.testing.assert_allclose(etfe(IOData(u, 2 * u, 0.1)).frequencies, [10 / 40, 30 / 40])


def test_averaging_and_its_covariance() -> None:
    found = etfe([periodic(seed, 0.3) for seed in range(60)])
    z = np.exp(-2j * np.pi * found.frequencies * 0.1)
    error = found.response[:, 0, 0] - 0.5 * z / (1 - 0.5 * z)
    # the noise of a mean of 60 stands in the single variances already: compare after averaging
    scaled = np.abs(error) ** 2 / np.einsum("...ii->...", found.covariance)[:, 0, 0]
    assert 0.7 < np.mean(scaled) < 1.4


def test_smoothing_is_its_definition() -> None:
    data = IOData(*np.random.default_rng(0).standard_normal((2, 101)), 0.1)
    found = etfe(data, smoothing=3)
    u, y = np.fft.fft(data.u[:, 0]), np.fft.fft(data.y[:, 0])
    w = np.hanning(9)[1:-1]
    for k in (1, 20, 50):
        near = [(k + d) % 101 for d in range(-3, 4)]
        expected = np.sum(w * y[near] * u[near].conj()) / np.sum(w * np.abs(u[near]) ** 2)
        assert found.response[k - 1, 0, 0] == pytest.approx(expected, rel=1e-10)
    raw = etfe(data)
    np.testing.assert_array_equal(raw.frequencies, found.frequencies)
    np.testing.assert_allclose(raw.response[:, 0, 0], (y / u)[1:51])


def test_smoothing_leaves_out_the_initialisation_window() -> None:
    data = IOData(*np.random.default_rng(0).standard_normal((2, 300)), 0.1, window=100)
    np.testing.assert_array_equal(etfe(data, smoothing=5).response, etfe(data[100:], smoothing=5).response)
    np.testing.assert_array_equal(etfe(data).response, etfe(data[100:]).response)


def test_refusals() -> None:
    refused("from 0 to 99", lambda: etfe(periodic(0), smoothing=100))
    with pytest.raises(SysidError, match="one input, got 2"):
        etfe(IOData(np.random.default_rng(0).standard_normal((20, 2)), np.ones(20), 0.1))
    refused("equal length", lambda: etfe([periodic(0), periodic(0)[:100]]))
