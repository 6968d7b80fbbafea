"""Resolved rates of any arm by damped least squares, against MuJoCo's kinematics and the formula."""

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from hmtb_twin import load_arm, simulate
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.control.damped_rates import DAMPING, DampedRates, damped_step, step_within_bounds
from scenarios.experiments import Excitation, Scenario
from tests.refusals import refused

ARMS = ["panda", "ur10", "kinova", "xarm7"]


def solver(name, step=np.inf, lower=None, upper=None):
    arm = load_arm(name)
    count = len(arm.joints)
    return arm.controller, DampedRates(
        arm.controller,
        lower=arm.description.lower if lower is None else lower,
        upper=arm.description.upper if upper is None else upper,
        step=np.full(count, step),
    )


@pytest.mark.parametrize("name", ARMS)
def test_the_jacobian_is_that_of_mujocos_tool(name):
    arm = load_arm(name)
    data, count = mujoco.MjData(arm.model), len(arm.joints)
    site = arm.model.site("tool").id

    def tool(angles):
        data.qpos[:count] = angles
        mujoco.mj_kinematics(arm.model, data)
        return data.site_xpos[site].copy(), data.site_xmat[site].reshape(3, 3).copy()

    angles = arm.pose(arm.description.operating_pose)
    jacobian = arm.controller.tool_jacobian(angles)
    _, rotation = tool(angles)
    step = 1e-6
    for column, moved in enumerate(np.eye(count)):
        (ahead, turned), (behind, back) = tool(angles + step * moved), tool(angles - step * moved)
        velocity = rotation.T @ (ahead - behind) / (2 * step)
        turn = pin.log3(back.T @ turned) / (2 * step)
        np.testing.assert_allclose(jacobian[:, column], np.concatenate([velocity, turn]), atol=1e-6)


@pytest.mark.parametrize("name", ARMS)
def test_a_wanted_pose_within_reach_is_reached_exactly_and_nothing_drifts(name):
    arm = load_arm(name)
    controller, rates = solver(name)
    angles = arm.pose(arm.description.operating_pose)
    position, rotation = controller.tool_pose(angles)
    rng = np.random.default_rng(1)
    for _ in range(20):
        wanted = position + 0.01 * rng.uniform(-1, 1, 3)
        turned = rotation @ pin.exp3(0.02 * rng.uniform(-1, 1, 3))
        reached = rates.follow(angles, wanted, turned)
        assert not (reached.singular or reached.joint_limited or reached.velocity_limited)
        angles = reached.angles
        there, orientation = controller.tool_pose(angles)
        np.testing.assert_allclose(there, wanted, atol=1e-8)
        np.testing.assert_allclose(orientation, turned, atol=1e-8)


