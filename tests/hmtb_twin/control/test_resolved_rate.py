import numpy as np
import pinocchio as pin
import pytest

from hmtb_twin.control.bounded_qp import bounded_step
from hmtb_twin.control.resolved_rate import CLEARANCE, ResolvedRate
from hmtb_twin.control.tool_kinematics import ToolKinematics
from hmtb_twin.parameters.values import SAMPLE_TIME
from hmtb_twin.parameters.variants import JOINTS, MOTIONS, POSES
from tests.hmtb_twin.altered_arms import LOWER, UPPER
from tests.refusals import refused

STEP = np.array([MOTIONS[name].velocity_limit for name in JOINTS]) * SAMPLE_TIME
TURN = 1e-9
"""How exactly the tool's orientation is commanded, rad; the controller promises 1e-6."""


class Run:
    """Commands on the way to wanted poses, each within all limits and exactly oriented or the test fails."""

    def __init__(self, arm, start, step=STEP):
        self.arm, self.rate, self.step = arm, ResolvedRate(arm.controller, lower=LOWER, upper=UPPER, step=step), step
        self.start = self.angles = np.array(start)
        self.position, self.rotation = arm.controller.tool_pose(self.angles)

    def toward(self, offset=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0), ticks=1):
        """Follow an offset and a turn in the starting tool frame; return what was limited on the way."""
        flags = []
        position = self.position + self.rotation @ offset
        rotation = self.rotation @ pin.exp3(np.array(turn)) if np.any(turn) else self.rotation
        for _ in range(ticks):
            before = self.angles
            tick = self.rate.follow(before, position, rotation)
            self.angles = tick.angles
            assert (np.abs(self.angles - before) <= self.step * (1 + 1e-12)).all()
            assert (self.angles <= np.maximum(UPPER, before)).all()
            assert (self.angles >= np.minimum(LOWER, before)).all()
            assert self.angles[0] == before[0]
            _, was = self.arm.controller.tool_pose(before)
            place, now = self.tool()
            # The tool has turned some of the shortest way, and none of any other.
            way, turned = pin.log3(was.T @ rotation), pin.log3(was.T @ now)
            distance = np.linalg.norm(way)
            if distance < TURN:
                assert np.linalg.norm(turned) < TURN
            else:
                assert np.linalg.norm(np.cross(turned, way / distance)) < TURN
                assert -TURN < turned @ way / distance < distance + TURN
            if not (tick.velocity_limited or tick.joint_limited or tick.singular):
                assert np.linalg.norm(place - position) < 1e-8
                assert np.linalg.norm(pin.log3(now.T @ rotation)) < TURN
            flags.append((tick.velocity_limited, tick.joint_limited, tick.singular))
        return np.array(flags)

    def check_return(self, ticks):
        """Check that the arm comes back to where it started."""
        self.toward(ticks=ticks)
        assert self.angles == pytest.approx(self.start, abs=1e-12)

    def tool(self):
        return self.arm.controller.tool_pose(self.angles)

    def gap(self, offset):
        """Distance of the tool from where it is wanted, m."""
        return np.linalg.norm(self.tool()[0] - self.position - self.rotation @ offset)


@pytest.mark.parametrize("index", [0.0, 0.7])
@pytest.mark.parametrize("pose", POSES)
def test_slow_motion_is_exact_and_free_of_flags_at_any_index_of_the_shoulder_roll(arm, pose, index):
    start = np.array([index, *POSES[pose][1:]])
    run = Run(arm, start)
    for k in range(1, 500, 1 if index == 0.0 else 5):
        offset = 0.03 * np.sin(2 * np.pi * np.array([0.2, 0.3, 0.1]) * k * SAMPLE_TIME)
        assert not run.toward(offset).any()
        assert run.gap(offset) < 1e-13
    run.toward(ticks=10)
    assert run.angles == pytest.approx(start, abs=1e-14)


def test_command_is_the_same_whatever_the_way_there(arm):
    start, wanted = POSES["rpcm_holster_out_approach"], (0.02, -0.05, 0.04)
    direct, roundabout = Run(arm, start), Run(arm, start)
    direct.toward(wanted, ticks=40)
    roundabout.toward((-0.1, 0.1, -0.1), ticks=40)
    roundabout.toward(wanted, ticks=60)
    assert np.array_equal(direct.angles, roundabout.angles)


