"""Forms of models that functions on data accept: all say the same of the same system."""

import control
import numpy as np
import pytest
import scipy.signal

import sysid
from sysid import IOData, Polynomials, SysidError
from sysid.models import ContinuousModel, StateSpace
from sysid.plots import bode

DT = 0.1
NUMERATOR, DENOMINATOR = [0.0, 0.3, 0.1], [1.0, -1.2, 0.5]
CONTINUOUS = ([2.0], [1.0, 0.8, 4.0])


@pytest.fixture
def record():
    u = np.sign(np.random.default_rng(1).standard_normal(300))
    y = scipy.signal.lfilter(NUMERATOR, DENOMINATOR, u)
    return IOData(u, y, DT)


DISCRETE = {
    "polynomials": Polynomials(B=NUMERATOR, F=DENOMINATOR),
    "control transfer function": control.tf([0.3, 0.1], DENOMINATOR, DT),
    "control state space": control.ss(control.tf([0.3, 0.1], DENOMINATOR, DT)),
    "control without interval": control.tf([0.3, 0.1], DENOMINATOR, True),
    "scipy dlti": scipy.signal.dlti([0.3, 0.1], DENOMINATOR, dt=DT),
    "scipy dlti without interval": scipy.signal.dlti([0.3, 0.1], DENOMINATOR, dt=True),
    "scipy zeros, poles, gain": scipy.signal.dlti([0.3, 0.1], DENOMINATOR, dt=DT).to_zpk(),
}


@pytest.mark.parametrize("model", DISCRETE.values(), ids=DISCRETE.keys())
def test_discrete_models_repeat_the_filter(model, record):
    np.testing.assert_allclose(sysid.simulate(model, record), record.y, atol=1e-12)
    np.testing.assert_allclose(sysid.predict(model, record), record.y, atol=1e-10)
    assert sysid.compare(model, record)[0].simulation[0] > 100.0 - 1e-8
    noisy = IOData(record.u, record.y + 0.1 * np.random.default_rng(2).standard_normal((300, 1)), DT)
    assert sysid.resid(model, noisy).passed


def _continuous_states():
    A, B, C, D = scipy.signal.tf2ss(*CONTINUOUS)
    return ContinuousModel(StateSpace(A, B, C, D, None, 0.5), np.zeros((1, 1)))


CONTINUOUS_FORMS = {
    "continuous model": _continuous_states(),
    "control transfer function": control.tf(*CONTINUOUS),
    "control state space": control.ss(control.tf(*CONTINUOUS)),
    "scipy lti": scipy.signal.lti(*CONTINUOUS),
}


@pytest.mark.parametrize("model", CONTINUOUS_FORMS.values(), ids=CONTINUOUS_FORMS.keys())
def test_continuous_models_are_sampled_for_a_held_input(model):
    # SciPy's own discretisation is the reference
    u = np.sign(np.random.default_rng(1).standard_normal(300))
    y = _sampled_response(*CONTINUOUS, u)
    record = IOData(u, y, DT)
    np.testing.assert_allclose(sysid.simulate(model, record)[:, 0], y, atol=1e-11)
    assert sysid.compare({"plant": model}, record)[0].simulation[0] > 100.0 - 1e-8


def _sampled_response(numerator, denominator, u):
    discrete, poles, _ = scipy.signal.cont2discrete((numerator, denominator), DT)
    return scipy.signal.lfilter(discrete.ravel(), poles, u)


def test_linear_inputs_are_sampled_as_such():
    time = np.arange(300) * DT
    u = np.interp(time, np.arange(31), np.random.default_rng(1).standard_normal(31))
    _, y, _ = scipy.signal.lsim(scipy.signal.lti(*CONTINUOUS), u, time)
    record = IOData(u, y, DT, intersample="foh")
    fit = sysid.compare(scipy.signal.lti(*CONTINUOUS), record)[0]
    assert fit.simulation[0] > 100.0 - 1e-8


