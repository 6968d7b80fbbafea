import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, bla
from tests.refusals import refused
from tests.sysid.systems import covered

PERIOD, DT = 512, 0.02
LINES = np.arange(1, 180)


def multisine(seed, periods, lines=LINES):
    """Random phases, unit variance."""
    spectrum = np.zeros(PERIOD // 2 + 1, dtype=complex)
    spectrum[lines] = np.exp(2j * np.pi * np.random.default_rng(seed).random(len(lines)))
    one = np.fft.irfft(spectrum, PERIOD)
    return np.tile(one / one.std(), periods)


def records(cubic, noise, realisations=8, periods=5, seed=0):
    """Wiener-Hammerstein: filter, x + cubic x^3, filter; the first period settles."""
    out = []
    for r in range(realisations):
        u = multisine(1000 * seed + r, periods + 1)
        x = lfilter([0.5], [1, -0.5], u)
        y = lfilter([0, 1.0], [1, -0.3], x + cubic * x**3)
        e = np.random.default_rng(5000 + 1000 * seed + r).standard_normal(len(u))
        out.append(IOData(u, y + noise * lfilter([1.0], [1, -0.6], e), DT, window=PERIOD))
    return out


def linear(f):
    z = np.exp(-2j * np.pi * f * DT)
    return 0.5 / (1 - 0.5 * z) * z / (1 - 0.3 * z)


def test_exact_on_a_linear_system_without_noise():
    estimate = bla(records(0.0, 0.0), PERIOD)
    np.testing.assert_array_equal(estimate.lines, LINES)
    np.testing.assert_allclose(estimate.response.frequencies, LINES / (PERIOD * DT))
    np.testing.assert_allclose(estimate.response.response[:, 0, 0], linear(estimate.response.frequencies), rtol=1e-9)
    assert estimate.total_variance.max() < 1e-20


def test_a_linear_system_has_noise_and_no_distortion():
    estimate = bla(records(0.0, 0.2), PERIOD)
    f = estimate.response.frequencies
    # noise of variance S per sample: a mean over P periods and R realisations of line amplitude |U|
    shape = 0.04 / np.abs(1 - 0.6 * np.exp(-2j * np.pi * f * DT)) ** 2
    expected = shape * PERIOD / 5 / 8 / np.abs(np.fft.rfft(multisine(0, 1)))[LINES] ** 2
    assert np.mean(estimate.noise_variance[:, 0, 0] / expected) == pytest.approx(1.0, abs=0.05)
    assert np.mean(estimate.total_variance[:, 0, 0] / expected) == pytest.approx(1.0, abs=0.1)
    p = estimate.distortion_p[:, 0, 0]
    assert 0.40 < np.mean(p) < 0.60
    assert np.mean(p < 0.05) < 0.10
    error = np.abs(estimate.response.response[:, 0, 0] - linear(f)) ** 2
    assert np.mean(error / estimate.total_variance[:, 0, 0] * (7 - 1) / 7) == pytest.approx(1.0, abs=0.25)
    assert np.mean(covered(estimate.response.magnitude_ci95(), np.abs(linear(f))[:, None, None])) > 0.90


def test_a_cubic_changes_the_gain_and_distorts():
    """For a Gaussian x the best gain of x + c x^3 is 1 + 3 c var(x) [Pintelon2012, ch. 4]."""
    c = 0.1
    estimate = bla(records(c, 0.02, realisations=20), PERIOD)
    f = estimate.response.frequencies
    x = lfilter([0.5], [1, -0.5], multisine(0, 2))[PERIOD:]
    expected = (1 + 3 * c * np.var(x)) * linear(f)
    ratio = estimate.response.response[:, 0, 0] / expected
    assert np.mean(ratio.real) == pytest.approx(1.0, abs=0.01)
    assert abs(np.mean(ratio.imag)) < 0.01
    assert np.mean(estimate.distortion_p < 0.01) > 0.95
    # the scatter of single realisations that played no part
    others = np.array([bla(records(c, 0.0, 1, seed=s), PERIOD).response.response[:, 0, 0] for s in range(1, 41)])
    scatter = others.var(axis=0, ddof=1)
    assert np.mean(estimate.distortion_variance[:, 0, 0]) == pytest.approx(np.mean(scatter), rel=0.1)
    # distortion of a cubic grows with the square of its coefficient
    twice = bla(records(2 * c, 0.02, realisations=20), PERIOD)
    growth = np.mean(twice.distortion_variance) / np.mean(estimate.distortion_variance)
    assert growth == pytest.approx(4.0, rel=0.02)


def test_two_inputs_take_two_records_each():
    rng = np.random.default_rng(0)
    out = []
    for r in range(6):
        a, b = multisine(2 * r, 4), multisine(2 * r + 1, 4)
        # orthogonal: the second record has the sign of one input turned
        for sign in (1.0, -1.0):
            u = np.column_stack((a, sign * b))
            y = np.column_stack((lfilter([0, 1.0], [1, -0.5], u[:, 0]) + 2 * u[:, 1], -u[:, 0]))
            out.append(IOData(u, y + 0.01 * rng.standard_normal(y.shape), DT, window=PERIOD))
    estimate = bla(out, PERIOD)
    z = np.exp(-2j * np.pi * estimate.response.frequencies * DT)
    truth = np.zeros((len(z), 2, 2), dtype=complex)
    truth[:, 0, 0], truth[:, 0, 1], truth[:, 1, 0] = z / (1 - 0.5 * z), 2.0, -1.0
    scaled = np.abs(estimate.response.response - truth) ** 2 / estimate.noise_variance
    np.testing.assert_allclose(scaled.mean(axis=0), 1.0, atol=0.25)
    assert np.mean(estimate.distortion_p) == pytest.approx(0.5, abs=0.05)


def test_one_realisation_knows_of_noise_only():
    estimate = bla(records(0.0, 0.2, realisations=1), PERIOD, lines=[3, 10])
    assert np.isnan(estimate.distortion_variance).all()
    np.testing.assert_allclose(np.einsum("...ii->...", estimate.response.covariance), estimate.noise_variance)
    assert estimate.response.degrees_of_freedom == 8.0
    np.testing.assert_array_equal(estimate.lines, [3, 10])


def test_refusals():
    data = records(0.0, 0.0, 2, 3)
    refused("fewer than two periods of 1000", lambda: bla(data, 1000))
    refused("period must be", lambda: bla(data, 2))
    refused("lines must be whole numbers from 1 to 255", lambda: bla(data, PERIOD, lines=[256]))
    refused("no power at the line", lambda: bla(data, PERIOD, lines=[5, 200]))
    both = IOData(np.hstack((data[0].u, data[0].u)), data[0].y, DT)
    refused("a realisation takes 2 records, got 1", lambda: bla(both, PERIOD))
    refused("linearly dependent", lambda: bla([both, both], PERIOD))
    refused("constant over a period", lambda: bla(IOData(np.ones(1200), np.ones(1200), DT), PERIOD))
