import warnings
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from sysid import IOData, SysidWarning, armax, compare, oe, predict, resid
from sysid.validation import fit_percent
from tests.refusals import refused
from tests.sysid.systems import losing


def test_fit_by_hand():
    y = np.array([[1.0], [2.0], [3.0]])
    np.testing.assert_allclose(fit_percent(y, y), [100.0])
    np.testing.assert_allclose(fit_percent(y, np.full((3, 1), 2.0)), [0.0], atol=1e-12)
    np.testing.assert_allclose(fit_percent(y, np.array([[1.0], [2.0], [4.0]])), [100 * (1 - 1 / np.sqrt(2))])
    refused("one shape", lambda: fit_percent(y, y[:2]))
    refused("output 0 is constant", lambda: fit_percent(np.ones((3, 1)), y))
    np.testing.assert_array_equal(fit_percent(y, np.full((3, 1), np.inf)), [-np.inf])
    assert fit_percent([1, 2, 3], [1, 2, 3]) == 100.0
    refused(".", fit_percent, [1, 2, 3], [1, np.nan, 3])
    refused(".", fit_percent, "ab", [1, 2])
    refused("a StateSpace or an Estimate, got int", compare, 3, IOData([1.0, 2.0], [1.0, 2.0], 0.1))
    refused("at least one model", compare, [], IOData([1.0, 2.0], [1.0, 2.0], 0.1))


def test_both_fits_for_every_model(p3):
    data, fresh = p3.draw(0), p3.draw(1)
    a, o = armax(data, 2, 2, 2), oe(data, 2, 2)
    fits = compare({"armax": a, "oe": o, "truth": p3.truth}, fresh)
    assert [f.name for f in fits] == ["armax", "oe", "truth"]
    for f in fits:
        np.testing.assert_allclose(f.one_step, fit_percent(fresh.y, f.predicted))
        np.testing.assert_allclose(f.simulation, fit_percent(fresh.y, f.simulated))
    by_name = {f.name: f for f in fits}
    # K = 0: its prediction is a simulation
    np.testing.assert_array_equal(by_name["oe"].simulation, by_name["oe"].one_step)
    assert by_name["armax"].one_step[0] > by_name["armax"].simulation[0] + 5
    assert by_name["armax"].one_step[0] == pytest.approx(by_name["truth"].one_step[0], abs=0.5)
    assert [f.name for f in compare([a, p3.truth], fresh)] == ["1: armax", "2: model"]
    assert compare(a, fresh)[0].simulation == by_name["armax"].simulation


def test_the_window_is_not_scored(p3):
    data = p3.draw(0)
    spoilt = data.y.copy()
    spoilt[:200] += 1e3 * np.random.default_rng(0).standard_normal((200, 1))
    whole = IOData(data.u, spoilt, data.dt, window=0)
    window = IOData(data.u, spoilt, data.dt, window=200)
    (scored,) = compare(p3.truth, window)
    expected = predict(p3.truth, window, steps=None)[200:]
    np.testing.assert_allclose(scored.simulation, fit_percent(data.y[200:], expected))
    assert scored.simulation[0] > compare(p3.truth, whole)[0].simulation[0] + 20


def test_any_horizon_lies_between_one_step_and_simulation(p3):
    data = p3.draw(0)
    (near,), (far,) = (compare(p3.truth, data, steps=steps) for steps in (1, 5))
    np.testing.assert_array_equal(near.ahead, near.one_step)
    np.testing.assert_array_equal(far.predicted_ahead, predict(p3.truth, data, steps=5))
    np.testing.assert_allclose(far.ahead, fit_percent(data.y, far.predicted_ahead))
    assert far.simulation[0] < far.ahead[0] < far.one_step[0]
    assert str(far).endswith(f"{far.ahead[0]:.2f} % 5 steps ahead")
    assert "steps ahead" not in str(near)
    for wrong in (0, None, 2.5, True):
        refused("steps", partial(compare, steps=wrong), p3.truth, data)


def test_several_experiments_are_scored_together_and_apart(p3):
    first, second = p3.draw(0)[:300], p3.draw(1)[:500]
    second = IOData(second.u, second.y + 7.0, second.dt, window=50, name="later")
    (fit,) = compare(p3.truth, [first, second], steps=3)
    alone = [compare({name: p3.truth}, one, steps=3)[0] for name, one in (("experiment 1", first), ("later", second))]
    for one, apart in zip(fit.by_experiment, alone, strict=True):
        assert one.name == apart.name
        np.testing.assert_array_equal(one.simulation, apart.simulation)
        np.testing.assert_array_equal(one.ahead, apart.ahead)
    np.testing.assert_array_equal(fit.simulated, np.concatenate([one.simulated for one in alone]))
    errors = [e.y[e.window :] - one.simulated[e.window :] for e, one in zip((first, second), alone, strict=True)]
    deviations = [e.y[e.window :] - e.y[e.window :].mean(axis=0) for e in (first, second)]
    expected = 100 * (1 - np.sqrt(sum(np.sum(e**2) for e in errors) / sum(np.sum(d**2) for d in deviations)))
    assert fit.simulation[0] == pytest.approx(expected)
    assert str(fit).count("\n") == 2
    assert compare(p3.truth, [first])[0].by_experiment == ()


def test_fits_print_as_a_table(p3):
    data = p3.draw(0)
    estimate = oe(data, 2, 2)
    fits = compare({"a": estimate, "b & c": estimate}, [data, data], steps=3)
    head, *rows = str(fits).splitlines()
    assert head.split("  ")[-1] == "3 steps ahead"
    note = "estimated from this record, or from its beginning: no validation"
    assert rows[6:] == [f"a: {note}", f"b & c: {note}"]
    assert [row.split("  ")[0] for row in rows[:6]] == ["a", "", "", "b & c", "", ""]
    assert f"{fits[0].simulation[0]:.2f}" in rows[0]
    assert "b &amp; c" in fits._repr_html_()


def test_a_model_on_the_data_of_its_fit_is_no_validation(p3):
    data, fresh = p3.draw(0), p3.draw(1)
    level = replace(data, u=1e3 * data.u + 7.0, y=data.y + 1e4)
    estimate = oe(data[:1500].detrend(), 2, 2)
    for own in (data[:1500], data, [fresh, data], level):
        with pytest.warns(SysidWarning, match="1: oe: estimated from this record, or from its beginning"):
            (fit,) = compare(estimate, own)
        assert fit.is_training
        assert "no validation" in str(fit)
        assert resid(estimate, own).is_training
        assert "data of the fit" in str(resid(estimate, own))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for other in (
            fresh,
            data[1:],
            data[:1400],
            replace(data, y=np.where(np.arange(len(data)) == 5, 0.0, data.y.T).T),
        ):
            assert not compare(estimate, other)[0].is_training
            assert not resid(estimate, other).is_training
        # of a model alone nobody knows
        assert not compare(estimate.model, data)[0].is_training


def test_an_estimate_knows_the_fit_to_its_own_data(p3):
    data = p3.draw(0)
    for own in (data, [data[:400], data[400:]], losing(data, slice(50, 60))):
        estimate = armax(own, 2, 2, 2)
        np.testing.assert_allclose(estimate.fit_percent, compare(estimate, own)[0].one_step, rtol=1e-9)
    assert f"one step ahead: {estimate.fit_percent[0]:.2f} %" in str(estimate)
