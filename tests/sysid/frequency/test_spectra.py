import warnings
from functools import partial

import numpy as np
import pytest
import scipy.signal
from scipy.signal import lfilter
from scipy.signal.windows import parzen

from sysid import FrequencyResponse, IOData, SysidWarning, arx, etfe, spa, welch
from sysid.polynomial import correlation
from sysid.polynomial.correlation import covariance_function
from tests.refusals import refused
from tests.sysid.systems import covered


def noise(seed, samples, dt=0.1, window=0):
    return IOData(*np.random.default_rng(seed).standard_normal((2, samples)), dt, window=window)


def first_order(samples):
    u, e = np.random.default_rng(0).standard_normal((2, samples))
    return IOData(u, lfilter([0, 1.0], [1, -0.7], u) + 0.1 * e, 0.5)


def test_blackman_tukey_is_its_definition():
    data, f = first_order(300), np.array([0.1, 0.4, 1.0])
    estimate = spa(data, lag=20, frequencies=f)
    window, lags = np.hamming(41), np.arange(-20, 21)

    def transform(a, b):
        r = covariance_function([a], [b], 20)[:, 0, 0]
        return np.array([0.5 * np.sum(window * r * np.exp(-2j * np.pi * x * 0.5 * lags)) for x in f])

    phi_u, phi_y, phi_yu = transform(data.u, data.u), transform(data.y, data.y), transform(data.y, data.u)
    for spectrum, expected in (
        (estimate.response, phi_yu / phi_u),
        (estimate.coherence, np.abs(phi_yu) ** 2 / (phi_u * phi_y).real),
        (estimate.input_spectrum, phi_u),
        (estimate.cross_spectrum, phi_yu),
    ):
        np.testing.assert_allclose(spectrum[:, 0, 0], expected, rtol=1e-10)
    np.testing.assert_allclose(estimate.noise_spectrum[:, 0, 0], phi_y - np.abs(phi_yu) ** 2 / phi_u, rtol=1e-8)


def test_welch_is_that_of_scipy():
    data = first_order(1000)
    u, y = data.u[:, 0], data.y[:, 0]
    estimate = welch(data, segment=128, window=np.hamming)
    options = {"fs": 2.0, "window": np.hamming(128), "nperseg": 128, "detrend": False, "return_onesided": False}
    phi_uy = scipy.signal.csd(u, y, **options)[1][1:64]
    phi_u = scipy.signal.welch(u, **options)[1][1:64]
    coherence = scipy.signal.coherence(u, y, 2.0, np.hamming(128), 128, detrend=False)[1][1:]
    for spectrum, expected in (
        (estimate.cross_spectrum[:63], phi_uy),
        (estimate.input_spectrum[:63], phi_u),
        (estimate.response[:63], phi_uy / phi_u),
        (estimate.coherence, coherence),
    ):
        np.testing.assert_allclose(spectrum[:, 0, 0], expected, rtol=1e-9)


def test_spectra_integrate_to_the_variance():
    x = np.random.default_rng(1).standard_normal(5000)
    f = np.linspace(-25.0, 25.0, 401)
    estimate = spa(IOData(x, 3.0 * x, 0.02), lag=100, frequencies=np.abs(f))
    assert np.trapezoid(estimate.input_spectrum[:, 0, 0].real, f) == pytest.approx(np.mean(x**2), rel=1e-3)
    assert np.trapezoid(estimate.output_spectrum[:, 0, 0].real, f) == pytest.approx(9 * np.mean(x**2), rel=1e-3)
    np.testing.assert_allclose(estimate.response[:, 0, 0], 3.0, rtol=1e-9)


def test_disturbance_spectrum_is_the_noise():
    """Coloured noise beside a flat response, less the part sum(w^2)/N of it that the response has fitted."""
    u, e = np.random.default_rng(0).standard_normal((2, 12_000))
    f = np.linspace(1, 24, 200)
    estimate = spa(IOData(u, 2 * u + lfilter([1.0], [1, -0.5], e), 0.02), lag=1200, frequencies=f)
    truth = 0.02 / np.abs(1 - 0.5 * np.exp(-2j * np.pi * f * 0.02)) ** 2
    fitted = np.sum(np.hamming(2401) ** 2) / 12_000
    assert np.mean(estimate.noise_spectrum[:, 0, 0].real / truth) == pytest.approx(1 - fitted, rel=0.05)


