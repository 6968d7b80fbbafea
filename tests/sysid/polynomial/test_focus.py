import warnings

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import butter, freqz, lfilter, sosfilt

import sysid
from sysid import IOData, SysidError

B, F = [0.0, 1.0, 0.4], [1.0, -1.2, 0.5]
DT = 0.1


@pytest.fixture
def rng():
    return np.random.default_rng(11)


def record(rng, samples=1500, colour=0.9):
    u = rng.standard_normal(samples)
    v = lfilter([1.0], [1.0, -colour], 0.3 * rng.standard_normal(samples))
    return IOData(u, lfilter(B, F, u) + v, dt=DT)


def quiet(estimator, *args, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return estimator(*args, **options)


def test_the_simulation_of_one_input_has_the_path_of_the_output_error_model(rng):
    data = record(rng)
    reference = sysid.oe(data, 2, 2)
    for fit in (
        sysid.arx(data, 2, 2, focus="simulation"),
        sysid.armax(data, 2, 2, 2, focus="simulation"),
        sysid.bj(data, 2, 1, 1, 2, focus="simulation"),
    ):
        path = fit.polynomials
        denominator = np.convolve(np.atleast_1d(path.A), np.atleast_1d(path.F))
        np.testing.assert_allclose(np.concatenate((path.B[1:], denominator[1:])), reference.parameters, atol=1e-5)
        of_b1 = fit.parameter_names.index("b1")
        assert fit.covariance[of_b1, of_b1] == pytest.approx(reference.covariance[0, 0], rel=1e-2)
    # the noise model is fitted too: v = 0.9 v(t-1) + e
    assert fit.parameters[fit.parameter_names.index("d1")] == pytest.approx(-0.9, abs=0.05)
    assert fit.noise_variance[0, 0] == pytest.approx(0.09, rel=0.15)


def test_the_simulation_of_two_inputs_shares_a(rng):
    u = rng.standard_normal((400, 2))
    y = lfilter([0.0, 1.0], [1.0, -0.8], u[:, 0]) + lfilter([0.0, -0.5], [1.0, -0.8], u[:, 1])
    data = IOData(u, y + 0.3 * rng.standard_normal(400), dt=DT)
    fit = sysid.arx(data, 1, (1, 1), focus="simulation")

    def errors(theta):
        a, b1, b2, state = theta
        initial = np.zeros(400)
        initial[0] = state
        return data.y[:, 0] - lfilter([1.0], [1.0, a], np.concatenate(([0.0], u[:-1] @ [b1, b2])) + initial)

    expected = least_squares(errors, [-0.7, 1.0, -0.4, 0.0], xtol=1e-14, ftol=1e-14).x
    np.testing.assert_allclose(fit.parameters, expected[:3], atol=1e-5)


def test_a_band_is_a_fit_to_signals_behind_the_same_filter(rng):
    data = record(rng)
    sections = butter(5, [0.5, 3.0], "bandpass", fs=1.0 / DT, output="sos")
    u, y = sosfilt(sections, data.u[:, 0]), sosfilt(sections, data.y[:, 0])
    fit = sysid.oe(data, 2, 2, focus=(0.5, 3.0), initial_conditions="zero")
    same = sysid.oe(IOData(u, y, dt=DT), 2, 2, initial_conditions="zero")
    np.testing.assert_allclose(fit.parameters, same.parameters, rtol=1e-10)
    regression = quiet(sysid.arx, data, 2, 2, focus=(0.0, 3.0))
    low = butter(5, 3.0, fs=1.0 / DT, output="sos")
    _, poles, _ = butter(5, 3.0, fs=1.0 / DT, output="zpk")
    settled = int(np.ceil(np.log(0.01) / np.log(np.abs(poles).max())))
    u, y = sosfilt(low, data.u[:, 0])[settled - 2 :], sosfilt(low, data.y[:, 0])[settled - 2 :]
    phi = np.column_stack((-y[1:-1], -y[:-2], u[1:-1], u[:-2]))
    # the filters differ in their initial state alone, which has decayed to 1 %
    np.testing.assert_allclose(regression.parameters, np.linalg.lstsq(phi, y[2:], rcond=None)[0], atol=1e-3)


@pytest.mark.parametrize(("band", "tested"), [((0.0, 0.3), [0.02, 0.1, 0.2]), ((1.5, 4.0), [2.0, 3.0])])
def test_a_model_that_is_too_small_is_better_in_its_band(band, tested, rng):
    u = rng.standard_normal(4000)
    f = np.poly([0.97, 0.2])
    b = 0.1 * np.array([0.0, 1.0, -0.2]) + 0.5 * np.array([0.0, 1.0, -0.97])
    data = IOData(u, lfilter(b, f, u) + 0.01 * rng.standard_normal(4000), dt=DT)
    truth = freqz(b, f, tested, fs=1.0 / DT)[1]
    errors = []
    for focus in ("prediction", band):
        model = quiet(sysid.oe, data, 1, 1, focus=focus).model
        errors.append(np.abs(model.frequency_response(tested)[:, 0, 0] / truth - 1.0).max())
    assert errors[1] < 0.6 * errors[0]


def test_transients_of_the_filter_are_cut_off(rng):
    # a part of a longer record, far from zero: without noise hardly anything of the filter's beginning remains
    u = 5.0 + rng.standard_normal(3000)
    data = IOData(u, lfilter(B, F, u), dt=DT)[1000:]
    for estimator, orders in ((sysid.oe, (2, 2)), (sysid.arx, (2, 2)), (sysid.armax, (2, 2, 1))):
        polynomials = quiet(estimator, data, *orders, focus=(0.3, 4.0)).polynomials
        np.testing.assert_allclose(polynomials.B, B, atol=2e-3)
        np.testing.assert_allclose(np.convolve(np.atleast_1d(polynomials.A), polynomials.F), F, atol=2e-3)


def test_intervals_hold_in_a_band():
    inside = []
    for seed in range(60):
        fit = quiet(sysid.oe, record(np.random.default_rng(seed), 800), 2, 2, focus=(0.3, 3.0))
        inside.append(np.abs(fit.parameters - [1.0, 0.4, -1.2, 0.5]) < 1.96 * np.sqrt(np.diag(fit.covariance)))
    # 228 of 240 correlated ones are expected
    assert np.sum(inside) >= 208


def test_an_estimate_in_a_band_knows_its_record(rng):
    data = record(rng)
    assert quiet(sysid.compare, sysid.oe(data, 2, 2, focus=(0.5, 3.0)), data)[0].is_training
    assert quiet(sysid.compare, sysid.arx(data, 2, 2, focus="simulation"), data)[0].is_training


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"focus": "stability"}, "'prediction', 'simulation' or"),
        ({"focus": (3.0, 1.0)}, "0 <= low < high"),
        ({"focus": 2.0}, "two frequencies"),
        ({"focus": (6.0, 7.0)}, "below Nyquist, 5 Hz"),
        ({"focus": (0.0, 5.0)}, "got all of it"),
        ({"focus": (0.5, 3.0), "offset": True}, "offset"),
        ({"focus": (0.0, 3.0), "trend": True}, "trend"),
        ({"focus": (1.0, 1.01)}, "samples to settle"),
        ({"focus": (1.0, 1.005)}, "narrower than the longest record of 150 s resolves: expected 0.00667 Hz"),
        ({"focus": (1e-9, 2e-9)}, "narrower than"),
        ({"focus": (4.9999, 6.0), "initial_conditions": "zero"}, "narrower than"),
        ({"focus": (1e-9, 2e-9), "initial_conditions": "zero"}, "narrower than"),
    ],
)
def test_wrong_bands_are_refused(options, message, rng):
    with pytest.raises(SysidError, match=message):
        sysid.oe(record(rng), 2, 2, **options)