def test_more_joints_than_needed_move_as_little_as_they_can():
    controller, _ = solver("panda")
    angles = load_arm("panda").pose("default")
    jacobian = controller.tool_jacobian(angles)
    step, damped = damped_step(jacobian, np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert damped == 0.0
    # no motion of the joints that leaves the tool where it is
    null = np.linalg.svd(jacobian)[2][-1]
    assert abs(step @ null) < 1e-12
    np.testing.assert_allclose(jacobian @ step, [0.01, 0, 0, 0, 0, 0], atol=1e-12)


def test_near_a_singular_pose_joints_stay_slow():
    rng = np.random.default_rng(2)
    left, right = np.linalg.qr(rng.standard_normal((6, 6)))[0], np.linalg.qr(rng.standard_normal((6, 6)))[0]
    for least in (0.0, 1e-6, 1e-3, 0.01, 0.029, 0.031):
        values = np.array([1.0, 0.9, 0.7, 0.5, 0.3, least])
        jacobian = left @ np.diag(values) @ right.T
        error = left[:, -1]
        step, damped = damped_step(jacobian, error)
        square = DAMPING**2 * max(1.0 - (least / 0.03) ** 2, 0.0)
        assert damped == pytest.approx(np.sqrt(square), rel=1e-9)
        np.testing.assert_allclose(np.linalg.norm(step), least / (least**2 + square), rtol=1e-9, atol=1e-12)
        # the least damped step is the fastest: 1 / (2 DAMPING) without the slope of the damping, a little more with it
        assert np.linalg.norm(step) <= 1.0 / 0.029
    assert damped_step(np.zeros((6, 3)), np.ones(6))[0].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("name", ["panda", "ur10"])
def test_a_joint_at_its_end_stays_there_and_the_others_help(name):
    arm = load_arm(name)
    angles = arm.pose(arm.description.operating_pose)
    lower, upper = arm.description.lower.copy(), arm.description.upper.copy()
    upper[1] = lower[1] + (angles[1] - lower[1]) * (1.0 + 1e-9)
    controller, rates = solver(name, lower=lower, upper=upper)
    position, rotation = controller.tool_pose(angles)
    for k in range(40):
        wanted = position + 0.002 * k * np.array([0.5, 0.5, -0.7])
        reached = rates.follow(angles, wanted, rotation)
        angles = reached.angles
        assert (angles <= upper).all() and (angles >= lower).all()
    there, turned = controller.tool_pose(angles)
    error = np.concatenate([turned.T @ (wanted - there), 0.3 * pin.log3(turned.T @ rotation)])
    weighed = np.diag([1, 1, 1, 0.3, 0.3, 0.3]) @ controller.tool_jacobian(angles)
    free = angles < upper - 1e-12
    # as near as the others can: no motion of theirs brings the tool nearer
    assert np.abs(weighed[:, free].T @ error).max() < 1e-5
    assert np.linalg.norm(error) < np.linalg.norm(wanted - position)
    assert reached.joint_limited or np.linalg.norm(error) < 1e-8


@pytest.mark.parametrize("name", ARMS)
def test_a_fast_tool_slows_down_and_stays_on_its_line(name):
    arm = load_arm(name)
    controller, rates = solver(name, step=0.002)
    angles = arm.pose(arm.description.operating_pose)
    position, rotation = controller.tool_pose(angles)
    way = np.array([0.03, -0.02, 0.01])
    reached = rates.follow(angles, position + way, rotation)
    assert reached.velocity_limited
    # as fast as it may, less a reserve for the curvature of its way
    assert 0.99 * 0.002 < np.abs(reached.angles - angles).max() <= 0.002
    there, turned = controller.tool_pose(reached.angles)
    moved = there - position
    assert 0.0 < moved @ way < way @ way
    np.testing.assert_allclose(np.cross(moved, way) / np.linalg.norm(way), 0.0, atol=1e-8)
    np.testing.assert_allclose(turned, rotation, atol=1e-7)


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("name", ARMS)
def test_a_tool_at_its_limits_of_speed_does_not_drift_sideways(name, axis):
    # as the rate mode does it: each tick starts from the pose reached, so that what goes astray would add up
    arm = load_arm(name)
    controller, _ = solver(name)
    limits = 0.02 * arm.velocity_limits
    rates = DampedRates(controller, lower=arm.description.lower, upper=arm.description.upper, step=limits)
    angles = arm.pose(arm.description.operating_pose)
    position, rotation = start = controller.tool_pose(angles)
    twist = np.zeros(6)
    # the tool is asked to move 5 m/s or to turn 5 rad/s
    twist[axis] = 0.1
    ticks = 0
    for _ in range(8):
        reached = rates.follow(angles, position + rotation @ twist[:3], rotation @ pin.exp3(twist[3:]))
        if reached.singular or reached.joint_limited:
            break
        ticks += 1
        assert reached.velocity_limited
        assert np.abs((reached.angles - angles) / limits).max() == pytest.approx(1.0, abs=0.1)
        assert (np.abs(reached.angles - angles) <= limits).all()
        angles = reached.angles
        position, rotation = controller.tool_pose(angles)
        moved = np.concatenate([start[1].T @ (position - start[0]), pin.log3(start[1].T @ rotation)])
        assert moved[axis] > 0.0
        np.testing.assert_allclose(np.delete(moved, axis), 0.0, atol=1e-6)
    assert ticks >= 3


@pytest.mark.parametrize("name", ["panda", "xarm7"])
def test_the_other_joints_take_up_what_one_at_its_end_cannot(name):
    arm = load_arm(name)
    controller, _ = solver(name)
    # off the planes of symmetry, where seven joints can do without any of them
    angles = arm.pose(arm.description.operating_pose) + 0.3 * np.array([1, 1, -1, 1, 1, -1, 1])
    position, rotation = controller.tool_pose(angles)
    wanted = position + rotation @ np.array([0.01, -0.01, 0.01])
    free = DampedRates(
        controller, lower=arm.description.lower, upper=arm.description.upper, step=np.full(len(angles), np.inf)
    )
    change = free.follow(angles, wanted, rotation).angles - angles
    moved = 0
    # each joint in turn may go half the way that it would
    for joint in range(len(angles)):
        lower, upper = arm.description.lower.copy(), arm.description.upper.copy()
        if abs(change[joint]) < 1e-6:
            continue
        (upper if change[joint] > 0.0 else lower)[joint] = angles[joint] + 0.5 * change[joint]
        step = np.full(len(angles), np.inf)
        reached = DampedRates(controller, lower=lower, upper=upper, step=step).follow(angles, wanted, rotation)
        there, turned = controller.tool_pose(reached.angles)
        error = np.concatenate([turned.T @ (wanted - there), 0.3 * pin.log3(turned.T @ rotation)])
        if not reached.joint_limited:
            np.testing.assert_allclose(error, 0.0, atol=1e-8)
        # as near as it can within the ranges: the others are at rest, and those at their ends would go on
        slope = (np.diag([1, 1, 1, 0.3, 0.3, 0.3]) @ controller.tool_jacobian(reached.angles)).T @ error
        high, low = reached.angles > upper - 1e-9, reached.angles < lower + 1e-9
        assert np.abs(slope[~(high | low)]).max() < 1e-6
        assert (slope[high] > -1e-6).all() and (slope[low] < 1e-6).all()
        moved += not reached.joint_limited
    # seven joints mostly do without one
    assert moved >= 3


def test_steps_within_bounds_are_the_least_squares_within_them():
    rng = np.random.default_rng(4)
    for _ in range(50):
        jacobian, error = rng.standard_normal((6, 7)), rng.standard_normal(6)
        lower, upper = -rng.uniform(0.01, 0.5, 7), rng.uniform(0.01, 0.5, 7)
        step, damping = step_within_bounds(jacobian, error, lower, upper)
        assert (step >= lower).all() and (step <= upper).all()
        slope = jacobian.T @ (error - jacobian @ step) - damping**2 * step
        inside = (step > lower) & (step < upper)
        assert np.abs(slope[inside]).max(initial=0.0) < 1e-9
        assert (slope[step == upper] >= 0).all() and (slope[step == lower] <= 0).all()


@pytest.mark.parametrize("name", ARMS)
def test_beyond_its_reach_the_arm_stretches_out_and_rests(name):
    arm = load_arm(name)
    controller, _ = solver(name)
    limits = 0.02 * arm.velocity_limits
    rates = DampedRates(controller, lower=arm.description.lower, upper=arm.description.upper, step=limits)
    angles = arm.pose(arm.description.operating_pose)
    position, rotation = controller.tool_pose(angles)
    far = position + np.array([2.0, 0.0, 0.0])
    distances = []
    for _ in range(600):
        reached = rates.follow(angles, far, rotation)
        motion, angles = np.abs(reached.angles - angles).max(), reached.angles
        there, turned = controller.tool_pose(angles)
        distances.append(np.linalg.norm(np.concatenate([far - there, 0.3 * pin.log3(turned.T @ rotation)])))
    # nearer with every tick, then at rest, and it says why
    assert np.diff(distances).max() < 1e-9
    assert motion < 0.02 * limits.min()
    assert reached.singular or reached.joint_limited


def test_an_arm_of_three_joints_comes_as_near_as_it_can(tmp_path):
    from tests.user_arm import write_arm

    arm = load_arm(str(write_arm(tmp_path)))
    controller, rates = solver(arm.variant)
    angles = arm.pose(arm.description.operating_pose)
    position, rotation = controller.tool_pose(angles)
    reached = rates.follow(angles, position + np.array([0.0, 0.0, 0.01]), rotation)
    # it cannot hold the orientation, and says that the tool does not move as asked
    assert reached.singular
    assert 0.002 < controller.tool_pose(reached.angles)[0][2] - position[2] < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["cartesian", "cartesian_rate"])
