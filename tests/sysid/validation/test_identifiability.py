"""What an estimate says of its own conditioning."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, armax, arx, identifiability, oe, okid
from tests.sysid.refusals import refused


def test_the_right_orders_leave_nothing_to_say(p3: Any) -> None:
    found = identifiability(armax(p3.draw(0), 2, 2, 2))
    assert found.texts == ()
    assert found.condition < 100
    assert len(found.relative_deviation) == 6


def test_a_superfluous_pole_and_zero_are_found() -> None:
    hits = 0
    for seed in range(20):
        u, e = np.random.default_rng(seed).standard_normal((2, 1500))
        data = IOData(u, lfilter([0, 1, 0.5], [1, -1.5, 0.7], u) + 0.5 * e, 0.1)
        found = identifiability(oe(data, 3, 3))
        hits += any("cannot be distinguished" in text for text in found.texts)
        assert not identifiability(oe(data, 2, 2)).cancellations
    assert hits >= 17


def test_jointly_known_parameters_are_named(p1: Any) -> None:
    found = identifiability(armax(p1.draw(0)[:2000], 5, 3, 5, 2))
    assert found.condition > 1000
    assert np.linalg.norm(found.weakest) == pytest.approx(1.0)
    assert any("smaller than their standard deviation" in text for text in found.texts)


def test_condition_by_hand() -> None:
    u, e = np.random.default_rng(0).standard_normal((2, 400))
    fit = arx(IOData(u, lfilter([0, 1.0], [1, -0.5], u) + e, 0.1), 1, 1)
    correlation = fit.covariance[0, 1] / np.sqrt(fit.covariance[0, 0] * fit.covariance[1, 1])
    expected = np.sqrt((1 + abs(correlation)) / (1 - abs(correlation)))
    assert identifiability(fit).condition == pytest.approx(expected)


def test_state_space_estimates_have_no_polynomials() -> None:
    u, e = np.random.default_rng(0).standard_normal((2, 400))
    data = IOData(u, lfilter([0, 1.0], [1, -0.5], u) + e, 0.1)
    assert identifiability(okid(data, 1, p=3)).cancellations == ()


def test_no_covariance_no_judgement() -> None:

    u, e = np.random.default_rng(0).standard_normal((2, 400))
    fit = arx(IOData(u, lfilter([0, 1.0], [1, -0.5], u) + e, 0.1), 1, 1)
    refused("arx gives no covariance", lambda: identifiability(replace(fit, covariance=np.full((2, 2), np.nan))))
