import re
from dataclasses import dataclass, replace

import numpy as np
import pytest

from hmtb_twin import IDEAL, JOINTS, Chain, Motion, Status, load_arm, simulate
from hmtb_twin.control.hand_controller import HandControllerInterface, deflection, pickup
from hmtb_twin.parameters.values import HAND_CONTROLLER, RECORDER
from hmtb_twin.parameters.variants import ACTUATORS
from scenarios import Scenario
from tests.hmtb_twin.altered_arms import LOWER, UPPER, equal
from tests.refusals import refused


class Replay:
    """An operator who moves the stick exactly as the excitation computer would."""

    def __init__(self, volts):
        self._volts = iter(volts)
        self.views = []

    def move(self, view):
        self.views.append(view)
        return Motion(next(self._volts))


def operated(experiment, make):
    """The kind of experiment whose operator is made by `make`."""
    return dataclass(frozen=True)(type("Operated", (experiment,), {"operator": make}))


@pytest.mark.parametrize("mode", ["single_joint", "single_joint_rate", "cartesian", "cartesian_rate"])
def test_an_operator_who_does_the_same_gives_the_same_log_and_sees_the_tool_where_it_is(experiment, mode):
    operators = []

    def replay(self):
        operators.append(Replay(experiment.volts(self)))
        return operators[-1]

    axes = ("x", "z") if mode.startswith("cartesian") else ("shoulder_yaw", "elbow_pitch")
    settings = {"mode": mode, "axes": axes, "duration": 2.0}
    by_hand, played = simulate([operated(experiment, replay)(**settings), experiment(**settings)])
    assert equal(by_hand, played)
    for k in (0, 20, 99):
        view, (position, rotation) = operators[0].views[k], load_arm().controller.tool_pose(by_hand.true_angles[k])
        assert view.time == pytest.approx(k * 0.02)
        np.testing.assert_allclose(view.tool_position, position, atol=1e-12)
        np.testing.assert_allclose(view.tool_rotation, rotation, atol=1e-12)
        np.testing.assert_array_equal(view.wrench, by_hand.wrench[k])


def test_saturation_and_limits_are_flagged(experiment):
    log = simulate([experiment(amplitude=12.0, duration=2.0)])[0]
    saturated = (np.abs(log.counts) >= 2047).any(axis=1)
    np.testing.assert_array_equal((log.status & Status.CONVERTER_SATURATED) != 0, saturated)
    assert saturated.all()
    assert ((log.status & Status.VELOCITY_LIMITED) != 0).any()
    free = simulate([experiment(amplitude=1.0, duration=2.0, chain=Chain(velocity_limit=False))])[0]
    assert (free.status == 0).all()


@pytest.fixture(scope="module")
def stopped(experiment):
    """A binary test of the shoulder pitch with the power off from 3 s to 6 s, run beside another; the other alone."""
    other = experiment(duration=3.0)
    off = experiment(name="off", axes=("shoulder_pitch",), duration=9.0, shutdown=(3.0, 6.0))
    log, company = simulate([off, other])
    assert equal(simulate([other])[0], company)
    np.testing.assert_array_equal(np.flatnonzero(log.status & Status.SHUT_DOWN), np.arange(150, 300))
    return log


def test_trapped_oil_holds_the_arm_but_for_its_leakage(stopped):
    """Each joint creeps with the leakage flow that its load pressure drives, while the oil rings."""
    angles, pressure, duration = stopped.true_angles[200:299], stopped.load_pressure[200:299], 98 * stopped.dt
    actuators = [ACTUATORS[name] for name in JOINTS]
    leakage, compliance, displacement = np.array([[a.leakage, a.compliance, a.displacement] for a in actuators]).T
    leaked = leakage * np.trapezoid(pressure, dx=stopped.dt, axis=0)
    expected = -(leaked + compliance * (pressure[-1] - pressure[0])) / displacement
    moved = angles[-1] - angles[0]
    np.testing.assert_allclose(moved[1:], expected[1:], atol=2e-5)
    assert 0.002 < abs(moved[2]) / duration < 0.02


def test_restart_is_bumpless(stopped):
    """The command starts where the arm stands, and the arm does not jump."""
    resolver = 5.0 * RECORDER.noise + RECORDER.resolver_step
    assert np.abs(stopped.commanded[300] - stopped.true_angles[300])[1:].max() < resolver
    sample = np.diff(stopped.true_angles[298:303], axis=0) / stopped.dt
    assert np.abs(sample).max() < 0.05
    # afterwards it follows the stick again
    assert np.ptp(stopped.true_angles[310:, 2]) > 0.02


