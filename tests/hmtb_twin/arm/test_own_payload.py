"""A payload of one's own: its text, its physics against Pinocchio, and what is refused."""

from copy import copy

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from hmtb_twin import Load, linearize, load_arm
from hmtb_twin.arm.rendering import scene_model
from hmtb_twin.parameters.payloads import Payload, load_of
from hmtb_twin.parameters.variants import PAYLOADS
from tests.refusals import refused

ODD = Load(3.7, (0.11, -0.02, 0.05), (0.021, 0.034, 0.027, 0.004, -0.002, 0.003))


def appended(model, load):
    """Pinocchio's model of the bare arm with one more body at the tool."""
    frame = model.frames[model.getFrameId("tool")]
    xx, yy, zz, xy, xz, yz = load.inertia
    moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    peer = pin.Model(model)
    peer.appendBodyToJoint(frame.parentJoint, pin.Inertia(load.mass, np.array(load.centre), moments), frame.placement)
    return peer


@pytest.mark.parametrize(("variant", "joints"), [("nominal", 7), ("panda", 7), ("ur10", 6)])
def test_mass_matrix_and_weight_are_those_of_the_arm_with_one_more_body(variant, joints):
    arm = load_arm(variant, ODD)
    model = copy(arm.model)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    peer = appended(load_arm(variant, "none").controller._model, ODD)
    data, scratch = mujoco.MjData(model), peer.createData()
    rng = np.random.default_rng(3)
    for _ in range(20):
        q, v = rng.uniform(-2, 2, joints), rng.uniform(-2, 2, joints)
        data.qpos[:joints], data.qvel[:joints] = q, v
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mass = np.empty((model.nv, model.nv))
        for row, unit in zip(mass, np.eye(model.nv), strict=True):
            mujoco.mj_mulM(model, data, row, unit)
        upper = np.triu(pin.crba(peer, scratch, q))
        theirs = upper + np.triu(upper, 1).T
        # The rotors: the pin of the test bed has an armature of its own.
        ours = mass[:joints, :joints] - np.diag(model.dof_armature[:joints])
        np.testing.assert_allclose(ours, theirs - np.diag(peer.armature), atol=1e-9 * np.abs(theirs).max())
        bias = pin.nonLinearEffects(peer, scratch, q, v)
        np.testing.assert_allclose(data.qfrc_bias[:joints], bias, atol=1e-9 * np.abs(bias).max())
    # The controller knows the payload, and feeds its weight forward.
    knows = arm.controller._model
    np.testing.assert_allclose(
        pin.computeGeneralizedGravity(knows, knows.createData(), q),
        pin.computeGeneralizedGravity(peer, scratch, q),
        atol=1e-9,
    )


def test_a_text_is_read_back_to_the_bit_and_equal_ones_are_one_arm():
    assert load_of(ODD.text) == ODD
    assert load_of("mass=2") == Load(2.0, (0.0,) * 3, (0.0,) * 6)
    assert load_arm(payload=ODD) is load_arm(payload=ODD.text)
    assert load_of("inertia=0.1,0.1,0.1 mass=2").inertia == (0.1, 0.1, 0.1, 0.0, 0.0, 0.0)


def test_the_box_of_a_named_payload_is_the_same_arm():
    named = PAYLOADS["ballast"]
    assert isinstance(named, Payload)
    own = Load(named.mass, (named.size[0] / 2, 0.0, 0.0), (*named.inertia, 0.0, 0.0, 0.0))
    ours, theirs = (linearize(load_arm(payload=payload), amplitudes=()) for payload in (own, "ballast"))
    for joint in ("shoulder_yaw", "elbow_pitch", "wrist_roll"):
        assert ours.joint(joint).bandwidth_hz == pytest.approx(theirs.joint(joint).bandwidth_hz, rel=1e-9)
    # drawn as large as the box that it is
    drawn, known = (scene_model(load_arm(payload=payload)) for payload in (own, "ballast"))
    body = known.body("rpcm").id
    sizes = [model.geom_size[model.body_geomadr[body]] for model in (drawn, known)]
    np.testing.assert_allclose(np.sort(sizes[0]), np.sort(sizes[1]), rtol=1e-9)


@pytest.mark.parametrize(
    ("payload", "says"),
    [
        ("mass=-1", "-1 kg given, expected a mass above 0"),
        ("mass=nan", "finite numbers"),
        ("mass=two", "all numbers"),
        ("mass=2 center=0,0,1", "'center=0,0,1' is none of it"),
        ("mass=2 mass=3", "'mass=3' is none of it"),
        ("mass=2 centre=0,0", "2 of centre"),
        ("mass=2 inertia=1,1,3", "none above the sum of the others"),
        ("mass=2 inertia=1,1,-0.1", "none below 0"),
        ("weight=2", "unknown payload 'weight=2'.*one of your own, mass=KG"),
    ],
)
def test_what_is_no_payload_is_one_line(payload, says):
    refused(says, load_arm, payload=payload)
    refused("at the worksite given, expected rpcm or none", load_arm, payload="mass=2", worksite=True)
