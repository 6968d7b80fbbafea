"""The exchange of the replacement unit: one whole run, and the operator and the judge alone."""

from dataclasses import replace

import numpy as np
import pytest

import hmtb_twin
from hmtb_twin import Status, View
from hmtb_twin.control.experiment import UnitView
from hmtb_twin.parameters.variants import JOINTS, LINKS, MOTIONS
from hmtb_twin.parameters.worksite import SEATS, UNIT
from scenarios import load
from scenarios.experiments.operator import GRAVITY, PEAK, ScriptedOperator, Skill, Step, Submovement
from scenarios.experiments.rpcm import PHASES, approach_point, rpcm_outcome
from scenarios.experiments.scenario import Scenario
from tests.benchmarks.rpcm import LIMITED
from tests.refusals import refused

# What all of them set up takes seconds.
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def log():
    return hmtb_twin.simulate([replace(load("rpcm"), seed=77, duration=110.0)])[0]


def test_unit_is_inserted_and_brought_back_within_limits(log):
    outcome = rpcm_outcome(log)
    assert tuple(outcome.phases) == PHASES
    assert outcome.inserted and outcome.returned
    assert 0.0 < outcome.peak_contact_force < 300.0
    starts, ends = zip(*outcome.phases.values(), strict=True)
    assert starts[1:] == ends[:-1]
    assert list(ends) == sorted(ends)
    assert str(outcome).startswith("inserted, released at ")
    forces = (outcome.peak_contact_force, outcome.largest_contact_force)
    assert "contact force up to {:.0f} N while inserting, {:.0f} N in all".format(*forces) in str(outcome)


def test_a_large_force_outside_the_insertion_is_reported(log):
    outcome = replace(rpcm_outcome(log), peak_contact_force=15.0, height=-1e-5)
    assert "250 N, arose outside the insertion" in str(replace(outcome, largest_contact_force=250.0).warning())
    assert replace(outcome, largest_contact_force=199.0).warning() is None
    assert replace(outcome, peak_contact_force=250.0, largest_contact_force=250.0).warning() is None
    assert " 0.0 mm above its seat" in str(outcome)
    assert not (log.status & LIMITED).any()
    for angle, name in zip(log.true_angles.T, JOINTS, strict=True):
        assert np.abs(np.diff(angle)).max() / log.dt < 5.0 * MOTIONS[name].velocity_limit
        assert MOTIONS[name].lower <= angle.min() and angle.max() <= MOTIONS[name].upper
    (hold, _), (released, _) = outcome.phases["hold"], outcome.phases["release"]
    weight = np.linalg.norm(log.wrench[:, :3], axis=1)
    # The wrist carries the unit while it is held.
    loaded, empty = weight[int((hold + 5.0) / log.dt)], weight[int((released + 8.0) / log.dt)]
    assert loaded - empty == pytest.approx(GRAVITY * UNIT.mass, rel=0.02)


def test_outcome_of_less_than_the_whole(log):
    unit = log.unit_pose.copy()
    # The unit stands a little too high: everything else as it was.
    unit[:, 2] += 0.003
    assert not rpcm_outcome(replace(log, unit_pose=unit)).inserted
    never = rpcm_outcome(replace(log, status=np.where(log.time > 5.0, Status.UNIT_HELD.value, 0)))
    assert not never.inserted and "insert" not in never.phases
    assert "not released" in str(never)
    refused("worksite", rpcm_outcome, replace(log, unit_pose=None, contact_force=None))


def test_seed_draws_the_operator():
    short = replace(load("rpcm"), duration=6.0)
    first, again, other = hmtb_twin.simulate([short, replace(short, name="b"), replace(short, name="c", seed=9)])
    np.testing.assert_array_equal(first.counts, again.counts)
    assert np.abs(first.volts - other.volts).max() > 0.5


