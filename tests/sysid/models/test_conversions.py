import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import block_diag
from scipy.signal import lfilter, lsim

import sysid
from sysid import IOData, Polynomials, StateSpace, SysidWarning, balred, c2d, d2c, damp, predict, simulate
from sysid.models import hankel_singular_values
from sysid.models.continuous import c2d_matched, d2c_matched
from sysid.models.zero_pole_gain import ZeroPoleGain
from tests.refusals import refused

DT = 0.02
GRID = np.linspace(0.0, 24.0, 25)


@st.composite
def models(draw, *, channels=2, gain=False):
    """Well-conditioned: poles of moderate modulus, each in a block of its own, then a random rotation."""
    seed = draw(st.integers(0, 10_000))
    n = draw(st.integers(1, 6))
    rng = np.random.default_rng(seed)
    A = np.zeros((0, 0))
    while len(A) < n:
        if n - len(A) > 1 and rng.random() < 0.5:
            pole = rng.uniform(0.4, 0.95) * np.exp(1j * rng.uniform(0.1, 2.0))
            A = block_diag(A, [[pole.real, pole.imag], [-pole.imag, pole.real]])
        else:
            A = block_diag(A, rng.uniform(0.2, 0.95))
    rotation = np.linalg.qr(rng.standard_normal((n, n)))[0]
    nu, ny = (draw(st.integers(1, channels)) for _ in range(2))
    K = 0.1 * rng.standard_normal((n, ny)) if gain else None
    B, C = rng.standard_normal((n, nu)), rng.standard_normal((ny, n))
    D = rng.standard_normal((ny, nu)) * rng.integers(0, 2)
    return StateSpace(rotation @ A @ rotation.T, B, C, D, K, DT)


def assert_same_response(model, expected, tolerance=1e-8):
    g = expected.frequency_response(GRID)
    np.testing.assert_allclose(model.frequency_response(GRID), g, atol=tolerance * np.abs(g).max())


@pytest.mark.slow
@given(models())
def test_held_inputs_there_and_back(model):
    continuous = d2c(model)
    assert continuous.isctime(strict=True)
    back = c2d(continuous, DT)
    np.testing.assert_allclose(back.A, model.A, atol=1e-10)
    np.testing.assert_allclose(back.B, model.B, atol=1e-9)
    assert back.input_names == model.input_names
    np.testing.assert_allclose(continuous.dcgain().reshape(model.D.shape), model.dc_gain(), rtol=1e-7, atol=1e-9)


def test_first_order_lag_in_continuous_time_by_hand():
    """1 / (tau s + 1) held: a = exp(-dt / tau), b = 1 - a."""
    tau = 0.3
    a = np.exp(-DT / tau)
    model = c2d(control.tf([1.0], [tau, 1.0]), DT)
    np.testing.assert_allclose(model.poles(), [a], rtol=1e-12)
    np.testing.assert_allclose(model.markov(3)[:, 0, 0], [0.0, 1 - a, a * (1 - a)], rtol=1e-10)
    back = d2c(model)
    np.testing.assert_allclose(back.poles(), [-1 / tau], rtol=1e-10)


@pytest.mark.slow
@given(models(channels=1))
def test_linear_inputs_there_and_back(model):
    continuous = d2c(model, intersample="foh")
    t = np.arange(60) * DT
    u = np.cumsum(np.random.default_rng(0).standard_normal(60))
    # between the samples lsim takes the input as linear; both start at rest with u(0) = 0
    _, y, _ = lsim((continuous.A, continuous.B, continuous.C, continuous.D), u - u[0], t)
    np.testing.assert_allclose(
        c2d(continuous, DT, intersample="foh").frequency_response(GRID), model.frequency_response(GRID), atol=1e-8
    )
    np.testing.assert_allclose(simulate(model, u - u[0])[:, 0], y, atol=1e-8 * max(np.abs(y).max(), 1.0))


