"""Structures of continuous-time models chosen from records of systems that are known."""

import control
import numpy as np
import pytest

from sysid import IOData, SysidError, procest, tfest
from sysid.selection import choose_procest, choose_tfest
from sysid.selection.continuous_time import liveliest_parts

DT, FINE = 0.05, 10


def simulated(numerator, denominator, delay=0.0, *, seed, samples=1000, noise=0.03):
    """Response to levels that are held, by python-control on a finer grid, with white noise."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], samples // 15 + 1), 15)[:samples]
    late = round(delay / DT * FINE)
    fine = np.concatenate((np.zeros(late), np.repeat(u, FINE)))[: samples * FINE]
    system = control.c2d(control.tf(numerator, denominator), DT / FINE, "zoh")
    y = control.forced_response(system, U=fine).outputs[::FINE]
    return IOData(u, y + noise * y.std() * rng.standard_normal(samples), DT)


SYSTEMS = {
    "P1D": ([2.0], [0.5, 1.0], 0.2, (1, 0, "estimated")),
    "P2DU": ([1.0], [0.04, 0.08, 1.0], 0.15, (2, 0, "estimated")),
    "P2": ([2.0], [0.15, 0.8, 1.0], 0.0, (2, 0, 0)),
    "P3D": ([24.0], [1.0, 9.0, 26.0, 24.0], 0.1, (3, 0, "estimated")),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", SYSTEMS)
def test_the_true_structure_is_chosen(kind):
    numerator, denominator, delay, orders = SYSTEMS[kind]
    data = simulated(numerator, denominator, delay, seed=1)
    by_orders, by_kind = choose_tfest(data), choose_procest(data)
    assert tuple(by_orders.candidates[0].orders.values()) == orders
    assert by_kind.candidates[0].orders["kind"] == kind
    for choice in (by_orders, by_kind):
        assert choice.estimate.dc_gain().item() == pytest.approx(numerator[-1] / denominator[-1], rel=0.02)
        assert choice.cautions == ()
    # the same minimum as that of the search of the estimator itself
    poles, zeros, _ = orders
    known = None if delay else 0.0
    own = tfest(data, poles, zeros, delay=known)
    np.testing.assert_allclose(by_orders.estimate.parameters, own.parameters, rtol=1e-3)
    np.testing.assert_allclose(by_kind.estimate.parameters, procest(data, kind).parameters, rtol=1e-3)


@pytest.mark.slow
def test_an_integrator_is_a_process_model_with_one():
    data = simulated([1.0], [0.4, 1.0, 0.0], 0.1, seed=2)
    choice = choose_procest(data)
    assert choice.candidates[0].orders["kind"] == "P1DI"
    gain, lag, delay = choice.estimate.parameters
    assert (gain, lag, delay) == pytest.approx((1.0, 0.4, 0.1), rel=0.1)


@pytest.mark.slow
def test_a_slow_disturbance_is_no_dynamics():
    """A slow sine that the input does not cause would be fitted by an undamped pair of poles."""
    data = simulated([2.0], [0.5, 1.0], seed=4)
    slow = 0.5 * np.sin(2.0 * np.pi * 0.03 * data.time)[:, None]
    choice = choose_tfest(IOData(data.u, data.y + slow, DT), largest=3)
    assert any("follows a disturbance" in candidate.remark for candidate in choice.candidates)
    assert choice.candidates[0].orders["poles"] == 1
    gain = choice.estimate.continuous_band(lambda model: model.dc_gain().ravel())
    assert abs(gain.value.item() - 2.0) < 3.0 * gain.deviation.item()
    assert gain.deviation.item() < 0.2


def test_what_cannot_be_chosen_is_refused():
    data = simulated([1.0], [0.5, 1.0], seed=4, samples=60)
    two = IOData(data.u, np.hstack((data.y, data.y)), DT)
    for choose in (choose_tfest, choose_procest):
        with pytest.raises(SysidError, match="chosen for one output, the data have 2"):
            choose(two)
        with pytest.raises(SysidError, match="input u1 is constant"):
            choose(IOData(0.0 * data.u, data.y, DT))
        with pytest.raises(SysidError, match="output y1 is constant"):
            choose(IOData(data.u, 0.0 * data.y, DT))
        with pytest.raises(SysidError, match="at least 2 are needed"):
            choose(data[:1])


def test_a_search_begins_at_a_start_alone():
    data = simulated([2.0], [0.5, 1.0], 0.2, seed=5, samples=400)
    own = procest(data, "P1D")
    again = procest(data, "P1D", start=own.parameters)
    np.testing.assert_allclose(again.parameters, own.parameters, rtol=1e-6)
    with pytest.raises(SysidError, match=r"start: expected the 3 parameters of the structure, got \[1.0, 2.0\]"):
        procest(data, "P1D", start=[1.0, 2.0])


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ("three", "start"),
        ([2.0, 0.5, -5.0], r"start: expected a delay from 0 to 1.5 s, .* got -5 s"),
        ([2.0, 0.5, 1e6], r"start: expected a delay from 0 to 1.5 s, .* got 1e\+06 s"),
        ([2.0, -0.5, 0.2], "start: expected parameters of a stable model"),
        ([0.0, 0.0, 0.0], "start: expected parameters of a stable model"),
    ],
)
def test_a_start_that_is_no_model_is_refused(start, message):
    data = simulated([2.0], [0.5, 1.0], 0.2, seed=5, samples=400)
    with pytest.raises(SysidError, match=message):
        procest(data, "P1D", start=start)


def test_a_late_step_of_a_long_record_is_found():
    """The search begins on the part in which the input moves; the first samples show nothing."""
    rng = np.random.default_rng(6)
    u = np.where(np.arange(3000) >= 2500, 1.0, 0.0)
    system = control.c2d(control.tf([2.0], [0.5, 1.0]), DT, "zoh")
    y = 1.0 + control.forced_response(system, U=u).outputs + 0.02 * rng.standard_normal(3000)
    choice = choose_tfest(IOData(u, y, DT), offset=True, largest=2)
    assert choice.candidates[0].orders["poles"] == 1
    assert choice.estimate.dc_gain().item() == pytest.approx(2.0, rel=0.02)
    assert -1.0 / choice.estimate.continuous.poles()[0].real == pytest.approx(0.5, rel=0.05)


def test_a_pair_of_poles_is_found_behind_real_ones():
    """A chirp with little noise: real poles with a zero fit well, the true kind must be reached from them."""
    dt = 0.01
    time = dt * np.arange(2000)
    u = np.sin(2.0 * np.pi * (0.1 * time + 0.5 * 6.0 / time[-1] * time**2))
    natural, damping = 2.0 * np.pi * 2.5, 0.85
    system = control.c2d(control.tf([natural**2], [1.0, 2.0 * damping * natural, natural**2]), dt, "zoh")
    y = control.forced_response(system, U=u).outputs + 1e-3 * np.random.default_rng(7).standard_normal(2000)
    choice = choose_procest(IOData(u, y, dt), offset=True)
    assert choice.candidates[0].orders["kind"] == "P2U"
    gain, time_constant, found = choice.estimate.parameters
    assert (gain, time_constant, found) == pytest.approx((1.0, 1.0 / natural, damping), rel=0.01)


def test_each_input_has_the_part_in_which_it_moves_most():
    u = np.zeros((6000, 2))
    u[1000:1010, 0], u[5000:5010, 1] = 1.0, 1.0
    record = IOData(u, np.zeros(6000), DT)
    parts = liveliest_parts([record], 1000, 30)
    assert len(parts) == 2
    for j, part in enumerate(parts):
        assert len(part) <= 530
        assert part.u[:, j].sum() == pytest.approx(10.0)
        # its first samples do not count
        assert not part.u[:30, j].any()
    short = [record[:1400]]
    assert liveliest_parts(short, 1000, 30) is short


def test_a_record_too_short_for_any_other_kind_is_no_choice():
    choice = choose_procest(IOData([0.0, 1.0, 0.0], [0.0, 0.0, 1.0], DT))
    (caution,) = choice.cautions
    assert caution.startswith("no other candidate could be fitted")
    assert "too many orders for 3 samples" in caution


@pytest.mark.parametrize(("gain", "zero", "lag"), [(2.0, 0.9, 0.3), (1.0, 0.05, 2.0), (1.0, 1.2, 1.0)])
def test_a_direct_term_of_a_held_input_is_tried(gain, zero, lag):
    """`tfest` fitted 45 to 95 %, `procest` chose a gain alone, with one of 4.3 in place of 2."""
    data = simulated([gain * zero, gain], [lag, 1.0], seed=4)
    by_orders, by_kind = choose_tfest(data, offset=True), choose_procest(data, offset=True)
    assert by_orders.candidates[0].orders == {"poles": 1, "zeros": 1, "delay": 0}
    assert by_kind.candidates[0].orders["kind"] == "P1Z"
    for choice in (by_orders, by_kind):
        assert choice.estimate.dc_gain().item() == pytest.approx(gain, rel=0.05)


def test_beside_feedback_no_direct_term_is_tried():
    """The controller computes the input from the output of the same sample: its inverse would fit exactly."""
    rng = np.random.default_rng(5)
    u, y = np.zeros(800), np.zeros(800)
    reference = np.repeat(rng.choice([-1.0, 1.0], 40), 20)
    disturbance = 0.3 * rng.standard_normal(800)
    plant = 0.0
    for k in range(800):
        plant = 0.9 * plant + 0.1 * (u[k - 1] if k else 0.0)
        y[k] = plant + disturbance[k]
        u[k] = 3.0 * (reference[k] - y[k])
    data = IOData(u, y, DT)
    for choice in (choose_tfest(data), choose_procest(data)):
        for candidate in choice.candidates:
            orders = candidate.orders
            assert orders.get("zeros", 0) < orders.get("poles", 1)
            assert not str(orders.get("kind", "")).startswith("P1Z")
