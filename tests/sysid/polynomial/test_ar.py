"""Autoregressive and ARMA models of time series, and forecasts of them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, Polynomials, SysidWarning
from sysid.models import innovations_form, poles_band
from tests.refusals import refused
from tests.sysid.systems import CORRELATED_OUTPUTS, covered, losing, near, second_order

# Yearly sunspot numbers of 1770 to 1869 [BoxJenkins1976, series E]
SUNSPOTS = [
    *(101, 82, 66, 35, 31, 7, 20, 92, 154, 125, 85, 68, 38, 23, 10, 24, 83, 132, 131, 118, 90, 67, 60, 47, 41),
    *(21, 16, 6, 4, 7, 14, 34, 45, 43, 48, 42, 28, 10, 8, 2, 0, 1, 5, 12, 14, 35, 46, 41, 30, 24),
    *(16, 7, 4, 2, 8, 17, 36, 50, 62, 67, 71, 48, 28, 8, 13, 57, 122, 138, 103, 86, 63, 37, 24, 11, 15),
    *(40, 62, 98, 124, 96, 66, 64, 54, 39, 21, 7, 4, 23, 55, 94, 96, 77, 59, 44, 47, 30, 16, 7, 37, 74),
]
DATA = IOData(None, SUNSPOTS, 1.0).detrend()
MODEL = innovations_form(Polynomials(A=[1.0, -1.22500573, 0.56059628], B=[], C=[1.0, 0.38452508]), 1.0, 213.95150713)
APPROACHES = ("fb", "ls", "burg", "yw")


def simulated(seed, c=(1.0,), samples=400):
    e = np.random.default_rng(seed).standard_normal(samples + 200)
    return IOData(None, lfilter(c, [1.0, -1.5, 0.7], e)[200:], 0.1)


def test_exact_without_noise():
    t = np.arange(80)
    damped = 0.97**t * np.cos(0.3 * t) + 0.8**t
    np.testing.assert_allclose(
        sysid.ar(IOData(None, damped, 1.0), 3, approach="ls").parameters,
        np.poly([0.8, *(0.97 * np.exp([0.3j, -0.3j]))]).real[1:],
        atol=1e-9,
    )
    sinusoids = IOData(None, np.cos(0.3 * t) + 0.5 * np.sin(1.1 * t), 1.0)
    with pytest.warns(SysidWarning, match="not stable"):
        estimate = sysid.ar(sinusoids, 4)
    np.testing.assert_allclose(estimate.parameters, np.poly(np.exp([0.3j, -0.3j, 1.1j, -1.1j])).real[1:], atol=1e-9)


def test_sunspots_of_the_textbook():
    """Yule-Walker of order 2: 1.318, -0.634 [BrockwellDavis2002, ex. 3.2.9]; Burg and "yw" as in statsmodels 0.14."""
    assert np.isclose(np.mean(SUNSPOTS), 46.93)
    np.testing.assert_allclose(sysid.ar(DATA, 2, approach="yw").parameters, [-1.31750053, 0.63412149], atol=1e-8)
    np.testing.assert_allclose(sysid.ar(DATA, 2, approach="burg").parameters, [-1.39664093, 0.7093685], atol=1e-8)


def test_approaches_agree_on_long_records_and_least_squares_is_arx():
    data = simulated(1, samples=20_000)
    estimates = {name: sysid.ar(data, 2, approach=name) for name in APPROACHES}
    for estimate in estimates.values():
        np.testing.assert_allclose(estimate.parameters, estimates["ls"].parameters, atol=2e-3)
    same = sysid.arx(data, 2, (), ())
    np.testing.assert_allclose(same.parameters, estimates["ls"].parameters, rtol=1e-9)
    np.testing.assert_allclose(same.covariance, estimates["burg"].covariance, rtol=1e-2)
    parts = [data[:10_000], data[10_000:]]
    for name in APPROACHES:
        np.testing.assert_allclose(sysid.ar(parts, 2, approach=name).parameters, [-1.5, 0.7], atol=0.02)


@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize("approach", ["burg", "yw"])
def test_always_stable(approach):
    for seed in range(20):
        y = np.cumsum(np.random.default_rng(seed).standard_normal(30))
        assert sysid.ar(IOData(None, y, 1.0), 5, approach=approach).model.is_stable()


def test_missing_outputs_and_the_spectrum():
    gapped = losing(simulated(3, (1.0, 0.5), 3000), np.random.default_rng(0).random(3000) < 0.1)
    estimate = sysid.arma(gapped, 2, 1)
    assert near(estimate, [-1.5, 0.7, 0.5], 3.0)
    assert sysid.ar(gapped, 8).model.is_stable()
    response = estimate.spectrum([0.5, 1.0, 3.0])
    low, high = response.noise_ci95()
    delay = np.exp(-2j * np.pi * response.dt * response.frequencies)
    true = 0.1 * np.abs((1.0 + 0.5 * delay) / (1.0 - 1.5 * delay + 0.7 * delay**2)) ** 2
    assert covered((low[:, 0], high[:, 0]), true).all()
    assert (high / low < 2.0).all()


def test_state_space_of_a_time_series():
    rng = np.random.default_rng(0)
    truth = replace(CORRELATED_OUTPUTS, B=np.zeros((2, 0)), D=np.zeros((2, 0)), input_names=None, input_units=None)
    data = IOData(None, sysid.simulate(truth, np.zeros((4000, 0)), rng=rng), 0.1)
    for estimate in (start := sysid.n4sid(data, 2), sysid.pem_ss(data, start)):
        np.testing.assert_allclose(np.sort(estimate.poles()), np.sort(truth.poles()), atol=0.06)
        assert sysid.resid(estimate, data).white.all()
    np.testing.assert_allclose(sysid.simulate(estimate, np.zeros((9, 0))), np.zeros((9, 2)))
    refused("innovation gain", sysid.n4sid, data, 2, gain=False)


def test_a_time_series_passes_through_the_toolbox():
    data = simulated(4, (1.0, 0.5))
    estimate = sysid.arma(data, 2, 1)
    assert str(data).endswith("no input; output y1")
    assert sysid.prefilter(data[10:].detrend(1).select(outputs=[0]), [1.0, -0.5]).nu == 0
    fit = sysid.compare(estimate, data, steps=3)[0]
    assert fit.one_step[0] > fit.ahead[0] > 0.0
    assert sysid.resid(estimate, data).passed
    assert poles_band(estimate).roots.shape == (2,)
    np.testing.assert_allclose(estimate.zeros(), [-estimate.parameters[2], 0.0], atol=1e-9)
    assert "poles from innovation to output" in str(estimate)
    spectrum = sysid.spa(data)
    assert spectrum.response.shape[1:] == (1, 0)
    np.testing.assert_array_equal(spectrum.noise_spectrum, spectrum.output_spectrum)
    assert sysid.welch(data).noise_ci95()[0].shape[1] == 1
    for figure in (sysid.plots.impulse, sysid.plots.step, sysid.plots.pzmap):
        assert figure(estimate).axes
    assert sysid.plots.spectra([spectrum, estimate]).axes[0].collections
    assert sysid.plots.record(data).axes


def test_refusals():
    series, pair = simulated(5), second_order()
    refused("got 1 input", sysid.ar, pair, 2)
    refused("got 1 input", sysid.arma, pair, 2, 1)
    refused("approach must be one of fb, ls, burg, yw", sysid.ar, series, 2, approach="levinson")
    refused("lacks .* output samples", sysid.ar, losing(series, series.y > 3), 2, approach="yw")
    refused("too many orders", sysid.ar, series, 400)
    refused("use ar or arma", sysid.armax, series, 2, 1, 1)
    refused("time series without one", sysid.oe, series, 1, 1)
    refused("no input", sysid.plots.bode, sysid.ar(series, 2))
    with pytest.warns(SysidWarning, match=r"mean dominates y1 .* detrend"):
        sysid.ar(series.subtract(y=-100.0), 2)


def test_forecast_of_the_sunspots():
    """The exact Kalman filter of statsmodels 0.14 with these parameters, complete and with a missing sample."""
    ahead = sysid.forecast(MODEL, DATA, 3)
    np.testing.assert_allclose(ahead.y[:, 0], [41.3798302, 35.515188, 20.30893017], rtol=1e-6)
    np.testing.assert_allclose(ahead.deviation[:, 0], [14.62708129, 27.71663799, 34.55757257], rtol=1e-6)
    np.testing.assert_array_equal(ahead.time, [100.0, 101.0, 102.0])
    y = np.append(DATA.y[:, 0], np.nan)
    later = sysid.forecast(MODEL, IOData(None, y, 1.0, missing=True), 2)
    np.testing.assert_allclose(later.y, ahead.y[1:], rtol=1e-9)
    np.testing.assert_allclose(later.covariance, ahead.covariance[1:], rtol=1e-9)
    gap = sysid.forecast(MODEL, losing(DATA, -3), 2)
    np.testing.assert_allclose(gap.y[:, 0], [45.43490939, 40.48268305], rtol=1e-6)
    np.testing.assert_allclose(gap.deviation[:, 0], [14.92601243, 27.95477017], rtol=1e-6)


def test_forecast_with_inputs_is_the_simulation_from_the_last_state():
    data = second_order(noise=0.0, samples=250)
    estimate = sysid.arx(data[:200], 2, 2)
    ahead = sysid.forecast(estimate, data[:200], 50, data.u[200:])
    np.testing.assert_allclose(ahead.y, data.y[200:], atol=1e-8)
    noisy = second_order(samples=250)
    estimate = sysid.arx(noisy[:200], 2, 2)
    own = sysid.forecast(estimate, noisy[:200], 50, noisy.u[200:])
    bare = sysid.forecast(estimate.model, noisy[:200], 50, noisy.u[200:])
    assert (own.deviation > bare.deviation).all()
    np.testing.assert_allclose(bare.deviation[0], np.sqrt(estimate.noise_variance[0]), rtol=1e-6)
    refused("future inputs", sysid.forecast, estimate, noisy, 5)
    refused("one row per step", sysid.forecast, estimate, noisy, 5, noisy.u[:4])
    refused("innovation covariance", sysid.forecast, replace(MODEL, innovation_covariance=None), DATA, 5)


@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
def test_a_smaller_structure_without_parameters():
    """A decaying oscillation of 100 samples a period: the search tries arma(1, 1) and then a model of noise alone."""
    z = np.exp((-0.01 + 1j) * 2.0 * np.pi / 100.0)
    y = np.real(z ** np.arange(300)) + 1e-4 * np.random.default_rng(0).standard_normal(300)
    assert sysid.arma(IOData(None, y, 1.0), 2, 2).noise_variance[0, 0] < 1e-6


def test_a_short_record_warns_of_a_root_near_the_unit_circle():
    rng = np.random.default_rng(0)
    y = lfilter([1.0, 0.95], [1.0, -0.5], rng.standard_normal(80))
    with pytest.warns(SysidWarning, match="(hardly resolve|edge of stability)"):
        sysid.arma(IOData(None, y, 1.0), 1, 1)
