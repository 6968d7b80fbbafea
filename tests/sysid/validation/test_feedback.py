import sys

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, armax, delayest, feedback, oe, resid
from sysid.validation.feedback import addition_p, interchanged
from tests.refusals import refused


def loop(seed, gain, samples=600):
    """y(t) = 0.7 y(t-1) + u(t-1) + e(t) + 0.3 e(t-1), u(t) = r(t) - gain y(t-1), r of first order."""
    r, e = np.random.default_rng(seed).standard_normal((2, samples))
    r, y, u = lfilter([1.0], [1, -0.8], r), np.zeros(samples), np.zeros(samples)
    for t in range(1, samples):
        y[t] = 0.7 * y[t - 1] + u[t - 1] + e[t] + 0.3 * e[t - 1]
        u[t] = r[t] - gain * y[t - 1]
    return IOData(u, y, 0.1)


@pytest.mark.slow
def test_an_open_loop_is_rejected_at_the_nominal_rate():
    p = [feedback(loop(seed, 0.0), lags=8).p_values[0, 0] for seed in range(300)]
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.035)
    assert np.mean(p) == pytest.approx(0.5, abs=0.06)


def test_a_loop_is_seen_in_data_and_residuals_and_by_delayest():
    data = loop(0, 0.4, 2000)
    test, model = feedback(data), armax(data, 1, 1, 1)
    assert test.feedback.all()
    assert "from y1 to u1: feedback" in str(test)
    checked = resid(model, data)
    assert checked.feedback.all()
    assert checked.passed
    assert "y1 to u1: feedback" in str(checked)
    with pytest.warns(match="depends on past values of output y1"):
        delayest(data)
    assert not feedback(loop(1, 0.0, 2000)).feedback.any()
    with pytest.warns(match="are input and output interchanged?"):
        delayest(interchanged([loop(1, 0.0, 2000)]))


def test_long_records_are_tested_in_blocks(monkeypatch):
    columns, e = np.split(np.random.default_rng(0).standard_normal((700, 9)), [8], axis=1)
    y = 0.2 * columns[:, 0] + columns[:, 5] + e[:, 0]
    whole = addition_p(columns, 5, y)
    monkeypatch.setattr(sys.modules[addition_p.__module__], "BLOCK", 100)
    assert addition_p(columns, 5, y) == pytest.approx(whole, rel=1e-9)
    assert 1e-6 < whole < 0.2


def test_what_cannot_be_told_is_not_claimed():
    u = np.sin(0.5 * np.arange(400))
    assert np.isnan(feedback(IOData(u, loop(0, 0.0, 400).y, 0.1)).p_values).all()
    refused("too little data", lambda: feedback(loop(0, 0.0)[:60]))


@pytest.mark.slow
def test_residuals_with_gaps_keep_the_size_of_the_tests():
    white, independent = [], []
    for seed in range(120):
        data = loop(seed, 0.0, 500)
        y = np.where(np.random.default_rng(seed).random((500, 1)) < 0.2, np.nan, data.y)
        test = resid(MODEL, IOData(data.u, y, 0.1, missing=True), level=0.9, lags=10)
        white.append(test.white[0])
        independent.append(test.independent[0, 0])
    assert np.mean(white) == pytest.approx(0.9, abs=0.07)
    assert np.mean(independent) == pytest.approx(0.9, abs=0.07)


MODEL = armax(loop(1000, 0.0, 50_000), 1, 1, 1).model


def distorted(seed, wire):
    """A binary sequence, played over and over into a cubic nonlinearity behind a lag, its input measured with noise."""
    rng = np.random.default_rng(seed)
    u = np.tile(np.repeat(rng.choice([-1.0, 1.0], 50), 2), 12) + wire * rng.standard_normal(1200)
    x = lfilter([0, 0.1], [1, -0.9], u)
    return IOData(u, x + 0.3 * x**3 + lfilter([1], [1, -0.8], 0.02 * rng.standard_normal(1200)), 0.02)


def fed_back(seed):
    """The same sequence as the reference of a proportional controller, which feeds the disturbance back at once."""
    rng = np.random.default_rng(seed)
    reference = np.tile(np.repeat(rng.choice([-1.0, 1.0], 50), 2), 12)
    disturbance = lfilter([1], [1, -0.8], 0.1 * rng.standard_normal(1200))
    u, y, x = np.zeros(1200), np.zeros(1200), 0.0
    for t in range(1200):
        y[t] = x + disturbance[t]
        u[t] = reference[t] - y[t]
        x = 0.9 * x + 0.1 * u[t]
    return IOData(u, y, 0.02)


def test_the_answer_of_a_nonlinear_system_to_a_repeating_input_is_no_feedback():
    seen, left = [], []
    for seed in range(60):
        data = distorted(seed, 0.05)
        seen.append(feedback(data).p_values.item() < 0.01)
        left.append(resid(oe(data, 1, 1, 1), data).feedback.item())
    # at 1 %, three standard deviations above
    assert np.mean(seen) < 0.05 and np.mean(left) < 0.05
    # an input that repeats exactly cannot follow a disturbance, so that nothing is tested
    exact = distorted(0, 0.0)
    assert np.isnan(feedback(exact).p_values).all()
    assert np.isnan(resid(oe(exact, 1, 1, 1), exact).feedback_p).all()


def test_feedback_shows_although_the_reference_of_the_loop_repeats():
    seen, left = [], []
    for seed in range(40):
        data = fed_back(seed)
        seen.append(feedback(data).feedback.item())
        left.append(resid(oe(data, 1, 1, 1), data).feedback.item())
    assert np.mean(seen) > 0.75 and np.mean(left) > 0.95


def test_long_records_that_repeat_are_tested_as_short_ones(monkeypatch):
    data = distorted(3, 0.05)
    short = feedback(data).p_values.item()
    monkeypatch.setattr(sys.modules["sysid.validation.feedback"], "BLOCK", 200)
    assert feedback(data).p_values.item() == pytest.approx(short, rel=1e-6)
