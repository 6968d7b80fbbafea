"""`fixed=` of `procest` and `tfest`: parameters that are known."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import cont2discrete, lfilter

import sysid
from sysid import IOData, SysidError

DT = 0.1
GAIN, SLOW, FAST, DELAY = 2.0, 3.0, 0.8, 0.5


def response(u, gain, slow, fast, delay_in_samples=0):
    b, a, _ = cont2discrete(([gain], np.convolve([slow, 1.0], [fast, 1.0])), DT, method="zoh")
    delayed = np.concatenate((np.zeros(delay_in_samples), u))[: len(u)]
    return lfilter(b[0], a, delayed)


@pytest.fixture(scope="module")
def record():
    rng = np.random.default_rng(3)
    u = np.repeat(np.sign(rng.standard_normal(40)), 20)
    y = response(u, GAIN, SLOW, FAST, 5) + 0.05 * rng.standard_normal(len(u))
    return IOData(u, y, dt=DT)


def values(fit):
    return dict(zip(fit.parameter_names, fit.parameters, strict=True))


@pytest.mark.parametrize(
    ("fixed", "free"),
    [
        ({"Kp": GAIN}, 3),
        ({"Tp1": SLOW}, 3),
        ({"Td": DELAY}, 3),
        ({"Kp": GAIN, "Td": DELAY, "Tp1": SLOW}, 1),
    ],
)
def test_known_parameters_of_a_process_model_stay_and_the_others_are_true(record, fixed, free):
    fit = sysid.procest(record, "P2D", fixed=fixed)
    truth = {"Kp": GAIN, "Tp1": SLOW, "Tp2": FAST, "Td": DELAY}
    deviations = np.sqrt(np.diag(fit.covariance))
    for name, value, deviation in zip(fit.parameter_names, fit.parameters, deviations, strict=True):
        if name in fixed:
            assert value == fixed[name]
            assert deviation == 0.0
        else:
            assert 0.0 < abs(value - truth[name]) < 4.0 * deviation
    assert fit.bic == pytest.approx(np.log(fit.loss) + free * np.log(len(record)) / len(record))


def test_process_model_with_a_known_gain_is_the_minimum_over_the_others(record):
    known = {"Kp": 1.98, "Td": DELAY}
    fit = sysid.procest(record, "P2D", fixed=known, initial_conditions="zero", coloured=False)
    u, y = record.u[:, 0], record.y[:, 0]

    def errors(lags):
        return y - response(u, 1.98, *lags, 5)

    expected = least_squares(errors, [3.4, 1.0], xtol=1e-14, ftol=1e-14, gtol=1e-14)
    np.testing.assert_allclose(fit.parameters, [1.98, *sorted(expected.x, reverse=True), DELAY], rtol=1e-6)
    information = expected.jac.T @ expected.jac / (2.0 * expected.cost / (len(y) - 2))
    np.testing.assert_allclose(fit.covariance[1:3, 1:3], np.linalg.inv(information), rtol=1e-3)


def test_the_second_time_constant_may_be_the_known_slow_one(record, recwarn):
    slow_first = sysid.procest(record, "P2D", fixed={"Tp1": SLOW})
    slow_second = sysid.procest(record, "P2D", fixed={"Tp2": SLOW})
    assert slow_second.parameters[2] == SLOW
    assert slow_second.parameters[1] == pytest.approx(slow_first.parameters[2], rel=1e-6)
    assert not recwarn.list


def test_transfer_function_with_known_coefficients(record):
    a1, a0 = (SLOW + FAST) / (SLOW * FAST), 1.0 / (SLOW * FAST)
    fit = sysid.tfest(record, 2, 0, delay=DELAY, fixed={"a1": a1, "a0": a0})
    assert values(fit) | {"b0": 0.0} == {"b0": 0.0, "a1": a1, "a0": a0}
    assert values(fit)["b0"] == pytest.approx(GAIN * a0, rel=0.01)
    deviations = np.sqrt(np.diag(fit.covariance))
    assert deviations[0] > 0.0
    assert (deviations[1:] == 0.0).all()


def test_two_inputs_and_outputs_have_known_parameters_by_path():
    rng = np.random.default_rng(8)
    u = np.repeat(rng.standard_normal((80, 2)), 10, axis=0)
    first = response(u[:, 0], 1.0, 2.0, 0.5) + response(u[:, 1], -2.0, 1.0, 0.3)
    second = response(u[:, 1], 3.0, 1.5, 0.4)
    y = np.column_stack((first, second)) + 0.02 * rng.standard_normal((800, 2))
    kinds = [["P2", "P2"], ["P0", "P2"]]
    fit = sysid.procest(IOData(u, y, dt=DT), kinds, fixed={"Kp[1,2]": -2.0, "Tp1[2,2]": 1.5})
    assert values(fit)["Kp[1,2]"] == -2.0
    assert values(fit)["Tp1[2,2]"] == 1.5
    assert values(fit)["Tp1[1,1]"] == pytest.approx(2.0, rel=0.05)
    assert values(fit)["Kp[2,2]"] == pytest.approx(3.0, rel=0.02)


@pytest.mark.parametrize(
    ("fixed", "message"),
    [
        ({"Kq": 2.0}, "expected parameters among Kp, Tp1, Tp2, Td, got 'Kq'"),
        ({"Tp1": -3.0}, "Tp1: expected a value > 0"),
        ({"Tp2": np.nan}, "Tp2 must be a finite number"),
        ({"Kp": "2"}, "Kp must be a finite number, got '2'"),
        ({"Td": 1e5}, "delay must lie between 0 and half the shortest record"),
        ({"Td": -0.1}, "Td: expected a delay >= 0"),
        ({"Kp": 0}, "Kp: expected a gain other than 0"),
        ({"Kp": 2.0, "Tp1": 3.0, "Tp2": 0.8, "Td": 0.5}, "holds every parameter"),
        (["Kp"], "expected values by parameter"),
    ],
)
def test_what_no_process_model_can_have_is_refused(record, fixed, message):
    with pytest.raises(SysidError, match=message):
        sysid.procest(record, "P2D", fixed=fixed)


def test_what_no_transfer_function_can_have_is_refused(record):
    with pytest.raises(SysidError, match=r"a known delay as delay=0\.5"):
        sysid.tfest(record, 2, 0, delay=None, fixed={"Td": 0.5})
    with pytest.raises(SysidError, match="every stable denominator has, got -1"):
        sysid.tfest(record, 2, 0, fixed={"a0": -1.0})
    response_of_record = sysid.spafdr(record)
    with pytest.raises(SysidError, match="start and fixed"):
        sysid.tfest(response_of_record, 2, 0, fixed={"a0": 1.0})
