"""MuJoCo against Pinocchio: a second implementation of the rigid-body dynamics."""

import re
import xml.etree.ElementTree as ET
from copy import copy
from importlib.metadata import distribution
from itertools import product
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from hmtb_twin import JOINTS, PAYLOADS, VARIANTS, load_arm
from hmtb_twin.parameters.resources import model_file

STATES = 100


def agree(model, peer):
    data, scratch = mujoco.MjData(model), peer.createData()
    rng = np.random.default_rng(0)
    n = model.nv
    # Joint constraints (coupled fingers) are no part of the rigid-body dynamics.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    for _ in range(STATES):
        q, v, a = rng.uniform(-2, 2, n), rng.uniform(-2, 2, n), rng.uniform(-5, 5, n)
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mass = np.empty((n, n))
        for row, unit in zip(mass, np.eye(n), strict=True):
            mujoco.mj_mulM(model, data, row, unit)
        upper = np.triu(pin.crba(peer, scratch, q))
        close(mass, upper + np.triu(upper, 1).T)
        close(data.qfrc_bias, pin.nonLinearEffects(peer, scratch, q, v))
        torque = np.empty(n)
        mujoco.mj_rne(model, data, 1, torque)
        close(torque + model.dof_armature * a, pin.rnea(peer, scratch, q, v, a))


def close(ours, theirs, relative=1e-12):
    difference, size = float(np.abs(ours - theirs).max()), float(np.abs(theirs).max())
    assert difference <= relative * size


ARMS = pytest.mark.parametrize(("variant", "payload"), list(product(VARIANTS, PAYLOADS)))


def rigid(variant, payload):
    """An arm's bodies alone, without drives, drag and constraints, and the controller's own model of them."""
    arm = load_arm(variant, payload)
    model, flags = copy(arm.model), mujoco.mjtDisableBit
    for flag in (flags.mjDSBL_CONSTRAINT, flags.mjDSBL_ACTUATION, flags.mjDSBL_DAMPER, flags.mjDSBL_SPRING):
        model.opt.disableflags |= flag
    model.dof_armature[0] = arm.drives["shoulder_roll"].motor.armature
    return model, arm.controller._model


def moving(peer, count=STATES):
    """Random angles, rad, velocities, rad/s, and the torques, N m, of random accelerations."""
    rng, n, scratch = np.random.default_rng(1), peer.nv, peer.createData()
    drawn = [(rng.uniform(-3, 3, n), rng.uniform(-2, 2, n), rng.uniform(-5, 5, n)) for _ in range(count)]
    return [(q, v, pin.rnea(peer, scratch, q, v, a).copy()) for q, v, a in drawn]


def acceleration(model, data, q, v, t):
    data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, v, t
    mujoco.mj_forward(model, data)
    return data.qacc.copy()


def test_every_arm():
    path = str(model_file("hmtb/hmtb.xml"))
    written, peer = mujoco.MjModel.from_xml_path(path), pin.buildModelFromMJCF(path)
    # Beside the inertia of the pin nothing else would show.
    written.dof_armature[0] = peer.armature[0] = 0.0
    agree(written, peer)
    for variant, payload in product(VARIANTS, PAYLOADS):
        agree(*rigid(variant, payload))


@pytest.mark.slow
@ARMS
def test_kinematics(variant, payload):
    arm = load_arm(variant, payload)
    model, peer = rigid(variant, payload)
    data, scratch = mujoco.MjData(model), peer.createData()
    tool, bodies = model.site("tool").id, [int(model.joint(name).bodyid[0]) for name in JOINTS]
    assert list(peer.names)[1:] == list(JOINTS)
    for q, v, _ in moving(peer):
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_fwdPosition(model, data)
        pin.forwardKinematics(peer, scratch, q)
        close(data.xpos[bodies], np.array([placed.translation for placed in scratch.oMi[1:]]))
        close(data.xmat[bodies].reshape(-1, 3, 3), np.array([placed.rotation for placed in scratch.oMi[1:]]))
        position, rotation = arm.controller.tool_pose(q)
        for one, many in zip((position, rotation), arm.controller.tool_path(np.array([q, q])), strict=True):
            np.testing.assert_array_equal([one, one], many)
        close(data.site_xpos[tool], position)
        close(data.site_xmat[tool].reshape(3, 3), rotation)
        linear, angular = np.empty((3, model.nv)), np.empty((3, model.nv))
        mujoco.mj_jacSite(model, data, linear, angular, tool)
        local = arm.controller.tool_jacobian(q)
        close(linear, rotation @ local[:3])
        close(angular, rotation @ local[3:])
        mujoco.mj_energyVel(model, data)
        # By its mass matrix: Pinocchio's own kinetic energy is wrong where rotors turn.
        close(data.energy[1], 0.5 * v @ arm.controller.inertia_matrix(q) @ v)


@pytest.mark.slow
@ARMS
def test_accelerations_and_their_derivatives(variant, payload):
    """Derivatives by differences of eighth order and by the engine's own."""
    model, peer = rigid(variant, payload)
    data, scratch = mujoco.MjData(model), peer.createData()
    for q, v, torque in moving(peer):
        # The wrist roll's inertia is a hundredth of the shoulder's: accelerations carry that condition number.
        close(acceleration(model, data, q, v, torque), pin.aba(peer, scratch, q, v, torque), 1e-10)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    n, h = model.nv, model.opt.timestep
    A = np.empty((2 * n + model.na,) * 2)
    # Truncation and rounding are both near 1e-12 at this step.
    weights, reach = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}, 0.004
    for q, v, torque in moving(peer, 10):
        pin.computeABADerivatives(peer, scratch, q, v, torque)
        inverse = np.triu(scratch.Minv)
        exact = np.hstack([scratch.ddq_dq, scratch.ddq_dv, inverse + np.triu(inverse, 1).T])
        at, sizes = np.concatenate([q, v, torque]), np.repeat([1.0, 1.0, 1e3], n) * reach
        slope = np.zeros_like(exact)
        for k, weight in weights.items():
            for j, size in enumerate(sizes):
                for sign in (1, -1):
                    moved = at + sign * k * size * np.eye(3 * n)[j]
                    slope[:, j] += sign * weight / size * acceleration(model, data, *np.split(moved, 3))
        for block in range(0, 3 * n, n):
            close(slope[:, block : block + n], exact[:, block : block + n], 1e-10)
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, v, torque
        mujoco.mjd_transitionFD(model, data, 1e-5, True, A, None, None, None)
        close(A[n : 2 * n, :n] / h, scratch.ddq_dq, 1e-6)
        close((A[n : 2 * n, n : 2 * n] - np.eye(n)) / h, scratch.ddq_dv, 1e-6)


def test_panda(tmp_path):
    """The Panda of example-robot-data without its meshes, which the dynamics do not need."""
    files = distribution("example-robot-data").files or []
    urdf = next(Path(str(file.locate())) for file in files if str(file).endswith("panda_description/urdf/panda.urdf"))
    tree = ET.fromstring(re.sub(r"<\?xml[^>]*\?>", "", urdf.read_text()))
    for link in tree.iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    options = ET.SubElement(tree, "mujoco")
    ET.SubElement(options, "compiler", fusestatic="false", balanceinertia="false")
    path = tmp_path / "panda.urdf"
    path.write_bytes(ET.tostring(tree))
    model, peer = mujoco.MjModel.from_xml_path(str(path)), pin.buildModelFromUrdf(str(path))
    names = [model.joint(i).name for i in range(model.njnt)]
    assert names == list(peer.names)[1:]
    assert model.nv >= 7
    agree(model, peer)
