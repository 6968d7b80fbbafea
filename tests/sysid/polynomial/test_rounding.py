import re
import warnings

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, SysidWarning

A, B = np.array([1.0, -1.2, 0.5]), np.array([0.0, 1.0, 0.5])


def record(seed, step, samples=400, deviation=0.4):
    """ARX record whose output is rounded to steps of so many deviations of the errors; 0 leaves it as it is."""
    u, e = np.random.default_rng(seed).standard_normal((2, samples))
    y = lfilter(B, A, u) + lfilter([deviation], A, e)
    return IOData(u, y if step == 0 else step * deviation * np.round(y / (step * deviation)), 1.0)


def messages(estimator, data):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SysidWarning)
        estimator(data)
    return [str(message.message) for message in caught if "rounded" in str(message.message)]


def test_announced_bias_is_the_bias():
    errors, announced = [], []
    for seed in range(150):
        data = record(seed, 1.0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SysidWarning)
            estimate = sysid.arx(data, 2, 2)
        errors.append((estimate.parameters[0] - A[1]) / np.sqrt(estimate.covariance[0, 0]))
        (message,) = (text for text in estimate.diagnostics["warnings"] if "rounded" in text)
        announced.append(float(re.search(r"up to ([\d.]+) standard", message)[1]))
    # the mean of 150 has a standard error of 0.08
    assert np.mean(errors) == pytest.approx(np.mean(announced), abs=0.25)
    assert np.mean(errors) > 0.5


ESTIMATORS = {
    "arx": lambda data: sysid.arx(data, 2, 2),
    "rarx": lambda data: sysid.rarx(data, 2, 2),
    "ar": lambda data: sysid.ar(IOData(None, data.y, 1.0), 2),
}


@pytest.mark.parametrize("name", ESTIMATORS)
def test_warns_of_coarse_steps_alone(name):
    estimator = ESTIMATORS[name]
    assert len(messages(estimator, record(0, 4.0))) == 1
    assert len(messages(estimator, record(0, 4.0).detrend())) == 1
    assert not messages(estimator, record(0, 0))
    assert not messages(estimator, record(0, 0.1))


def test_two_levels_and_missing_outputs():
    data = record(0, 1.0)
    y = data.y.copy()
    y[5:9] = np.nan
    assert messages(ESTIMATORS["arx"], IOData(data.u, y, 1.0, missing=True))
    two_levels = IOData(data.u, np.where(data.y > 0.0, 1.0, -1.0), 1.0)
    # steps cannot be told from a signal that has two values
    assert not messages(ESTIMATORS["arx"], two_levels)


def test_without_past_outputs_rounding_is_no_bias():
    assert not messages(lambda data: sysid.impulseest(data, 20, kernel=None), record(0, 1.0))
    assert not messages(lambda data: sysid.oe(data, 2, 2), record(0, 1.0))