@pytest.mark.parametrize(("estimator", "tolerance"), [(partial(spa, lag=50), 1e-8), (welch, 1e-10)])
def test_inputs_that_correlate_are_distinguished(estimator, tolerance):
    u = np.random.default_rng(2).standard_normal((8000, 2))
    u[:, 1] += 0.8 * u[:, 0]
    y = np.column_stack((u[:, 0] - 2 * u[:, 1], 0.5 * u[:, 1]))
    response = estimator(IOData(u, y, 1.0)).response
    np.testing.assert_allclose(response, np.broadcast_to([[1, -2], [0, 0.5]], response.shape), atol=tolerance)


def test_experiments_are_averaged_not_joined():
    data = noise(3, 600)
    one, both = spa(data, lag=30), spa([data, data], lag=30)
    np.testing.assert_allclose(both.response, one.response, rtol=1e-9)
    # half the variance; the disturbance is short of one average in K, which is made up for
    k = 600 / np.sum(np.hamming(61) ** 2)
    share = 0.5 * (2 * k / (2 * k - 1)) / (k / (k - 1))
    np.testing.assert_allclose(both.covariance, share * one.covariance, rtol=1e-6)
    assert both.degrees_of_freedom == pytest.approx(2 * (2 * k - 1))
    data = noise(1, 900, window=100)
    whole, parts = (welch(d, segment=100, overlap=0.0) for d in (data, [data[100:500], data[500:]]))
    np.testing.assert_allclose(parts.input_spectrum, whole.input_spectrum, rtol=1e-12)
    assert parts.degrees_of_freedom == pytest.approx(14.0)


def test_the_default_lag_is_a_tenth_of_the_samples_and_30_at_most():
    for samples, lag in ((150, 15), (4000, 30)):
        data = noise(3, samples)
        np.testing.assert_array_equal(spa(data).response, spa(data, lag=lag).response)


@pytest.mark.parametrize("lags", [0, 1, 40])
def test_covariances_of_blocks_are_those_of_the_record(monkeypatch, lags):
    x, z = np.random.default_rng(0).standard_normal((2, 1500, 2))
    whole = covariance_function([x, x[:7]], [z, z[:7]], lags)
    monkeypatch.setattr(correlation, "LARGEST_PRODUCT", 1)
    np.testing.assert_allclose(covariance_function([x, x[:7]], [z, z[:7]], lags), whole, atol=1e-12)


def test_the_window_is_chosen_and_the_initialisation_window_left_out():
    data = noise(3, 600, window=100)
    estimate = spa(data, lag=20, window=np.bartlett)
    np.testing.assert_array_equal(estimate.response, spa(data[100:], lag=20, window=np.bartlett).response)
    assert estimate.degrees_of_freedom == pytest.approx(2 * (500 / np.sum(np.bartlett(41) ** 2) - 1))
    assert not np.allclose(estimate.response, spa(data, lag=20).response)
    assert (estimate.noise_spectrum.real > 0).all()


def test_a_window_shorter_than_the_response_is_reported():
    u = np.random.default_rng(0).standard_normal(3000)
    slow = IOData(u, lfilter([0.02], [1.0, -0.98], u), 0.01)
    with pytest.warns(SysidWarning, match="window of 30 samples is shorter than the response"):
        spa(slow)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", message=".*shorter than the response")
        spa(slow, lag=300)
        spa(IOData(u, lfilter([1.0], [1.0, -0.8], u), 0.01))


