"""Blackman-Tukey spectra: definition, scale, truth within its own bounds."""

from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, spa
from sysid.polynomial.correlation import covariance_function
from tests.sysid.refusals import refused


def test_is_its_definition() -> None:
    rng = np.random.default_rng(0)
    u = rng.standard_normal(300)
    y = lfilter([0, 1.0], [1, -0.7], u) + 0.1 * rng.standard_normal(300)
    data = IOData(u, y, 0.5)
    f = np.array([0.1, 0.4, 1.0])
    found = spa(data, lag=20, frequencies=f)
    window, lags = np.hamming(41), np.arange(-20, 21)

    def transform(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        r = covariance_function([a[:, None]], [b[:, None]], 20)[:, 0, 0]
        return np.array([0.5 * np.sum(window * r * np.exp(-2j * np.pi * x * 0.5 * lags)) for x in f])

    phi_u, phi_y, phi_yu = transform(u, u), transform(y, y), transform(y, u)
    np.testing.assert_allclose(found.response[:, 0, 0], phi_yu / phi_u, rtol=1e-10)
    np.testing.assert_allclose(found.noise_spectrum[:, 0, 0], phi_y - np.abs(phi_yu) ** 2 / phi_u, rtol=1e-8)
    np.testing.assert_allclose(found.coherence[:, 0, 0], np.abs(phi_yu) ** 2 / (phi_u * phi_y).real, rtol=1e-10)
    np.testing.assert_allclose(found.input_spectrum[:, 0, 0], phi_u, rtol=1e-10)
    np.testing.assert_allclose(found.cross_spectrum[:, 0, 0], phi_yu, rtol=1e-10)


def test_spectra_integrate_to_the_variance() -> None:
    x = np.random.default_rng(1).standard_normal(5000)
    f = np.linspace(-25.0, 25.0, 401)
    found = spa(IOData(x, 3.0 * x, 0.02), lag=100, frequencies=np.abs(f))
    assert np.trapezoid(found.input_spectrum[:, 0, 0].real, f) == pytest.approx(np.mean(x**2), rel=1e-3)
    assert np.trapezoid(found.output_spectrum[:, 0, 0].real, f) == pytest.approx(9 * np.mean(x**2), rel=1e-3)
    np.testing.assert_allclose(found.response[:, 0, 0], 3.0, rtol=1e-9)


def test_errors_are_as_large_as_claimed(p2: Any) -> None:
    f = np.array([0.3, 1.0, 3.0, 6.0])
    truth = p2.model.frequency_response(f)
    scaled = []
    for seed in range(60):
        found = spa(p2.draw(seed).detrend(), frequencies=f)
        error = found.response - truth
        parts = np.stack((error.real, error.imag), axis=-1)
        scaled.append(parts**2 / np.einsum("...ii->...i", found.covariance))
    # now and then the spectra leave no noise at all, and no claim
    claimed = np.isfinite(scaled)
    assert claimed.mean() > 0.97
    # mean of 480 chi-squares with one degree of freedom
    assert 0.75 < np.mean(np.array(scaled)[claimed]) < 1.3


def test_disturbance_spectrum_is_the_noise() -> None:
    """Coloured noise beside a flat response, less the part sum(w^2)/N of it that the response has fitted."""
    rng = np.random.default_rng(0)
    u, e = rng.standard_normal((2, 12_000))
    f = np.linspace(1, 24, 200)
    found = spa(IOData(u, 2 * u + lfilter([1.0], [1, -0.5], e), 0.02), frequencies=f)
    truth = 0.02 / np.abs(1 - 0.5 * np.exp(-2j * np.pi * f * 0.02)) ** 2
    fitted = np.sum(np.hamming(2401) ** 2) / 12_000
    assert np.mean(found.noise_spectrum[:, 0, 0].real / truth) == pytest.approx(1 - fitted, rel=0.05)


def test_two_inputs() -> None:
    rng = np.random.default_rng(2)
    u = rng.standard_normal((8000, 2))
    u[:, 1] += 0.8 * u[:, 0]
    y = np.column_stack((u[:, 0] - 2 * u[:, 1], 0.5 * u[:, 1]))
    found = spa(IOData(u, y, 1.0), lag=50)
    np.testing.assert_allclose(found.response, np.broadcast_to([[1, -2], [0, 0.5]], found.response.shape), atol=1e-8)


def test_experiments_are_averaged() -> None:
    data = IOData(*np.random.default_rng(3).standard_normal((2, 600)), 0.1)
    both = spa([data, data], lag=30)
    np.testing.assert_allclose(both.response, spa(data, lag=30).response, rtol=1e-9)
    # half the variance; the disturbance is short of one average in K, which is made up for
    k = 600 / np.sum(np.hamming(61) ** 2)
    share = 0.5 * (2 * k / (2 * k - 1)) / (k / (k - 1))
    np.testing.assert_allclose(both.covariance, share * spa(data, lag=30).covariance, rtol=1e-6)
    assert both.degrees_of_freedom == pytest.approx(2 * (2 * k - 1))


def test_the_window_is_chosen_and_the_initialisation_window_left_out() -> None:
    data = IOData(*np.random.default_rng(3).standard_normal((2, 600)), 0.1, window=100)
    found = spa(data, lag=20, window=np.bartlett)
    np.testing.assert_array_equal(found.response, spa(data[100:], lag=20, window=np.bartlett).response)
    assert found.degrees_of_freedom == pytest.approx(2 * (500 / np.sum(np.bartlett(41) ** 2) - 1))
    assert not np.allclose(found.response, spa(data, lag=20).response)
    assert (found.noise_spectrum.real > 0).all()
    refused("1 in the middle", lambda: spa(data, lag=20, window=lambda n: np.zeros(n)))


def test_refusals() -> None:
    data = IOData(*np.random.default_rng(3).standard_normal((2, 100)), 0.1)
    refused("lag must be", lambda: spa(data, lag=100))
    refused("Nyquist", lambda: spa(data, frequencies=[6.0]))
    refused("constant", lambda: spa(IOData(np.ones(50), np.arange(50.0), 0.1)))


def test_nothing_is_claimed_where_the_input_is_silent() -> None:
    """Beside a single tone there are gaps, and everything made of the response keeps them."""
    t = np.arange(2000)
    u = np.sin(0.3 * t)
    found = spa(IOData(u, np.roll(u, 1) + 0.1 * np.random.default_rng(0).standard_normal(2000), 0.05))
    unknown = np.isnan(found.covariance[:, 0, 0, 0, 0])
    assert 0.2 < np.mean(unknown) < 1.0
    low, high = found.magnitude_ci95()
    np.testing.assert_array_equal(np.isnan(low[:, 0, 0]), unknown)
    np.testing.assert_array_equal(np.isnan(high[:, 0, 0]), unknown)
    np.testing.assert_array_equal(np.isfinite(found.phase), np.isfinite(found.response))
    assert found.coherence.min() >= 0.0
    at_tone = int(np.argmin(np.abs(found.frequencies - 0.3 / (2 * np.pi * 0.05))))
    assert abs(found.response[at_tone, 0, 0]) == pytest.approx(1.0, rel=0.02)


def test_a_window_that_makes_the_disturbance_negative_still_gives_intervals_that_cover() -> None:
    covered = []
    for seed in range(20):
        u, e = np.random.default_rng(seed).standard_normal((2, 2000))
        y = lfilter([0.0, 0.0, 0.0, 1.0, 0.5], [1.0, -1.2, 0.5], u) + 0.1 * e
        found = spa(IOData(u, y, 0.1))
        assert np.isfinite(found.magnitude_deviation()).all()
        assert found.noise_spectrum.real.min() > -1e-9 * np.abs(found.output_spectrum).max()
        z = np.exp(-2j * np.pi * found.frequencies * 0.1)
        true = np.abs((z**3 + 0.5 * z**4) / (1 - 1.2 * z + 0.5 * z**2))
        low, high = (edge[:, 0, 0] for edge in found.magnitude_ci95())
        covered.append(np.mean((low <= true) & (true <= high)))
    assert np.mean(covered) == pytest.approx(0.95, abs=0.03)