@pytest.mark.slow
@pytest.mark.parametrize("intersample", ["zoh", "foh"])
@pytest.mark.parametrize(
    "estimator, orders", [(sysid.armax, (2, 2, 2, 3)), (sysid.bj, (2, 1, 1, 2, 1)), (sysid.oe, (2, 2, 2))]
)
def test_conversion_of_an_estimate_keeps_noise_model_delays_and_covariance(estimator, orders, intersample):
    truth = sysid.models.innovations_form(
        Polynomials(B=[0, 0, 0, 0.1, 0.05], F=[1, -1.5, 0.7], C=[1, 0.3], D=[1, -0.5]), 0.1, 0.01
    )
    u = np.random.default_rng(0).standard_normal(500)
    data = IOData(u, simulate(truth, u, rng=np.random.default_rng(1)), 0.1, intersample=intersample)
    discrete = estimator(data, *orders)
    continuous = d2c(discrete)
    back = c2d(continuous, 0.1)
    for name in ("frequency_response", "noise_response"):
        expected = getattr(discrete.model, name)(GRID)
        np.testing.assert_allclose(getattr(back.model, name)(GRID), expected, rtol=1e-6, atol=1e-9)
    assert continuous.continuous.delays == pytest.approx(0.1 * (orders[-1] - 1))
    np.testing.assert_allclose(
        damp(continuous).natural_frequency.ci95, damp(discrete).natural_frequency.ci95, rtol=1e-6
    )
    np.testing.assert_allclose(continuous.bandwidth().ci95, discrete.bandwidth().ci95, rtol=0.05)


def test_estimates_know_how_their_input_behaved_between_samples():
    """A record of a lag of 0.05 s with a linear input gives the lag back; taken as held, half a sample of delay."""
    u = np.random.default_rng(0).standard_normal(400)
    lag = c2d(control.tf([1.0], [0.05, 1.0]), DT, intersample="foh")
    data = IOData(u, simulate(lag, u), DT, intersample="foh")
    estimate = sysid.oe(data, 2, 1, 0)
    linear, held = d2c(estimate).to_control(), d2c(estimate, intersample="zoh").to_control()
    np.testing.assert_allclose((linear.C @ linear.B, linear.D, held.D > 0.1), ([[20.0]], [[0.0]], [[True]]), atol=1e-6)
    limited = sysid.oe(sysid.resample(data, 2), 2, 1, 0)
    with pytest.warns(SysidWarning, match="band-limited: taken as held"):
        d2c(limited)
    refused("intersample must be 'zoh'", lambda: c2d(control.tf([1.0], [0.05, 1.0]), DT, intersample="bl"))


def test_integrators_survive():
    double = c2d(control.ss([[0, 1.0], [0, 0]], [[0], [1.0]], [[1.0, 0]], [[0.0]]), DT)
    np.testing.assert_allclose(double.markov(3)[:, 0, 0], [0, DT**2 / 2, 1.5 * DT**2], rtol=1e-10)
    np.testing.assert_allclose(d2c(double).A @ d2c(double).A, 0.0, atol=1e-6)


def test_negative_poles_become_pairs_at_nyquist_as_in_matlab():
    """The example of MATLAB's page "Convert Discrete-Time System to Continuous Time": order 2 becomes 3."""
    states = control.ss(control.zpk([-0.5], [-2.0, 5.0], 1.0, dt=0.1))
    discrete = StateSpace(states.A, states.B, states.C, states.D, None, 0.1)
    with pytest.warns(SysidWarning, match=r"1 pole.* -2, become complex pairs at the Nyquist frequency.* order 3"):
        continuous = control.tf(d2c(discrete))
    numerator, denominator = continuous.num[0][0], continuous.den[0][0]
    np.testing.assert_allclose(numerator[-3:], 2.6663 * np.array([1.0, 14.28, 780.9]), rtol=1e-3)
    np.testing.assert_allclose(denominator, np.convolve([1.0, -16.09], [1.0, -13.86, 1035.0]), rtol=1e-3)


