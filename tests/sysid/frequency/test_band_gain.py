import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import kstest

from sysid import IOData, bla
from sysid.frequency.band_gain import band_gain
from tests.refusals import refused

PERIOD, LINES, REALISATIONS = 200, np.arange(1, 60), 5


def records(seed, coupling, noise=0.05, cubic=0.2):
    """Two inputs, orthogonal over pairs of records; the first output is a cubic Wiener system of the first input alone,
    and of the second by `coupling`; the second output depends on both."""
    rng, out = np.random.default_rng(seed), []
    for _ in range(REALISATIONS):
        spectra = np.exp(2j * np.pi * rng.random((2, len(LINES))))
        for e in range(2):
            whole = np.zeros((2, PERIOD // 2 + 1), dtype=complex)
            whole[:, LINES] = np.exp(2j * np.pi * rng.random(len(LINES))) * spectra * [[1.0], [-1.0 if e else 1.0]]
            u = np.tile(np.fft.irfft(whole, PERIOD), (1, 3)).T
            u = u / u.std()
            x = lfilter([0.3], [1, -0.7], u, axis=0)
            y = np.column_stack([x[:, 0] + cubic * x[:, 0] ** 3 + coupling * x[:, 1], x.sum(axis=1)])
            out.append(IOData(u, y + noise * rng.standard_normal(y.shape), 0.02, window=PERIOD))
    return out


def true_gain():
    z = np.exp(-2j * np.pi * LINES / PERIOD)
    return np.sqrt(np.mean(np.abs(0.3 / (1 - 0.7 * z)) ** 2))


def test_gain_of_a_linear_system_without_noise_is_exact():
    found = band_gain(bla(records(0, 0.1, noise=1e-9, cubic=0.0), PERIOD))
    expected = true_gain() * np.array([[1.0, 0.1], [1.0, 1.0]])
    for values in (found.gain, found.low, found.high):
        np.testing.assert_allclose(values, expected, rtol=1e-6)
    assert (found.p < 1e-100).all()


@pytest.mark.slow
def test_test_keeps_its_level_and_intervals_cover_although_the_other_input_distorts():
    gains = [band_gain(bla(records(seed, 0.0), PERIOD)) for seed in range(100)]
    p = np.array([one.p[0, 1] for one in gains])
    assert kstest(p, "uniform").pvalue > 0.01
    assert np.mean([one.low[0, 1] == 0.0 for one in gains]) > 0.9
    assert all(one.p[1, 1] < 1e-10 for one in gains)
    coupled = [band_gain(bla(records(seed, 0.05), PERIOD)) for seed in range(60)]
    held = [one.low[0, 1] <= 0.05 * true_gain() <= one.high[0, 1] for one in coupled]
    assert np.mean(held) >= 0.85


def test_a_single_realisation_has_no_variance():
    refused("at least two realisations", band_gain, bla(records(0, 0.0)[:2], PERIOD))
    refused("level", band_gain, bla(records(0, 0.0), PERIOD), level=2.0)