def test_velocity_limited_tool_stays_on_its_line(arm):
    run, offset = Run(arm, POSES["rpcm_holster_out_approach"]), np.array([0.1, -0.15, 0.05])
    limited, travelled = [], [0.0]
    direction = run.rotation @ offset / np.linalg.norm(offset)
    while run.gap(offset) > 1e-12:
        before = run.angles
        limited.append(run.toward(offset)[0])
        way = run.tool()[0] - run.position
        travelled.append(way @ direction)
        assert np.linalg.norm(way - travelled[-1] * direction) < 1e-12
        if limited[-1][0]:
            assert (np.abs(run.angles - before) / STEP).max() > 0.99
    assert (np.diff(travelled) > 0.0).all()
    limited = np.array(limited)
    assert limited[:-1, 0].all()
    assert not limited[-1].any()
    assert not limited[:, 1:].any()


@pytest.mark.slow
@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", [-2.0, 2.0])
def test_arm_driven_as_far_as_it_goes_comes_back(arm, pose, axis, side):
    run, offset = Run(arm, POSES[pose]), np.eye(3)[axis] * side
    flags = run.toward(offset, ticks=500)
    assert flags.any(axis=1).all()
    assert flags[-1, 1:].any()
    nearest = run.gap(offset)
    run.toward(offset, ticks=300)
    assert run.gap(offset) <= nearest + 1e-9
    run.check_return(ticks=500)


def test_elbow_straightens_without_fast_joints_and_bends_again(arm):
    run, offset = Run(arm, POSES["rpcm_holster_out_approach"]), np.array([2.0, 0.0, 0.0])
    flags = run.toward(offset, ticks=1500)
    assert run.angles[3] == 0.0
    assert flags[:, 2].any()
    assert flags[-1, 1]
    # At rest there: no chatter.
    before = run.angles
    run.toward(offset)
    assert np.abs(run.angles - before).max() < 1e-4
    # From a straight elbow straight back, where the tool has no gradient to follow.
    run.check_return(ticks=500)
    straight, offset = Run(arm, np.radians([0.0, 10.0, 0.0, 0.0, 0.0, -10.0, 0.0])), np.array([-0.05, 0.0, 0.0])
    assert straight.toward(offset, ticks=300)[0].any()
    assert straight.gap(offset) < 1e-8


def test_wrist_centre_stops_short_of_the_yaw_axis_and_returns(arm):
    start = np.radians([0.0, 10.0, 60.0, 140.0, -60.0, 0.0, 0.0])
    run, kinematics = Run(arm, start), ToolKinematics(arm.controller)
    inward = np.array([-np.cos(start[1]), -np.sin(start[1]), 0.0]) + 0.02 * np.array([-np.sin(start[1]), 0.98, 0.0])
    flags = run.toward(run.rotation.T @ inward, ticks=600)
    _, _, shoulder, elbow, pitch, _, _ = run.angles
    assert kinematics.radius(shoulder, elbow, shoulder - elbow + pitch) == pytest.approx(CLEARANCE, abs=1e-3)
    assert flags[-1, 2]
    run.check_return(ticks=600)


def test_joint_at_the_end_of_its_range_lets_the_others_go_on(arm):
    # The wrist pitch is nearly at its end; moving the tool back and down takes it there.
    start = np.radians([0.0, 20.0, 50.0, 90.0, -85.0, 0.0, 0.0])
    run = Run(arm, start)
    offset = run.rotation.T @ np.array([0.25, 0.1, 0.25])
    flags = run.toward(offset, ticks=600)
    assert flags[-1, 1]
    assert run.angles[4] == pytest.approx(LOWER[4], abs=1e-12)
    # What is left to gain is against the wrist pitch alone: no motion of the tool that keeps it brings it nearer.
    jacobian = arm.controller.tool_jacobian(run.angles)[:, 1:]
    kept = np.vstack([jacobian[3:], np.eye(6)[3]])
    free = np.linalg.svd(kept)[2][4:].T
    gap = run.rotation.T @ (run.tool()[0] - run.position) - offset
    assert np.linalg.norm(gap) > 1e-3
    assert np.abs(free.T @ jacobian[:3].T @ gap).max() < 1e-3 * np.linalg.norm(gap)
    run.check_return(ticks=300)