@pytest.mark.parametrize("intersample", ["zoh", "foh"])
@pytest.mark.parametrize(
    "A",
    [
        [[-0.5]],
        [[-1.0]],
        [[-0.5, 1.0], [0.0, -0.5]],
        [[0.9, 0.3, 0], [0, -0.3, 0.2], [0, 0, -0.2]],
        [[1.0, 2], [0, -0.019]],
    ],
)
def test_negative_poles_keep_the_response_at_the_samples(A, intersample):
    n = len(A)
    discrete = StateSpace(A, np.ones((n, 1)), np.ones((1, n)), [[0.3]], None, DT)
    with pytest.warns(SysidWarning, match="negative real axis"):
        continuous = d2c(discrete, intersample=intersample)
    back = c2d(continuous, DT, intersample=intersample)
    np.testing.assert_allclose(back.markov(50), discrete.markov(50), rtol=1e-9, atol=1e-9)


def test_an_estimate_with_a_negative_pole_keeps_its_noise_model_and_its_file(tmp_path):
    rng = np.random.default_rng(0)
    u, e = rng.standard_normal((2, 2000))
    y = lfilter([0, -2.145, 4.224], [1, -0.9742, -0.01883], u) + lfilter([1], [1, -0.9742, -0.01883], e)
    estimate = sysid.arx(IOData(u, y, 4.5e-4), 2, 2)
    with pytest.warns(SysidWarning, match="order 3"):
        continuous = d2c(estimate)
    assert continuous.continuous.order == 3
    np.testing.assert_allclose(continuous.covariance, estimate.covariance)
    f = np.linspace(1.0, 1100.0, 20)
    for model in (
        c2d(continuous, 4.5e-4).model,
        sysid.read_model(sysid.write_model(continuous, tmp_path / "a.json")).model,
    ):
        for name in ("frequency_response", "noise_response"):
            np.testing.assert_allclose(getattr(model, name)(f), getattr(estimate.model, name)(f), rtol=1e-9)


def test_what_has_no_continuous_counterpart_is_refused():
    delay = StateSpace([[0.0]], [[1.0]], [[1.0]], [[0.0]], None, DT)
    refused(r"1 pole\(s\) at zero, samples of delay, .* exp\(s dt\) is never zero", lambda: d2c(delay))
    negative = StateSpace([[-0.5]], [[1.0]], [[1.0]], [[0.0]], None, DT)
    refused(r"1 pole\(s\) at zero or on the negative real axis, -0\.5", d2c_matched, negative)
    refused("expected a continuous-time", lambda: c2d(delay.to_control(), DT))
    refused("dt must lie between", lambda: c2d(control.tf([1.0], [1.0, 1.0]), 0.0))
    refused("grows with frequency", lambda: c2d_matched(control.tf([1.0, 0.0], [1.0]), DT))
    two = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    refused("one input and one output", c2d_matched, two, DT)
    refused("2 zeros and only 1 poles", c2d, control.tf([1.0, 1.0, 1.0], [1.0, 1.0]), DT)


def test_a_gain_has_no_dynamics_to_sample():
    for system in (control.ss([], [], [], [[2.0]]), control.tf([2.0], [1.0])):
        for sample in (c2d, c2d_matched):
            assert sample(system, 0.1).order == 0
            assert sample(system, 0.1).dc_gain() == 2.0
    assert c2d(control.tf([1.0], [1.0, 1.0]), np.int64(2)).dt == 2.0


@pytest.mark.filterwarnings("ignore:Badly conditioned")
def test_a_leading_coefficient_of_rounding_is_none():
    rounded, exact = (c2d_matched(control.tf(n, [1.0, 2.0, 1.0]), 0.1) for n in ([1e-17, 1.0], [1.0]))
    np.testing.assert_allclose(rounded.markov(9), exact.markov(9), rtol=1e-12)