def test_the_rounding_of_a_filtered_constant_is_no_input(rng):
    data = IOData(np.full(400, 3.7), rng.standard_normal(400), dt=DT)
    with pytest.raises(SysidError, match=r"input u1 is constant \(3.7\)"):
        sysid.oe(data, 1, 1, focus=(0.5, 4.0))


def test_options_that_do_not_go_together_are_refused(rng):
    data = record(rng)
    y = data.y.copy()
    y[100] = np.nan
    with pytest.raises(SysidError, match="missing samples"):
        sysid.oe(IOData(data.u, y, dt=DT, missing=True), 2, 2, focus=(0.5, 3.0))
    for options in ({"error_threshold": 1.6}, {"fixed": {"A": [1, -1.2, np.nan]}}, {"coloured": True}):
        with pytest.raises(SysidError, match="focus='simulation'"):
            sysid.armax(data, 2, 2, 2, focus="simulation", **options)
    with pytest.raises(SysidError, match="regularisation"):
        sysid.arx(data, 2, 2, focus="simulation", regularisation="tc")
    with pytest.raises(SysidError, match="regularisation"):
        sysid.arx(data, 2, 2, focus=(0.5, 3.0), regularisation="tc")


def test_an_infinite_upper_edge_is_none(rng):
    data = record(rng)
    to_infinity = sysid.oe(data, 2, 2, focus=(0.1, np.inf))
    to_nyquist = sysid.oe(data, 2, 2, focus=(0.1, 0.5 / DT))
    np.testing.assert_array_equal(to_infinity.parameters, to_nyquist.parameters)
    with pytest.raises(SysidError, match="two frequencies"):
        sysid.oe(data, 2, 2, focus=(0.1, np.nan))