def test_matrices_of_transfer_functions_without_slycot():
    paths = [[([2.0], [1.0, 1.0]), ([1.0], [1.0])], [([0.0], [1.0]), ([3.0], [1.0, 0.4, 2.0])]]
    numerators = [[path[0] for path in row] for row in paths]
    denominators = [[path[1] for path in row] for row in paths]
    u = np.sign(np.random.default_rng(1).standard_normal((200, 2)))
    y = np.zeros((200, 2))
    y[:, 1] = _sampled_response(*paths[1][1], u[:, 1])
    y[:, 0] = _sampled_response(*paths[0][0], u[:, 0]) + u[:, 1]
    model = control.tf(numerators, denominators)
    np.testing.assert_allclose(sysid.simulate(model, IOData(u, y, DT)), y, atol=1e-11)


def test_channels_of_named_systems_are_matched_by_name(record):
    u = np.column_stack((record.u[:, 0], np.random.default_rng(3).standard_normal(300)))
    data = IOData(u, record.y, DT, input_names=("valve", "load"), output_names=("angle",))
    states = control.ss(control.tf([0.3, 0.1], DENOMINATOR, DT))
    B = np.hstack((np.zeros((2, 1)), states.B))
    swapped = control.ss(states.A, B, states.C, np.zeros((1, 2)), DT, inputs=["load", "valve"], outputs=["angle"])
    np.testing.assert_allclose(sysid.simulate(swapped, data), record.y, atol=1e-12)


def test_bare_inputs():
    u = np.random.default_rng(1).standard_normal(50)
    expected = scipy.signal.lfilter(NUMERATOR, DENOMINATOR, u)
    for name in ("polynomials", "control transfer function", "scipy dlti"):
        np.testing.assert_allclose(sysid.simulate(DISCRETE[name], u)[:, 0], expected, atol=1e-12)
    with pytest.raises(SysidError, match=r"continuous-time system has no sampling interval: c2d\(system, dt\)"):
        sysid.simulate(CONTINUOUS_FORMS["scipy lti"], u)


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (control.tf([1.0], DENOMINATOR, 0.2), "sampled every 0.1 s, the model every 0.2 s"),
        (scipy.signal.dlti([1.0], DENOMINATOR, dt=0.2), "sampled every 0.1 s, the model every 0.2 s"),
        (control.ss(np.eye(1), np.ones((1, 2)), np.ones((1, 1)), np.zeros((1, 2)), DT), r"the model 2 \(u1, u2\)"),
        (Polynomials(B=[[0.0, 1.0], [0.0, 1.0]]), r"the model 2 \(u1, u2\)"),
        (scipy.signal.lti([1.0, 0.0, 0.0], [1.0, 1.0]), "no state space"),
        (control.tf([1.0, 0.0, 0.0], [1.0, 1.0]), "no state space"),
        (control.ss(np.eye(1), [[1.0]], [[1.0]], 0.0, None), "neither continuous nor discrete"),
        (control.frd([1.0, 2.0], [1.0, 2.0]), "expected a StateSpace or an Estimate, got .*; or Polynomials"),
        ([[1.0]], "expected a StateSpace or an Estimate, got .*; or Polynomials"),
        ("oe", "expected a StateSpace or an Estimate, got .*; or Polynomials"),
    ],
)
def test_models_that_do_not_fit(model, message, record):
    for call in (sysid.simulate, sysid.predict, sysid.resid):
        with pytest.raises(SysidError, match=message):
            call(model, record)
    with pytest.raises(SysidError, match=message):
        sysid.compare({"model": model}, record)


def test_bode_draws_every_form():
    curves = {**DISCRETE, "continuous": CONTINUOUS_FORMS["continuous model"]}
    del curves["polynomials"], curves["control without interval"], curves["scipy dlti without interval"]
    assert len(bode(curves).axes[0].get_lines()) == len(curves)
    with pytest.raises(SysidError, match="c2d"):
        bode(CONTINUOUS_FORMS["scipy lti"])
    with pytest.raises(SysidError, match="innovations_form"):
        bode(DISCRETE["polynomials"])