@pytest.mark.parametrize(
    "system",
    [
        control.tf([2.0], [0.3, 1.0]),
        control.tf([1.0, 40.0], [1.0, 6.0, 100.0]),
        control.tf([5.0], [1.0, 6.0, 100.0, 30.0]),
        control.tf([1.0, 0.0], [1.0, 6.0, 100.0]),
        control.tf([3.0], [1.0, 4.0, 0.0]),
    ],
)
def test_matched_there_and_back(system):
    model = c2d_matched(system, DT)
    np.testing.assert_allclose(np.sort_complex(model.poles()), np.sort_complex(np.exp(system.poles() * DT)), atol=1e-9)
    back = d2c_matched(model)
    f = np.array([0.2, 1.0, 4.0])
    expected = np.array([system(2j * np.pi * x) for x in f])
    np.testing.assert_allclose([back(2j * np.pi * x) for x in f], expected, rtol=0.02)
    exact = np.isfinite(system.dcgain()) and system.dcgain() != 0.0
    if exact:
        np.testing.assert_allclose(model.dc_gain()[0, 0], system.dcgain(), rtol=1e-9)
        np.testing.assert_allclose([back(2j * np.pi * x) for x in f], expected, rtol=1e-6)
    np.testing.assert_allclose(model.frequency_response([0.2])[0, 0, 0], system(2j * np.pi * 0.2), rtol=0.1)


@pytest.mark.slow
@given(models(channels=1))
def test_zeros_poles_and_gain_there_and_back(model):
    form = sysid.zero_pole_gain(model)
    g = model.frequency_response(GRID)[:, 0, 0]
    np.testing.assert_allclose(form.frequency_response(GRID), g, atol=1e-7 * np.abs(g).max())
    assert_same_response(form.to_state_space(), model, 1e-7)
    assert form.to_state_space().order == model.order
    assert_same_response(StateSpace.from_control(form.to_control()), model, 1e-5)


@given(models())
def test_transfer_functions_agree_with_the_state_space(model):
    system = sysid.transfer_function(model)
    response = np.array([np.reshape(system(np.exp(2j * np.pi * DT * f)), (model.ny, model.nu)) for f in GRID])
    expected = model.frequency_response(GRID)
    np.testing.assert_allclose(response, expected, atol=1e-6 * np.abs(expected).max())


def test_transfer_function_by_hand():
    """y1 = 2 / (z - 0.5) u1, nothing from u2."""
    model = StateSpace([[0.5]], [[1.0, 0.0]], [[2.0]], [[0.0, 0.0]], None, DT, input_names=("a", "b"))
    system = sysid.transfer_function(model)
    np.testing.assert_allclose(system.num[0][0], [2.0])
    np.testing.assert_allclose(system.den[0][0], [1.0, -0.5])
    assert not np.any(system.num[0][1])
    assert system.input_labels == ["a", "b"]
    refused("input 1 does not reach output 0", lambda: sysid.zero_pole_gain(model, input=1))
    refused("no channel from input 2", lambda: sysid.zero_pole_gain(model, input=2))
    refused("conjugates", ZeroPoleGain, [], [0.5 + 0.1j], 1.0, DT)
    refused("at most as many zeros", ZeroPoleGain, [0.1], [], 1.0, DT)


@given(models(gain=True))
def test_control_there_and_back_keeps_names(model):
    back = StateSpace.from_control(model.to_control())
    np.testing.assert_array_equal(back.A, model.A)
    assert (back.dt, back.input_names, back.output_names) == (model.dt, model.input_names, model.output_names)


@given(models(gain=True), st.booleans())
def test_reduction_to_the_whole_order_changes_nothing(model, match_dc):
    whole = balred(model, model.order, match_dc=match_dc)
    assert_same_response(whole, model, 1e-7)
    h = model.noise_response(GRID)
    np.testing.assert_allclose(whole.noise_response(GRID), h, atol=1e-7 * np.abs(h).max())


