"""Fits, always in simulation and one step ahead."""

from typing import Any

import numpy as np
import pytest

from sysid import IOData, SysidError, armax, compare, fit_percent, oe, predict


def test_fit_by_hand() -> None:
    y = np.array([[1.0], [2.0], [3.0]])
    np.testing.assert_allclose(fit_percent(y, y), [100.0])
    np.testing.assert_allclose(fit_percent(y, np.full((3, 1), 2.0)), [0.0], atol=1e-12)
    np.testing.assert_allclose(fit_percent(y, np.array([[1.0], [2.0], [4.0]])), [100 * (1 - 1 / np.sqrt(2))])
    with pytest.raises(SysidError, match="one shape"):
        fit_percent(y, y[:2])
    with pytest.raises(SysidError, match="output 0 is constant"):
        fit_percent(np.ones((3, 1)), y)
    np.testing.assert_array_equal(fit_percent(y, np.full((3, 1), np.inf)), [-np.inf])


def test_both_fits_for_every_model(p3: Any) -> None:
    data, fresh = p3.draw(0), p3.draw(1)
    a, o = armax(data, 2, 2, 2), oe(data, 2, 2)
    fits = compare({"armax": a, "oe": o, "truth": p3.model}, fresh)
    assert [f.name for f in fits] == ["armax", "oe", "truth"]
    for f in fits:
        np.testing.assert_allclose(f.one_step, fit_percent(fresh.y, f.predicted))
        np.testing.assert_allclose(f.simulation, fit_percent(fresh.y, f.simulated))
    by_name = {f.name: f for f in fits}
    # K = 0: its prediction is a simulation
    np.testing.assert_array_equal(by_name["oe"].simulation, by_name["oe"].one_step)
    assert by_name["armax"].one_step[0] > by_name["armax"].simulation[0] + 5
    assert by_name["armax"].one_step[0] == pytest.approx(by_name["truth"].one_step[0], abs=0.5)
    assert [f.name for f in compare([a, p3.model], fresh)] == ["1: armax", "2: model"]
    assert compare(a, fresh)[0].simulation == by_name["armax"].simulation


def test_the_window_is_not_scored(p3: Any) -> None:
    data = p3.draw(0)
    spoilt = data.y.copy()
    spoilt[:200] += 1e3 * np.random.default_rng(0).standard_normal((200, 1))
    whole = IOData(data.u, spoilt, data.dt, window=0)
    window = IOData(data.u, spoilt, data.dt, window=200)
    (scored,) = compare(p3.model, window)
    expected = predict(p3.model, window, steps=None)[200:]
    np.testing.assert_allclose(scored.simulation, fit_percent(data.y[200:], expected))
    assert scored.simulation[0] > compare(p3.model, whole)[0].simulation[0] + 20


def test_no_model() -> None:
    with pytest.raises(SysidError, match="at least one model"):
        compare([], IOData([1.0, 2.0], [1.0, 2.0], 0.1))