def test_nothing_is_claimed_where_the_input_is_silent():
    """Beside a single tone there are gaps, and everything made of the response keeps them."""
    u = np.sin(0.3 * np.arange(2000))
    estimate = spa(IOData(u, np.roll(u, 1) + 0.1 * np.random.default_rng(0).standard_normal(2000), 0.05))
    unknown = np.isnan(estimate.covariance[:, 0, 0, 0, 0])
    assert 0.2 < np.mean(unknown) < 1.0
    for edge in estimate.magnitude_ci95():
        np.testing.assert_array_equal(np.isnan(edge[:, 0, 0]), unknown)
    np.testing.assert_array_equal(np.isfinite(estimate.phase), np.isfinite(estimate.response))
    assert estimate.coherence.min() >= 0.0
    at_tone = int(np.argmin(np.abs(estimate.frequencies - 0.3 / (2 * np.pi * 0.05))))
    assert abs(estimate.response[at_tone, 0, 0]) == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize(
    ("message", "call"),
    [
        ("lag must be", lambda: spa(noise(3, 100), lag=100)),
        ("Nyquist", lambda: spa(noise(3, 100), frequencies=[6.0])),
        ("1 in the middle", lambda: spa(noise(3, 100), lag=20, window=lambda n: np.zeros(n))),
        ("constant", lambda: spa(IOData(np.ones(50), np.arange(50.0), 0.1))),
        ("segment must be", lambda: welch(noise(3, 100), segment=101)),
        ("overlap", lambda: welch(noise(3, 100), overlap=1.0)),
        ("as many finite", lambda: welch(noise(3, 100), segment=10, window=lambda n: np.ones(n + 1))),
        ("constant", lambda: welch(IOData(np.ones(50), np.arange(50.0), 0.1))),
        ("from 0 to 99", lambda: etfe(noise(3, 200), smoothing=100)),
        ("one input, got 2", lambda: etfe(IOData(np.random.default_rng(0).standard_normal((20, 2)), np.ones(20), 0.1))),
        ("equal length", lambda: etfe([noise(3, 200), noise(3, 100)])),
    ],
)
def test_refusals(message, call):
    refused(message, call)


DT = 0.1
F = np.linspace(0.3, 4.7, 23)


def record(seed):
    """First-order system, coloured disturbance, steady state."""
    u, e = np.random.default_rng(seed).standard_normal((2, 2100))
    return IOData(u, lfilter([0, 0.5], [1, -0.8], u) + lfilter([0.5], [1, -0.5], e), DT)[100:]


def magnitudes_covered(estimate, magnitude, keep):
    return float(np.mean(covered([edge[keep, 0, 0] for edge in estimate.magnitude_ci95()], magnitude)))


@pytest.mark.thorough
@pytest.mark.parametrize(
    "estimator",
    [
        lambda d: spa(d, lag=200, frequencies=F),
        lambda d: spa(d, lag=60, frequencies=F),
        lambda d: spa(d, lag=120, window=parzen, frequencies=F),
        lambda d: welch(d, segment=200),
        lambda d: etfe(d, smoothing=10),
    ],
    ids=["spa", "spa short", "spa parzen", "welch", "etfe"],
)
def test_coverage(estimator):
    magnitude, phase, noise = [], [], []
    for seed in range(80):
        estimate = estimator(record(seed))
        keep = (estimate.frequencies > 0.2) & (estimate.frequencies < 4.8)
        z = np.exp(-2j * np.pi * DT * estimate.frequencies[keep])
        g, spectrum = 0.5 * z / (1 - 0.8 * z), 0.25 * DT / np.abs(1 - 0.5 * z) ** 2
        magnitude.append(magnitudes_covered(estimate, np.abs(g), keep))
        low, high = (edge[keep, 0, 0] for edge in estimate.phase_ci95())
        away = np.angle(np.exp(1j * (0.5 * (low + high) - np.angle(g))))
        phase.append(np.mean(np.abs(away) <= 0.5 * (high - low)))
        noise.append(np.mean(covered([edge[keep, 0] for edge in estimate.noise_ci95()], spectrum)))
    # about 80 * 15 independent intervals: a standard error of 0.006
    for shares in (magnitude, phase, noise):
        assert 0.93 <= np.mean(shares) <= 0.97


@pytest.mark.thorough
def test_a_window_that_makes_the_disturbance_negative_still_gives_intervals_that_cover():
    shares = []
    for seed in range(20):
        u, e = np.random.default_rng(seed).standard_normal((2, 2000))
        estimate = spa(IOData(u, lfilter([0.0, 0.0, 0.0, 1.0, 0.5], [1.0, -1.2, 0.5], u) + 0.1 * e, DT), lag=200)
        assert np.isfinite(estimate.magnitude_deviation()).all()
        assert estimate.noise_spectrum.real.min() > -1e-9 * np.abs(estimate.output_spectrum).max()
        z = np.exp(-2j * np.pi * estimate.frequencies * DT)
        truth = np.abs((z**3 + 0.5 * z**4) / (1 - 1.2 * z + 0.5 * z**2))
        shares.append(magnitudes_covered(estimate, truth, slice(None)))
    assert np.mean(shares) == pytest.approx(0.95, abs=0.03)