def test_tool_turns_about_its_own_place(arm):
    start = POSES["rpcm_holster_out_approach"]
    for axis in np.eye(3):
        run = Run(arm, start)
        flags = run.toward(turn=0.3 * axis, ticks=80)
        assert flags[0, 0]
        assert not flags[-1].any()
        assert run.gap((0, 0, 0)) < 1e-12
        run.check_return(ticks=80)


def test_turn_that_a_range_forbids_stops_and_the_tool_still_moves(arm):
    start = np.array(POSES["rpcm_holster_out_approach"])
    run = Run(arm, start)
    flags = run.toward(turn=(2.0, 2.0, 0.0), ticks=300)
    assert flags[-1, 1]
    _, stopped = run.tool()
    flags = run.toward((0.0, 0.05, 0.0), (2.0, 2.0, 0.0), ticks=200)
    assert flags[-1, 1]
    place, rotation = run.tool()
    assert np.linalg.norm(pin.log3(stopped.T @ rotation)) < 0.05
    assert (run.rotation.T @ (place - run.position))[1] > 0.04
    run.check_return(ticks=300)


def test_without_velocity_limits_one_tick_suffices(arm):
    run = Run(arm, POSES["rpcm_holster_out_approach"], np.full(7, np.inf))
    assert not run.toward((0.1, -0.2, 0.1), (0.2, 0.1, -0.2)).any()
    assert run.gap((0.1, -0.2, 0.1)) < 1e-12
    flags = run.toward((2.0, 0.0, 0.0))
    assert flags[0, 1]
    assert not flags[0, 0]
    nearest = run.gap((2.0, 0.0, 0.0))
    run.toward((2.0, 0.0, 0.0), ticks=50)
    assert run.gap((2.0, 0.0, 0.0)) == pytest.approx(nearest, abs=1e-3)
    run.check_return(ticks=2)


@pytest.mark.slow
def test_random_poses_and_pushes_stay_within_every_limit(arm):
    rng = np.random.default_rng(5)
    kinds = set()
    for _ in range(40):
        start = rng.uniform(LOWER, UPPER)
        start[0] = 0.0
        run = Run(arm, start)
        amount = rng.choice([0.05, 0.5, 3.0])
        turn = rng.normal(size=3) * rng.choice([0.0, 0.3])
        kinds |= set(map(tuple, run.toward(rng.normal(size=3) * amount, turn, ticks=60)))
        kinds |= set(map(tuple, run.toward(ticks=60)))
    assert len(kinds) >= 6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"step": STEP[1:]}, "7 numbers"),
        ({"upper": np.full(7, np.nan)}, "7 numbers"),
        ({"step": -STEP}, "above zero"),
        ({"lower": UPPER, "upper": LOWER}, "below"),
        ({"locked": ()}, "none given, expected shoulder_roll"),
        ({"locked": ("elbow_pitch",)}, "elbow_pitch given"),
    ],
)
def test_limits_and_poses_that_make_no_sense_are_refused(arm, change, message):
    start = np.array(POSES["home"])
    follow = Run(arm, start).rate.follow
    position, rotation = arm.controller.tool_pose(start)
    for spoilt in (np.nan, np.inf):
        refused("finite", follow, start, np.array([position[0], spoilt, 1.0]), rotation)
        refused("finite", follow, start, position, np.where(np.eye(3) > 0.0, spoilt, rotation))
    refused(message, ResolvedRate, arm.controller, **{"lower": LOWER, "upper": UPPER, "step": STEP} | change)


def test_rows_that_say_the_same_do_not_cycle():
    rows = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    upper = np.array([0.5, 0.8, np.inf])
    step, active = bounded_step(np.eye(3), np.array([1.0, 1.0, 1.0]), rows, np.full(3, -np.inf), upper)
    assert np.allclose(step, [0.4, 1.0, 1.0])
    assert active == [1]
