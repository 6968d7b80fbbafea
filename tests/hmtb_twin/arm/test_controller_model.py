"""The controller's kinematics against MuJoCo's."""

import mujoco
import numpy as np
import pytest

from hmtb_twin import load_arm

TOLERANCE = 1e-12


@pytest.mark.parametrize("payload", ["rpcm", "none"])
def test_tool_and_its_jacobian_are_those_of_mujoco(payload):
    arm = load_arm(payload=payload)
    data, site = mujoco.MjData(arm.model), arm.model.site("tool").id
    rng = np.random.default_rng(0)
    for angles in rng.uniform(-3.0, 3.0, (100, 7)):
        data.qpos[:] = angles
        mujoco.mj_kinematics(arm.model, data)
        mujoco.mj_comPos(arm.model, data)
        linear, angular = np.empty((3, 7)), np.empty((3, 7))
        mujoco.mj_jacSite(arm.model, data, linear, angular, site)
        axes = data.site_xmat[site].reshape(3, 3)
        position, rotation = arm.controller.tool_pose(angles)
        assert np.abs(position - data.site_xpos[site]).max() < TOLERANCE
        assert np.abs(rotation - axes).max() < TOLERANCE
        assert (
            np.abs(arm.controller.tool_jacobian(angles) - np.vstack([axes.T @ linear, axes.T @ angular])).max()
            < TOLERANCE
        )


def test_jacobian_is_the_derivative_of_the_pose(arm):
    angles, rate = np.random.default_rng(1).uniform(-1.0, 1.0, (2, 7))
    step = 1e-6
    (before, turned), (after, turned_on) = (arm.controller.tool_pose(angles + s * step * rate) for s in (-1, 1))
    _, rotation = arm.controller.tool_pose(angles)
    spin = rotation.T @ (turned_on - turned) / (2 * step)
    velocity = np.concatenate([rotation.T @ (after - before) / (2 * step), [spin[2, 1], spin[0, 2], spin[1, 0]]])
    assert velocity == pytest.approx(arm.controller.tool_jacobian(angles) @ rate, abs=1e-8)


def test_path_is_the_poses_one_by_one(arm):
    angles = np.random.default_rng(2).uniform(-2.0, 2.0, (50, 7))
    positions, rotations = arm.controller.tool_path(angles)
    for row, position, rotation in zip(angles, positions, rotations, strict=True):
        expected = arm.controller.tool_pose(row)
        assert np.array_equal(position, expected[0])
        assert np.array_equal(rotation, expected[1])