@pytest.mark.slow
@given(models(gain=True))
def test_reduction_keeps_its_bound(model):
    values = hankel_singular_values(model)
    for order in range(model.order):
        reduced = balred(model, order)
        error = reduced.frequency_response(GRID) - model.frequency_response(GRID)
        assert np.linalg.norm(error, 2, axis=(1, 2)).max() <= 2 * values[order:].sum() * (1 + 1e-9) + 1e-9
        matched = balred(model, order, match_dc=True)
        np.testing.assert_allclose(matched.dc_gain(), model.dc_gain(), atol=1e-6 * np.abs(model.dc_gain()).max())
    refused(f"order must be a whole number from 0 to {model.order}", balred, model, model.order + 1)
    refused("stable", balred, StateSpace([[1.1]], [[1.0]], [[1.0]], [[0.0]], None, DT), 0)


@pytest.mark.filterwarnings("ignore:the predictor is unstable")
@given(models(gain=True), st.booleans())
def test_initial_states_are_recovered(model, simulation):
    rng = np.random.default_rng(0)
    x0 = rng.standard_normal(model.order)
    u = rng.standard_normal((60, model.nu))
    data = IOData(u, simulate(model, u, x0=x0), DT)
    predicted = predict(
        model, data, steps=None if simulation else 1, x0=sysid.findstates(model, data, simulation=simulation)
    )
    np.testing.assert_allclose(predicted, data.y, atol=1e-6 * np.abs(data.y).max())


def test_the_noise_models_own_poles_have_no_part_in_the_path():
    """Path 0.5 z^-1 / (1 - 0.8 z^-1), noise with a pole at -0.66."""
    rng = np.random.default_rng(5)
    u, e = rng.standard_normal((2, 2000))
    y = lfilter([0.0, 0.5], [1.0, -0.8], u) + lfilter([1.0], [1.0, 0.66], 0.1 * e)
    estimate = sysid.bj(IOData(u, y, DT), 1, 0, 1, 1, 1)
    assert estimate.model.order == 2
    np.testing.assert_allclose(estimate.polynomials.D, [1.0, 0.66], atol=0.05)
    assert estimate.poles() == pytest.approx([0.8], abs=0.01)
    assert len(estimate.zeros()) == 0
    assert sysid.transfer_function(estimate).poles() == pytest.approx([0.8], abs=0.01)
    assert len(sysid.zero_pole_gain(estimate).zeros) == 0
    assert d2c(estimate).poles() == pytest.approx([np.log(0.8) / DT], rel=0.05)
    assert sysid.models.poles_band(estimate).roots == pytest.approx([0.8], abs=0.01)


def test_delays_of_several_inputs_come_out_each_its_own():
    rng = np.random.default_rng(6)
    u = rng.standard_normal((500, 2))
    y = lfilter([0.0, 1.0], [1.0, -0.5], u[:, 0]) + lfilter([0.0, 0.0, 0.0, 2.0, 1.0], [1.0, -0.9], u[:, 1])
    estimate = sysid.oe(sysid.IOData(u, y, DT), (1, 2), (1, 1), (1, 3))
    model, delays = sysid.split_delay(estimate)
    assert delays == (0, 2)
    np.testing.assert_allclose(model.markov(10)[:, 0, 1], estimate.model.markov(12)[2:, 0, 1], atol=1e-9)
    np.testing.assert_allclose(model.markov(10)[:, 0, 0], estimate.model.markov(10)[:, 0, 0], atol=1e-9)


def test_sampling_zeros_have_no_match_and_are_left_out():
    system = control.tf([2.0], [1.0, 3.0, 2.0])
    model = c2d(system, DT)
    assert model.zeros().real.max() < 0.0
    matched = d2c_matched(model)
    np.testing.assert_allclose(np.sort(matched.poles().real), [-2.0, -1.0], rtol=1e-9)
    assert matched.dcgain() == pytest.approx(1.0)