@pytest.mark.parametrize("times", [(0.0,), (0.005,), (5.0,), (3.999,), (2.0, 1.0), (3.0, 3.005), (float("nan"),)])
def test_bad_shutdowns_are_refused(experiment, times):
    refused("power off", simulate, [experiment(duration=4.0, shutdown=times)])


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (Motion(np.zeros(6)), r"expected 1 finite numbers, one per axis, at 0.02 s"),
        (Motion(np.array([np.nan])), r"expected 1 finite numbers"),
        (Motion("up"), r"expected 1 numbers"),
        (None, r"gave NoneType, expected a Motion"),
    ],
)
def test_an_operator_who_does_the_impossible_fails_alone(experiment, answer, message):
    class Wrong:
        def move(self, view):
            return Motion(np.zeros(1)) if view.time < 0.01 else answer

    kind = operated(experiment, lambda _: Wrong())
    logs = simulate([kind(name="wrong", duration=0.1), experiment(duration=0.1)])
    assert [log.name for log in logs] == ["binary"]
    assert re.search(message, logs.failed["wrong"])
    refused(r"gave int, expected an object with a method move", simulate, [operated(experiment, lambda _: 3)()])


def test_the_log_names_its_operator_and_claims_no_recipe_it_cannot_keep():
    class Own(Scenario):
        def operator(self):
            return Replay(np.zeros((50, 1)))

    log = simulate([Own("own", ("wrist_yaw",), (), duration=1.0)])[0]
    assert "scenario" not in log.provenance
    assert log.provenance["operator"].endswith("Replay")


def test_a_restart_beyond_a_range_begins_at_its_end_with_a_flag(experiment):
    push = experiment(
        axes=JOINTS[1:], pose="home", duration=7.0, shutdown=(3.0, 6.0), spoil=dict.fromkeys(range(350), 9.9)
    )
    log = simulate([push])[0]
    assert ((log.commanded >= LOWER) & (log.commanded <= UPPER)).all()
    beyond = ((log.true_angles < LOWER - 1e-3) | (log.true_angles > UPPER + 1e-3)).any(axis=1)[150:301]
    assert beyond.any(), "an arm at its limit creeps beyond it"
    assert ((log.status[150:301] & Status.JOINT_LIMITED) != 0)[beyond].all()


def interface(volts, parameters=HAND_CONTROLLER, chain=IDEAL, seed=0):
    """Received volts and counts of one axis."""
    column = np.atleast_2d(volts).T
    disturbance = pickup(len(column), 1, parameters, np.random.default_rng(seed), chain)
    received, counts = HandControllerInterface(parameters, chain, disturbance).read(column)
    return received[:, 0], counts[:, 0]


def test_coloured_noise_keeps_its_size_and_loses_its_high_frequencies():
    coloured, _ = interface(np.zeros(60_000), replace(HAND_CONTROLLER, noise_corner=1.0), replace(IDEAL, noise=True))
    assert abs(coloured.std() / HAND_CONTROLLER.noise - 1.0) < 0.05
    correlation = np.corrcoef(coloured[1:], coloured[:-1])[0, 1]
    assert correlation == pytest.approx(np.exp(-2 * np.pi / 50), abs=0.02)


def test_mains_hum_is_seen_at_its_alias():
    hum, _ = interface(np.zeros(5000), replace(HAND_CONTROLLER, noise=0.0, hum=0.1), replace(IDEAL, noise=True))
    spectrum = np.abs(np.fft.rfft(hum)) / 2500
    assert np.fft.rfftfreq(5000, 0.02)[spectrum.argmax()] == pytest.approx(10.0)
    assert spectrum.max() == pytest.approx(0.1, rel=1e-3)


def test_converter_saturates_and_the_circuit_takes_most_of_the_bias_away():
    assert interface(np.array([50.0, -50.0]))[1].tolist() == [2047.0, -2048.0]
    chain = replace(IDEAL, bias=True)
    bias, left = (interface(np.zeros(1), replace(HAND_CONTROLLER, compensation=part), chain)[0] for part in (0.0, 0.95))
    np.testing.assert_allclose(left, 0.05 * bias)


def test_deadband_keeps_small_deflections_from_the_arm_and_leaves_no_step():
    wide = replace(HAND_CONTROLLER, deadband=0.1)
    counts = np.array([-1.0, -0.1, 0.05, 0.1, 0.3]) / HAND_CONTROLLER.adc_step
    np.testing.assert_allclose(deflection(counts, wide), [-0.9, 0.0, 0.0, 0.0, 0.2], atol=1e-12)
