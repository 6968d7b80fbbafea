from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, armax, arx, identifiability, oe, okid
from sysid.validation import input_independence
from tests.refusals import refused
from tests.sysid.systems import second_order


def test_the_right_orders_leave_nothing_to_say(p3):
    result = identifiability(armax(p3.draw(0), 2, 2, 2))
    assert result.texts == ()
    assert result.condition < 100
    assert len(result.relative_deviation) == 6


@pytest.mark.slow
def test_a_superfluous_pole_and_zero_are_reported():
    hits = 0
    for seed in range(20):
        data = second_order(seed, 1500, 0.5, d=[1.0])
        result = identifiability(oe(data, 3, 3))
        hits += any("cannot be distinguished" in text for text in result.texts)
        assert not identifiability(oe(data, 2, 2)).cancellations
    assert hits >= 17


def test_jointly_known_parameters_are_named(p1):
    result = identifiability(armax(p1.draw(0)[:2000], 5, 3, 5, 2))
    assert result.condition > 1000
    assert np.linalg.norm(result.weakest) == pytest.approx(1.0)
    assert any("smaller than their standard deviation" in text for text in result.texts)


def test_condition_by_hand():
    u, e = np.random.default_rng(0).standard_normal((2, 400))
    data = IOData(u, lfilter([0, 1.0], [1, -0.5], u) + e, 0.1)
    fit = arx(data, 1, 1)
    correlation = fit.covariance[0, 1] / np.sqrt(fit.covariance[0, 0] * fit.covariance[1, 1])
    expected = np.sqrt((1 + abs(correlation)) / (1 - abs(correlation)))
    assert identifiability(fit).condition == pytest.approx(expected)
    assert identifiability(okid(data, 1, p=3)).cancellations == ()  # a state space has no polynomials
    refused("arx gives no covariance", identifiability, replace(fit, covariance=np.full((2, 2), np.nan)))


def independence(*columns, lags=8):
    return input_independence(np.column_stack(columns), lags=lags)


def test_the_condition_is_that_of_the_correlation_whatever_the_size():
    a, b = np.random.default_rng(0).standard_normal((2, 40_000))
    for rho in (0.0, 0.6, 0.99):
        inputs = independence(a, 50.0 * (rho * a + np.sqrt(1 - rho**2) * b), lags=4)
        # Eigenvalues of the correlation matrix of two signals are 1 +- rho.
        assert inputs.condition == pytest.approx(np.sqrt((1 + rho) / (1 - rho)), rel=0.05)
        assert inputs.covariance_condition == pytest.approx(inputs.condition**2, rel=0.1)


def test_the_colour_of_a_single_input_does_not_count():
    smooth = np.cumsum(np.random.default_rng(1).standard_normal((40_000, 2)), axis=0)
    smooth -= np.apply_along_axis(lambda x: np.convolve(x, np.ones(200) / 200, "same"), 0, smooth)
    inputs = independence(*smooth.T)
    assert inputs.condition < 1.5
    assert inputs.covariance_condition > 100.0
    assert inputs.full and inputs.names == ("u1", "u2")


def test_a_delayed_copy_counts_within_the_lags_and_not_beyond():
    a = np.random.default_rng(2).standard_normal(5000)
    assert independence(a, np.roll(a, 3)).condition > 1e3
    assert independence(a, np.roll(a, 9)).condition < 1.5


def test_a_tone_is_too_poor_for_a_block_diagonal_model_as_well():
    t = np.arange(2000) / 50
    inputs = independence(np.sin(2 * np.pi * t), np.sin(4 * np.pi * t))
    assert (inputs.orders, inputs.full, inputs.block_diagonal) == ((2, 2), False, False)


def test_nothing_is_measured_of_one_input_and_short_records_and_wrong_names_are_refused():
    a = np.random.default_rng(3).standard_normal((200, 2))
    assert input_independence(a[:, :1]) is None
    assert input_independence(a * [1.0, 0.0]) is None
    assert input_independence(a[:20]) is None
    refused(r"got shape \(200, 2\), 1 names", input_independence, a, ["stick"])