@pytest.mark.slow
def test_a_response_lost_in_noise_is_not_claimed_to_be_above_zero():
    shares = []
    for seed in range(30):
        u, e = np.random.default_rng(seed).standard_normal((2, 2000))
        estimate = spa(IOData(u, np.roll(u, 1) + np.sqrt(10.0) * e, DT), lag=100)
        shares.append(magnitudes_covered(estimate, 1.0, slice(5, -5)))
    assert 0.94 < np.mean(shares) < 0.99
    covariance = np.eye(2).reshape(1, 1, 1, 2, 2)
    still = FrequencyResponse(np.array([1.0]), np.array([[[0.3 + 0.0j]]]), DT, "none", covariance=covariance)
    low, high = still.magnitude_ci95()
    assert low[0, 0, 0] == pytest.approx(0.0, abs=1e-9)
    assert high[0, 0, 0] == pytest.approx(np.sqrt(6.9491), rel=1e-3)  # noncentral chi-square by tables


def test_too_little_smoothing_is_refused_and_a_parametric_response_has_normal_intervals():
    data = record(0)
    two = IOData(np.hstack((data.u, data.u[::-1])), data.y, DT)
    refused(r"1\.28 independent averages, with 2 input", lambda: spa(two, lag=1960))
    refused("1 independent averages", lambda: welch(data, segment=2000))
    response = arx(data, 1, 1).frequency_response(F)
    assert response.quantile_95 == pytest.approx(1.959964)
    assert spa(data, lag=len(data) // 10).quantile_95 == pytest.approx(2.07, abs=0.03)
    refused("no disturbance spectrum", response.noise_ci95)


def periodic(seed, noise=0.0):
    """Third period of a periodic input: the transient is gone."""
    rng = np.random.default_rng(seed)
    u = np.tile(np.random.default_rng(99).standard_normal(200), 3)
    return IOData(u, lfilter([0, 0.5], [1, -0.5], u) + noise * rng.standard_normal(600), 0.1)[400:]


def test_etfe_is_exact_on_a_whole_period():
    estimate = etfe(periodic(0))
    z = np.exp(-2j * np.pi * estimate.frequencies * 0.1)
    np.testing.assert_allclose(estimate.response[:, 0, 0], 0.5 * z / (1 - 0.5 * z), rtol=1e-9)
    assert len(estimate.frequencies) == 100
    assert estimate.covariance is None


def test_silent_frequencies_are_left_out():
    t = np.arange(400)
    u = np.sin(2 * np.pi * 10 * t / 400) + np.sin(2 * np.pi * 30 * t / 400)
    np.testing.assert_allclose(etfe(IOData(u, 2 * u, 0.1)).frequencies, [10 / 40, 30 / 40])


def test_averaging_of_etfe_and_its_covariance():
    estimate = etfe([periodic(seed, 0.3) for seed in range(60)])
    z = np.exp(-2j * np.pi * estimate.frequencies * 0.1)
    error = estimate.response[:, 0, 0] - 0.5 * z / (1 - 0.5 * z)
    # the noise of a mean of 60 stands in the single variances already: compare after averaging
    scaled = np.abs(error) ** 2 / np.einsum("...ii->...", estimate.covariance)[:, 0, 0]
    assert 0.7 < np.mean(scaled) < 1.4


def test_smoothing_of_etfe_is_its_definition():
    data = IOData(*np.random.default_rng(0).standard_normal((2, 101)), 0.1)
    estimate = etfe(data, smoothing=3)
    u, y = np.fft.fft(data.u[:, 0]), np.fft.fft(data.y[:, 0])
    w = np.hanning(9)[1:-1]
    for k in (1, 20, 50):
        near = [(k + d) % 101 for d in range(-3, 4)]
        expected = np.sum(w * y[near] * u[near].conj()) / np.sum(w * np.abs(u[near]) ** 2)
        assert estimate.response[k - 1, 0, 0] == pytest.approx(expected, rel=1e-10)
    raw = etfe(data)
    np.testing.assert_array_equal(raw.frequencies, estimate.frequencies)
    np.testing.assert_allclose(raw.response[:, 0, 0], (y / u)[1:51])


def test_smoothing_leaves_out_the_initialisation_window():
    data = IOData(*np.random.default_rng(0).standard_normal((2, 300)), 0.1, window=100)
    np.testing.assert_array_equal(etfe(data, smoothing=5).response, etfe(data[100:], smoothing=5).response)
    np.testing.assert_array_equal(etfe(data).response, etfe(data[100:]).response)