def test_the_unloaded_way_leaves_the_unit_alone():
    log = hmtb_twin.simulate([replace(load("rpcm-unloaded"), duration=20.0)])[0]
    assert not (log.status & Status.UNIT_HELD).any()
    assert np.ptp(log.unit_pose, axis=0).max() < 1e-4
    tool, _ = hmtb_twin.load_arm().controller.tool_path(log.true_angles)
    assert np.linalg.norm(tool[-1, :2] - SEATS["receptacle"].seated[0][:2]) < 0.05


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"task": "juggle"}, r"'juggle'.*rpcm"),
        ({"mode": "cartesian"}, 'mode = "cartesian_rate"'),
        ({"worksite": False}, "worksite = true"),
        ({"axes": ("x", "y", "z")}, "axes = x, y, z, roll"),
        ({"payload": "rpcm"}, "in its holster"),
        ({"excitation": load("siso-1-elbow_pitch").excitation}, "no excitation"),
    ],
)
def test_a_task_is_refused_without_what_it_needs(change, message):
    refused(message, replace, load("rpcm"), **change)
    text = load("rpcm").to_toml()
    assert "excitation" not in text
    assert Scenario.from_toml(text) == load("rpcm")


def test_a_submovement_covers_its_distance_smoothly_and_only_then():
    movement = Submovement(np.array([0.3, -0.1]), start=1.0, duration=2.0)
    time = np.arange(0.0, 4.0, 1e-3)
    velocity = np.array([movement.velocity(t) for t in time])
    np.testing.assert_allclose(velocity.sum(axis=0) * 1e-3, movement.distance, rtol=1e-6)
    assert not velocity[(time <= 1.0) | (time >= movement.end)].any()
    assert velocity[:, 0].max() == pytest.approx(PEAK * 0.3 / 2.0, rel=1e-6)
    # It starts and stops without a step in acceleration: its jerk is nowhere beyond 60 d / T^3, the least possible.
    assert np.abs(np.diff(velocity, 2, axis=0)).max() < 1.001 * 60.0 * 0.3 / 2.0**3 * 1e-6


GAINS = np.array([0.02, 0.02, 0.02, 0.05, 0.05, 0.05])
PERFECT = Skill(blur=0.0, tilt=0.0, weber=0.0, spread=0.0, stray=0.0)


def moved(operator, start, seconds, force=0.0):
    """Positions (N, 3) of a tool that points down and follows the stick at once, a force along it beside the weight."""
    place, path, rotation = start.copy(), [], approach_point()[1]
    wrench = np.array([-GRAVITY * LINKS["end_effector"].mass - force, 0.0, 0.0, 0.0, 0.0, 0.0])
    for tick in range(round(50 * seconds)):
        unit = UnitView(*SEATS["holster"].seated, False)
        motion = operator.move(View(0.02 * tick, place.copy(), rotation, wrench, unit))
        place = place + rotation @ (motion.volts[:3] * GAINS[:3]) * 0.02
        path.append(place)
    return np.array(path)


def test_operator_waits_for_his_eyes_then_reaches_the_target_in_one_movement():
    start, rotation = approach_point()
    target = start + np.array([0.0, 0.2, 0.0])
    path = moved(ScriptedOperator((Step("go", (target, rotation)),), GAINS, 0, PERFECT), start, 8.0)
    assert not (path[:12] - start).any()
    np.testing.assert_allclose(path[-1], target, atol=1e-4)
    speed = np.linalg.norm(np.diff(path, axis=0), axis=1) / 0.02
    assert speed.max() == pytest.approx(0.1, rel=0.01)


def test_operator_who_misses_corrects_until_he_is_near():
    start, rotation = approach_point()
    target = start + np.array([0.0, 0.2, 0.0])
    clumsy = Skill(spread=0.2, stray=0.1)
    path = moved(ScriptedOperator((Step("go", (target, rotation)),), GAINS, 3, clumsy), start, 20.0)
    still = np.linalg.norm(np.diff(path, axis=0), axis=1) < 1e-9
    assert np.count_nonzero(np.diff(still.astype(int)) == -1) >= 2
    assert np.abs(path[-1] - target).max() < 0.008


def test_operator_backs_off_from_force_only_where_he_expects_contact():
    start, rotation = approach_point()
    down = start - np.array([0.0, 0.0, 0.05])
    for touching in (False, True):
        step = Step("down", (down, rotation), touching=touching, stride=0.05)
        # Pushed back along the tool, upward: the sensor carries less of the weight.
        path = moved(ScriptedOperator((step,), GAINS, 0, PERFECT), start, 4.0, force=-40.0)
        assert (path[:, 2].min() < start[2] - 0.04) == (not touching)
        assert (path[-1, 2] > start[2]) == touching
