from dataclasses import replace
from itertools import product
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from hmtb_twin import JOINTS, POSES, VARIANTS, linearize, load_arm
from hmtb_twin.arm.arm_model import servo_gains
from hmtb_twin.arm.rendering import scene_model
from hmtb_twin.parameters.resources import model_file
from hmtb_twin.parameters.variants import ACTUATORS, LINKS, MOTIONS, PAYLOADS, SERVOS
from tests.hmtb_twin.altered_arms import LOWER, UPPER
from tests.refusals import refused


@pytest.fixture(scope="module")
def written():
    return mujoco.MjModel.from_xml_path(str(model_file("hmtb/hmtb.xml")))


def test_model_file_holds_the_numbers_of_the_parameters(written, arm):
    assert tuple(written.joint(i).name for i in range(written.njnt)) == JOINTS
    np.testing.assert_allclose(written.jnt_range, [[MOTIONS[j].lower, MOTIONS[j].upper] for j in JOINTS], rtol=1e-7)
    body = ("body_mass", "body_inertia", "body_ipos", "body_pos")
    for field in (*body, "jnt_range"):
        np.testing.assert_allclose(getattr(written, field), getattr(arm.model, field), rtol=1e-7, atol=1e-12)
    # The file has a constraint for a pin, the laboratory a stiff spring.
    drags = [arm.drives[name].drag for name in JOINTS]
    np.testing.assert_allclose(written.dof_damping, drags, rtol=1e-7)
    np.testing.assert_allclose(written.dof_damping[1:], arm.model.dof_damping[1:], rtol=1e-7)
    for field in ("jnt_stiffness", "dof_armature"):
        assert not getattr(written, field).any()
        assert not getattr(arm.model, field)[1:].any()


def test_model_file_holds_drives_like_those_of_the_parameters(arm):
    root = ElementTree.parse(model_file("hmtb/hmtb.xml")).getroot()
    written = {str(motor.get("name")): motor for motor in root.iter("dcmotor")}
    assert tuple(written) == JOINTS
    for name, drive in arm.drives.items():
        motor, gains, friction, dry = drive.motor, arm.gains[name], drive.friction, drive.coulomb_torque
        # The viewer's drives ask for a torque, in which compressed oil damps the joint by the rest of the load flow.
        damping = gains.kd + (1.0 - gains.compensated) * motor.constant**2 / motor.resistance
        expected = {
            "motorconst": [motor.constant],
            "resistance": [motor.resistance],
            "inductance": [motor.inductance, 0.0],
            "saturation": [motor.maximum_torque, 0.0, 0.0],
            "controller": [gains.kp, 0.0, damping, 0.0, 0.0, motor.largest_input],
            "lugre": [
                *friction.bristles(dry, drive.drag),
                *(dry, friction.static_ratio * dry, friction.stribeck_velocity),
            ],
        }
        for key, numbers in expected.items():
            np.testing.assert_allclose([float(x) for x in written[name].get(key).split()], numbers, rtol=1e-8)


def test_inertials_are_those_of_the_links_and_the_payload(written):
    chain = [written.body(written.joint(name).bodyid[0]) for name in JOINTS] + [written.body("end_effector")]
    for body, link in zip(chain, LINKS.values(), strict=True):
        inertia = [link.axial_inertia, link.transverse_inertia, link.transverse_inertia]
        np.testing.assert_allclose(np.sort(body.inertia), np.sort(inertia), rtol=1e-7)
        np.testing.assert_allclose(body.ipos, [link.length / 2, 0, 0], rtol=1e-7)
    for body, part in (*zip(chain, LINKS.values(), strict=True), (written.body("rpcm"), PAYLOADS["rpcm"])):
        assert body.mass[0] == pytest.approx(part.mass)
    np.testing.assert_allclose(np.sort(body.inertia), np.sort(part.inertia), rtol=1e-7)


def test_chain_has_the_published_reach_and_the_operating_pose_is_far_from_limits_and_singularities(written):
    data, angles = mujoco.MjData(written), np.array(POSES["rpcm_holster_out_approach"])
    mujoco.mj_forward(written, data)
    reach = np.linalg.norm(data.site("tool").xpos - data.body("upper_arm").xpos)
    assert reach == pytest.approx(1.67, abs=1e-9)
    margin = np.minimum(angles - written.jnt_range[:, 0], written.jnt_range[:, 1] - angles)
    assert np.degrees(margin.min()) > 30.0
    data.qpos[:] = angles
    mujoco.mj_forward(written, data)
    jacobian = np.empty((6, 7))
    mujoco.mj_jacSite(written, data, jacobian[:3], jacobian[3:], written.site("tool").id)
    # The roll is indexed: six joints move the tool.
    assert np.linalg.cond(jacobian[:, 1:]) < 10.0


def test_keyframes_hold_the_arm_under_gravity(written):
    data = mujoco.MjData(written)
    for name, angles in POSES.items():
        mujoco.mj_resetDataKeyframe(written, data, written.key(name).id)
        np.testing.assert_allclose(data.qpos, angles, rtol=1e-8, atol=1e-12)
        for _ in range(100):
            mujoco.mj_step(written, data, nstep=100)
            assert np.degrees(np.abs(data.qpos - angles).max()) < 0.01, name
            # The pin holds, and nothing touches but what a user puts in the way.
            assert abs(data.qpos[0]) < 1e-5
            assert data.ncon == 0
        assert not any(warning.number for warning in data.warning)


