"""The thesis' iterations as an algorithm."""

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from scenarios.thesis import order_search
from scenarios.thesis.order_search import DELAYS, ORDERS, MorePoles, more_poles, search, search_orders
from sysid import IOData, SysidError

THESIS = {
    "shoulder_yaw": {"armax": [5, 3, 3, 2], "oe": [2, 2, 2]},
    "shoulder_pitch": {"armax": [2, 2, 2, 1], "oe": [2, 2, 1]},
    "elbow_pitch": {"armax": [2, 2, 2, 2], "oe": [2, 2, 2]},
}


def record(seed, *, coloured, samples=3000):
    """Two poles, one zero, a delay of two; noise that is white at the output, or the ARMAX kind's own."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], samples // 2), 2)
    a, b = [1.0, -1.5, 0.62], [0.0, 0.0, 0.1, 0.05]
    e = 0.02 * rng.standard_normal(samples)
    noise = lfilter([1.0, -0.6, 0.2], a, e) if coloured else e
    return IOData(u, lfilter(b, a, u) + noise, 0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "coloured"), [("armax", True), ("oe", False)])
def test_the_true_orders_are_found_from_below(method, coloured):
    others = [record(seed, coloured=coloured, samples=1500) for seed in (5, 6, 7)]
    chosen = search(method, record(1, coloured=coloured), others, (9, 9, 9))
    assert chosen.chosen.passes
    assert (chosen.chosen.poles, chosen.chosen.zeros, chosen.chosen.delay) == (2, 1, 2)
    assert chosen.chosen.whiteness_p > 0.01
    assert chosen.chosen.independence_p > 0.01
    assert not any(entry.passes for entry in chosen.iterations if entry.poles == 1)
    assert max(entry.poles for entry in chosen.iterations) == 3, "one step more shows that it gains nothing"
    assert chosen.own is None


@pytest.mark.slow
def test_coloured_residuals_are_accepted_of_output_error_alone():
    others = [record(seed, coloured=True, samples=1500) for seed in (5, 6)]
    chosen = search("oe", record(1, coloured=True), others, (2, 2, 2))
    assert chosen.chosen.passes
    assert chosen.chosen.whiteness_p < 0.01
    assert chosen.own.orders == (2, 2, 2)


@pytest.mark.slow
def test_where_nothing_passes_the_simplest_near_the_best_is_chosen(monkeypatch):
    steps = (1, 2, 3)
    monkeypatch.setattr(order_search, "POLES", steps)

    def echoing(seed):
        data = record(seed, coloured=False, samples=2000)
        return IOData(data.u, data.y + 0.3 * np.roll(data.u, 17, axis=0), 0.02)[20:]

    chosen = search("armax", echoing(1), [echoing(seed) for seed in (5, 6)], (2, 2, 2, 2))
    assert not chosen.chosen.passes
    assert {entry.poles for entry in chosen.iterations} == set(steps)
    assert {entry.delay for entry in chosen.iterations} == set(DELAYS)
    top = max(entry.held_out for entry in chosen.iterations)
    assert top - 0.1 <= chosen.chosen.held_out <= top


def test_nothing_to_judge_on_is_refused():
    with pytest.raises(SysidError, match="other data sets"):
        search_orders("elbow_pitch", {5: record(1, coloured=False)})


def test_a_search_knows_of_the_thesis_choice(study):
    assert set(study.searches) == set(study.joints)
    for joint, searched in study.searches.items():
        for entry in (searched.armax, searched.oe):
            assert list(entry.thesis) == THESIS[joint][entry.method]
            if entry.own is not None:
                # C of an iteration has as many coefficients as A.
                assert (*entry.own.orders[:2], entry.own.delay) == (*entry.thesis[:2], entry.thesis[-1])
        assert np.isfinite(searched.arx.validation).all()
        assert searched.arx.best("aic")


def test_the_test_of_the_same_sequence_judges_nothing(monkeypatch):
    data = {number: record(number, coloured=False, samples=200) for number in range(1, 9)}
    judges = []
    monkeypatch.setattr(sysid, "selstruc", lambda *_, validation: judges.append(validation))
    monkeypatch.setattr(order_search, "search", lambda _, __, others, *___: judges.append(others))
    order_search.search_orders("elbow_pitch", data)
    assert len(judges) == 3
    for others in judges:
        assert [float(one.y[0, 0]) for one in others] == [float(data[n].y[0, 0]) for n in (1, 2, 3, 4, 7, 8)]


@pytest.mark.slow
def test_a_record_that_two_poles_explain_leaves_them_stable():
    rng = np.random.default_rng(3)
    u = np.repeat(rng.choice([-1.0, 1.0], 1000), 2)
    y = lfilter([0.0, 0.0, 0.1, 0.05], [1.0, -1.5, 0.62], u) + 0.01 * rng.standard_normal(2000)
    models = more_poles(IOData(u, y, 0.02), 2)
    assert [entry.orders for entry in models] == [(nb, nf, 2) for nb, nf in ORDERS]
    own = models[0]
    assert not own.unstable
    assert own.settled
    assert abs(own.radius - np.sqrt(0.62)) < 0.02
    assert abs(own.free_radius - np.sqrt(0.62)) < 0.02


@pytest.mark.thorough
def test_least_squares_may_leave_the_unit_circle(monkeypatch):
    """The output runs away beside the input: the one pole that explains it lies outside."""
    monkeypatch.setattr(order_search, "ORDERS", (ORDERS[0], ORDERS[-1]))
    rng = np.random.default_rng(4)
    u = rng.standard_normal(400)
    y = lfilter([0.0, 0.0, 1.0], [1.0, -1.01], u)
    models = more_poles(IOData(u, y, 0.02), 2)
    assert len(models) == 2
    assert all(entry.free_radius > 1.0 for entry in models)
    assert all(entry.unstable for entry in models)
    assert all(entry.radius < 1.0 for entry in models), "the estimator keeps every model stable"


def test_the_edge_counts_as_unstable():
    assert MorePoles((2, 3, 2), 0.99995, 0.99, 4, True).unstable
    assert MorePoles((2, 3, 2), 0.99, 1.0001, 2, False).unstable
    assert not MorePoles((2, 3, 2), 0.99, 0.999, 4, True).unstable
