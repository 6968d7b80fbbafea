import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import norm

import sysid
from sysid import IOData
from sysid.polynomial.outliers import outlier_limit, outlier_messages


@pytest.fixture
def rng():
    return np.random.default_rng(1)


FITS = {
    "arx": lambda data: sysid.arx(data, 1, 1),
    "oe": lambda data: sysid.oe(data, 1, 1),
    "armax": lambda data: sysid.armax(data, 1, 1, 1),
    "bj": lambda data: sysid.bj(data, 1, 1, 1, 1),
    "polyest": lambda data: sysid.polyest(data, 1, 1, 1, 0, 0),
    "tfest": lambda data: sysid.tfest(data, 1, 0),
}


def record(rng, samples=1000, colour=0.0):
    u = rng.standard_normal(samples)
    e = lfilter([1.0], [1.0, -colour], rng.standard_normal(samples))
    return IOData(u, lfilter([0.0, 1.0], [1.0, -0.75], u) + 0.3 * e, dt=0.1)


def with_jumps(data, rng, samples):
    y = data.y.copy()
    y[samples, 0] += 3.0 * rng.choice([-1.0, 1.0], len(samples))
    return IOData(data.u, y, dt=data.dt)


def outlier_texts(fit, data):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model = fit(data)
    texts = [str(warning.message) for warning in caught if "outliers" in str(warning.message)]
    assert [text for text in model.diagnostics["warnings"] if "outliers" in text] == texts
    return texts


@pytest.mark.parametrize("name", FITS)
def test_estimators_name_the_samples_of_outliers(name, rng):
    data = with_jumps(record(rng), rng, [123, 700])
    (text,) = outlier_texts(FITS[name], data)
    assert "12.3 s (sample 123," in text
    assert "70 s (sample 700," in text
    assert not outlier_texts(FITS[name], record(rng))


def test_the_experiment_is_named_and_its_window_does_not_count(rng):
    first = replace(with_jumps(record(rng), rng, [5]), window=20, name="rest")
    second = replace(with_jumps(record(rng), rng, [400]), name="move")
    (text,) = outlier_texts(FITS["oe"], [first, second])
    assert "40 s (sample 400 of experiment move," in text
    assert "sample 5 " not in text


def test_missing_outputs_are_no_outliers(rng):
    data = with_jumps(record(rng, colour=0.9), rng, [500])
    y = data.y.copy()
    y[300:400] = np.nan
    (text,) = outlier_texts(FITS["oe"], IOData(data.u, y, dt=0.1, missing=True))
    assert "50 s (sample 500," in text


@pytest.mark.parametrize(("samples", "colour"), [(60, 0.0), (200, 0.0), (200, 0.9), (2000, 0.0), (2000, 0.9)])
def test_normal_errors_raise_at_most_one_alarm_in_a_hundred(samples, colour, rng):
    alarms, records = 0, 500
    for _ in range(records):
        errors = lfilter([1.0], [1.0, -colour], rng.standard_normal(samples))
        alarms += len(outlier_messages([errors], [IOData(np.arange(float(samples)), errors, dt=0.1)]))
    # a rate of 1 % gives more than 12 of 500 once in 400 times
    assert alarms <= 12


def test_the_limit_is_the_quantile_of_the_largest_of_many_normal_values():
    # of n = 10^8 values the scale is exact: P(max |x| < limit) = 0.995
    assert norm.cdf(-outlier_limit(10**8)) * 2 * 10**8 == pytest.approx(0.005, rel=0.02)


def test_one_percent_of_outliers_is_said(rng):
    data = with_jumps(record(rng), rng, rng.choice(1000, 10, replace=False))
    (text,) = outlier_texts(FITS["oe"], data)
    assert text.startswith(("9 of", "10 of", "11 of"))
    assert text.count("(sample") == 5


def test_few_or_exact_errors_have_no_outliers(rng):
    assert not outlier_texts(FITS["oe"], with_jumps(record(rng, 25), rng, [12]))
    u = rng.standard_normal(400)
    assert not outlier_texts(FITS["oe"], IOData(u, lfilter([0.0, 1.0], [1.0, -0.75], u), dt=0.1))