@pytest.mark.parametrize("name", ["panda", "ur10"])
def test_the_simulated_tool_moves_along_the_axis_of_the_stick(name, mode):
    description = arm_named(name)
    excitation = (Excitation("sine", {"frequency": 0.5, "amplitude": 2.0}),)
    scenario = Scenario(
        "tool", ("x",), excitation, duration=8.0, mode=mode, variant=name, payload=description.tuned_payload,
        pose=description.operating_pose,
    )  # fmt: skip
    stick = replace(scenario.hand_controller, translation_gain=0.01, translation_rate_gain=0.03, noise=0.0, bias=0.0)
    (log,) = simulate([replace(scenario, hand_controller=stick)])
    arm = load_arm(name)
    positions, rotations = arm.controller.tool_path(log.true_angles)
    settled = slice(100, None)
    along = (positions - positions[0]) @ rotations[0]
    reach = np.ptp(along[settled, 0])
    assert reach > 0.01
    # bus, servo and friction differ from joint to joint: a tenth of the motion goes astray, mostly less
    assert np.ptp(along[settled, 1:], axis=0).max() < 0.1 * reach
    turns = [np.linalg.norm(pin.log3(rotations[0].T @ rotation)) for rotation in rotations[settled]]
    assert max(turns) < 0.3 * reach
    # the commands themselves are straight
    commanded, held = arm.controller.tool_path(log.commanded)
    straight = (commanded - commanded[0]) @ held[0]
    assert np.abs(straight[:, 1:]).max() < 1e-4


def test_what_is_no_pose_is_refused():
    controller, rates = solver("ur10")
    angles = load_arm("ur10").pose("ready")
    position, rotation = controller.tool_pose(angles)
    refused("expected finite numbers", rates.follow, angles, position * np.nan, rotation)
    refused("one per joint", DampedRates, controller, lower=np.zeros(5), upper=np.ones(6), step=np.ones(6))
    refused("steps above zero", DampedRates, controller, lower=np.zeros(6), upper=np.ones(6), step=np.zeros(6))