def test_shapes_of_the_model_file_touch_each_other_where_the_arm_folds(written):
    data = mujoco.MjData(written)
    visual, collision = (written.geom_group == group for group in (2, 3))
    assert visual.sum() + collision.sum() == written.ngeom
    assert (written.geom_contype[visual] == 0).all() and (written.geom_contype[collision] == 1).all()
    # Shapes that collide lie within those that are seen, body by body.
    assert set(written.geom_bodyid[collision]) == set(written.geom_bodyid[visual])
    rng = np.random.default_rng(0)
    free, touched = 0, set()
    for _ in range(300):
        data.qpos[:] = rng.uniform(written.jnt_range[:, 0], written.jnt_range[:, 1])
        data.qpos[0] = 0.0
        mujoco.mj_forward(written, data)
        free += data.ncon == 0
        touched |= {written.body(written.geom_bodyid[contact.geom1]).name for contact in data.contact}
    # Most poses are free, and not all.
    assert 150 < free < 300
    assert {"world", "upper_arm"} <= touched


def test_the_laboratory_keeps_its_own_pin_drives_and_contact(arm):
    assert arm.model.ngeom == 0
    assert arm.model.neq == 0
    assert arm.model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT
    worksite = load_arm(worksite=True).model
    assert not (worksite.geom_group == 3).any()
    assert worksite.neq == 1


def test_noise_over_the_control_range_raises_no_engine_warning(arm):
    rng = np.random.default_rng(0)
    data = arm.rest(arm.pose("home"))
    for _ in range(200):
        data.ctrl[0::2] = rng.uniform(LOWER, UPPER)
        data.ctrl[1::2] = rng.uniform(-1, 1, 7) * [ACTUATORS[name].maximum_torque for name in JOINTS]
        mujoco.mj_step(arm.model, data, nstep=50)
    assert not any(warning.number for warning in data.warning)
    assert np.isfinite(data.qpos).all()
    # The shoulder roll is locked at its index.
    data = arm.rest(arm.pose("rpcm_holster_out_approach"))
    data.ctrl[2] += 0.5
    mujoco.mj_step(arm.model, data, nstep=2000)
    assert abs(data.qpos[1] - POSES["rpcm_holster_out_approach"][1]) > 0.4
    assert abs(data.qpos[0]) < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("payload", PAYLOADS)
def test_every_arm_holds_every_payload_and_stays_stable(payload):
    slowest = {}
    for variant, name in product(VARIANTS, POSES):
        loaded = load_arm(variant, payload)
        largest, angles = [loaded.drives[joint].maximum_torque for joint in JOINTS], loaded.pose(name)
        # A quarter of the torque is left to move with.
        assert (np.abs(loaded.controller.gravity_torque(angles[None])[0]) < 0.75 * np.array(largest)).all()
        data = loaded.rest(angles)
        mujoco.mj_step(loaded.model, data, nstep=1000)
        assert np.abs(data.qpos - angles).max() < 1e-9
        truth = linearize(loaded, angles, amplitudes=())
        slowest[variant, name] = np.sort(np.abs(truth.model.poles()))[::-1]
        assert slowest[variant, name][0] < 0.985
        for joint in JOINTS[1:]:
            # The finite differences see the weight's slope to a millionth of the servo's stiffness.
            assert truth.joint(joint).dc_gain == pytest.approx(1.0, abs=1e-5)
    for name in POSES:
        own = slowest["published", name]
        assert own[0] < 0.981
        # But for the yaw's it is hardly slower than the nominal arm.
        assert own[1] < slowest["nominal", name][0] + 0.01


def test_payload_follows_in_plant_controller_and_pictures(arm):
    for name, payload in PAYLOADS.items():
        loaded = load_arm(payload=name)
        assert loaded.gains == arm.gains
        if payload is None:
            assert loaded.model.body_mass.sum() == pytest.approx(arm.model.body_mass.sum() - 4.1)
            for body in (loaded.model.body("rpcm"), scene_model(loaded).body("rpcm")):
                assert (body.mass[0], body.geomnum[0]) == (0.0, 0)
            continue
        body = loaded.model.body("rpcm")
        assert body.mass[0] == pytest.approx(payload.mass)
        np.testing.assert_allclose(np.sort(body.inertia), np.sort(payload.inertia), rtol=1e-7)
        np.testing.assert_allclose(body.ipos, [payload.size[0] / 2, 0.0, 0.0], atol=1e-12)
        box = scene_model(loaded).geom_size[scene_model(loaded).body("rpcm").geomadr[0]]
        np.testing.assert_allclose(2.0 * box, payload.size)
        # The plant's weight is the one that the controller feeds forward.
        data = loaded.rest(loaded.pose("home"))
        fed_forward = loaded.controller.gravity_torque(loaded.pose("home")[None])[0]
        np.testing.assert_allclose(data.qfrc_bias, fed_forward, atol=1e-9)


def test_impossible_arms_are_refused(arm):
    for payload in ("ballast", "mdm"):
        refused(f"'{payload}' at the worksite given, expected rpcm or none", load_arm, payload=payload, worksite=True)
    refused(r"'nowhere'.*home", arm.pose, "nowhere")
    # However much oil, a load-pressure loop shortens its lag; that of a slow loop cannot be.
    slow = replace(SERVOS["elbow_pitch"], torque_lag=0.05)
    sluggish = replace(ACTUATORS["elbow_pitch"], trapped_volume=60_000.0)
    refused("third pole", servo_gains, 3.0, slow, sluggish)
    fast = replace(SERVOS["elbow_pitch"], slow_pole=-40.0)
    refused("expected above 0", servo_gains, 30.0, fast, ACTUATORS["elbow_pitch"], "flow")
