"""The URDF of the test bed is made from its MJCF, and describes the same arm."""

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from hmtb_twin import JOINTS, VARIANTS, load_arm
from hmtb_twin.arm.urdf import PLACE, hmtb_urdf, urdf_text
from hmtb_twin.parameters.resources import model_file
from tests.refusals import refused


def test_the_file_is_what_the_command_writes():
    """Where this fails: python -m hmtb_twin.arm.urdf."""
    assert model_file(PLACE).read_text(encoding="utf-8") == hmtb_urdf()


def test_both_files_are_one_arm():
    peer = pin.buildModelFromUrdf(str(model_file(PLACE)))
    assert tuple(peer.names[1:]) == JOINTS
    model = mujoco.MjModel.from_xml_path(str(model_file("hmtb/hmtb.xml")))
    data, scratch = mujoco.MjData(model), peer.createData()
    tool = peer.getFrameId("tool")
    rng = np.random.default_rng(4)
    for _ in range(50):
        q, v = rng.uniform(-2, 2, 7), rng.uniform(-2, 2, 7)
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mass = np.empty((7, 7))
        for row, unit in zip(mass, np.eye(7), strict=True):
            mujoco.mj_mulM(model, data, row, unit)
        # The pin's armature is no part of the bodies, and URDF has none.
        mass -= np.diag(model.dof_armature)
        upper = np.triu(pin.crba(peer, scratch, q))
        theirs = upper + np.triu(upper, 1).T
        # The armature of the pin, 1e6 kg m2, leaves rounding of 1e-10 in the first number.
        np.testing.assert_allclose(mass, theirs, atol=1e-9 * np.abs(theirs).max())
        bias = pin.nonLinearEffects(peer, scratch, q, v)
        np.testing.assert_allclose(data.qfrc_bias, bias, atol=1e-9 * np.abs(bias).max())
        pin.framesForwardKinematics(peer, scratch, q)
        np.testing.assert_allclose(scratch.oMf[tool].translation, data.site("tool").xpos, atol=1e-9)
        np.testing.assert_allclose(scratch.oMf[tool].rotation.ravel(), data.site("tool").xmat, atol=1e-9)


def test_limits_are_those_of_the_arm_and_shapes_are_primitives():
    root = ET.fromstring(hmtb_urdf())
    arm = VARIANTS["nominal"]
    for joint in root.iter("joint"):
        if joint.get("type") != "revolute":
            continue
        limit, name = joint.find("limit"), joint.get("name")
        assert float(limit.get("lower")) == pytest.approx(arm.motions[name].lower)
        assert float(limit.get("velocity")) == pytest.approx(arm.motions[name].velocity_limit)
        assert float(limit.get("effort")) == pytest.approx(arm.actuators[name].motor.maximum_torque)
    shapes = {shape.tag for geometry in root.iter("geometry") for shape in geometry}
    assert shapes == {"box", "cylinder", "sphere"}
    # What is seen, and the simpler shapes that touch; a capsule is a cylinder and two spheres.
    assert len(list(root.iter("visual"))) > 40
    assert 30 < len(list(root.iter("collision"))) < 60
    links = [link for link in root.iter("link") if link.find("visual") is not None]
    assert all(link.find("collision") is not None for link in links)


def test_mujoco_reads_it_and_so_does_the_reader_of_other_arms():
    path = str(model_file(PLACE))
    model = mujoco.MjModel.from_xml_path(path)
    assert model.nv == len(JOINTS)
    arm = load_arm(path)
    assert arm.joints == JOINTS
    # What a URDF leaves out is assumed, and said to be.
    assert {row.parameter for row in arm.description.assumed} >= {"armature", "bandwidth"}


def test_what_urdf_cannot_hold_is_refused():
    body = '<body name="a"><joint name="j" type="slide"/><geom size="1"/></body>'
    slide = f"<mujoco><worldbody>{body}</worldbody></mujoco>"
    refused("other joints than one hinge", urdf_text, mujoco.MjModel.from_xml_string(slide), VARIANTS["nominal"])
    plane = '<mujoco><worldbody><geom type="plane" size="1 1 1"/></worldbody></mujoco>'
    refused("a shape of type mjGEOM_PLANE", urdf_text, mujoco.MjModel.from_xml_string(plane), VARIANTS["nominal"])
