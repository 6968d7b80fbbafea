"""Long records take other ways, in blocks of rows and by stretches, to the same results."""

import sys

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData


def _module(name):
    # the packages have functions of these names
    return sys.modules[f"sysid.{name}"]


@pytest.fixture(name="records")
def _records():
    rng = np.random.default_rng(0)
    u = lfilter([1.0], [1.0, -0.5], rng.standard_normal(3000))
    y = lfilter([0.0, 0.0, 1.0], [1.0, -0.8], u) + rng.standard_normal(3000)
    y[500:510] = np.nan
    whole = IOData(u, y, 0.1, missing=True)
    return whole, [part for part in whole.complete_parts() if len(part) > 100]


def _in_blocks(monkeypatch):
    monkeypatch.setattr(_module("polynomial.regressors"), "BLOCK", 700)
    monkeypatch.setattr(_module("polynomial.arx"), "LARGEST_TABLE", 100)
    monkeypatch.setattr(_module("models.recursion"), "LARGEST_TRAJECTORY", 1000)
    monkeypatch.setattr(_module("frequency.delayest"), "BLOCK", 700)
    monkeypatch.setattr(_module("validation.feedback"), "BLOCK", 700)


@pytest.mark.parametrize("estimate", [lambda d: sysid.impulseest(d, 20), lambda d: sysid.arx(d, 3, 3)])
def test_regressions_in_blocks(records, monkeypatch, estimate):
    at_once = estimate(records[0])
    _in_blocks(monkeypatch)
    in_blocks = estimate(records[0])
    np.testing.assert_allclose(in_blocks.parameters, at_once.parameters, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(in_blocks.covariance, at_once.covariance, rtol=1e-4, atol=1e-8)
    np.testing.assert_allclose(in_blocks.residuals, at_once.residuals, atol=1e-5)


def test_delays_and_feedback_in_blocks(records, monkeypatch):
    delay, p_values = sysid.delayest(records[1]), sysid.feedback(records[1]).p_values
    _in_blocks(monkeypatch)
    in_blocks = sysid.delayest(records[1])
    np.testing.assert_array_equal(in_blocks.arx, delay.arx)
    np.testing.assert_allclose(in_blocks.p_values, delay.p_values, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(sysid.feedback(records[1]).p_values, p_values, rtol=1e-6)


@pytest.mark.slow
def test_stretches_lead_to_the_minimum(monkeypatch):
    rng = np.random.default_rng(1)
    u, e = rng.choice([-1.0, 1.0], 40_000), rng.standard_normal(40_000)
    record = IOData(u, lfilter([0.0, 0.01, 0.005], np.poly([0.99, 0.95]), u) + 0.02 * e, 1.0)
    whole = sysid.armax(record, 2, 2, 2)
    monkeypatch.setattr(_module("polynomial.polynomial_estimate"), "LONG", 30_000)
    by_stretches = sysid.armax(record, 2, 2, 2)
    assert "stretches" in by_stretches.diagnostics["start"]
    assert by_stretches.diagnostics["sum_of_squares"] == pytest.approx(whole.diagnostics["sum_of_squares"], rel=1e-8)


def test_stretches_of_which_some_have_a_constant_input(monkeypatch):
    rng = np.random.default_rng(2)
    u = np.where(np.arange(30_000) < 13_000, 0.0, 1.0)
    record = IOData(u, lfilter([0.0, 0.1], [1.0, -0.9], u) + 0.01 * rng.standard_normal(30_000), 1.0)
    monkeypatch.setattr(_module("polynomial.polynomial_estimate"), "LONG", 20_000)
    estimate = sysid.oe(record, 1, 1)
    np.testing.assert_allclose(estimate.parameters, [0.1, -0.9], atol=0.01)
