"""Unusual files of robots: read as MuJoCo means them, or refused in one line."""

import numpy as np
import pytest

from hmtb_twin import linearize, load_arm, simulate
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.control.modes import axis_gains
from hmtb_twin.parameters.values import HAND_CONTROLLER
from hmtb_twin.truth.logged_arm import logged_arm
from tests.refusals import refused
from tests.user_arm import write_arm

TWO = """<mujoco>{head}<worldbody><body name="{upper}" pos="0 0 0.5">
<joint name="{shoulder}" axis="0 1 0" range="-60 60" damping="0.8" {of_shoulder}/>
<geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.04"/>
<body name="{lower}" pos="0.4 0 0">{before}<joint name="elbow" axis="0 1 0" {elbow}/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/>{inside}</body></body></worldbody>{tail}</mujoco>"""

USUAL = {
    "head": "", "upper": "upper", "shoulder": "shoulder", "of_shoulder": "", "lower": "lower", "before": "",
    "elbow": 'range="-120 120"', "inside": "", "tail": "",
}  # fmt: skip

TENDON = '<tendon><fixed name="t" {}><joint joint="shoulder" coef="1"/><joint joint="elbow" coef="1"/></fixed></tendon>'


def mjcf(place, **changed):
    path = place / "two.xml"
    path.write_text(TWO.format(**{**USUAL, **changed}))
    return str(path)


def urdf(place, inside="", limit='lower="-1" upper="1" effort="20" velocity="2"'):
    link = (
        '<link name="{}"><inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>'
    )
    link += "</inertial></link>"
    path = place / "two.urdf"
    path.write_text(
        f'<robot name="r">{inside}{link.format("base")}{link.format("a")}<joint name="j" type="revolute">'
        f'<origin xyz="0.2 0 0"/><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>'
        f"<limit {limit}/></joint></robot>"
    )
    return str(path)


def test_gravity_that_a_flag_switches_off_is_off(tmp_path):
    arm = load_arm(mjcf(tmp_path, head='<option><flag gravity="disable"/></option>'))
    assert not arm.weight(np.zeros(2)).any()
    assert load_arm(mjcf(tmp_path)).weight(np.zeros(2)).any()


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"of_shoulder": 'stiffness="0 50"'}, "joint shoulder has a spring"),
        ({"elbow": 'damping="0.8 5"'}, "joint elbow has damping that grows with its speed"),
        ({"elbow": 'damping="-0.8"'}, "damping = -0.8 of joint elbow given, expected 0 or more"),
        ({"elbow": 'armature="-0.2"'}, "armature = -0.2 of joint elbow given, expected 0 or more"),
        ({"tail": TENDON.format('stiffness="50"')}, "tendon t has stiffness, expected none"),
        ({"tail": TENDON.format('frictionloss="20"')}, "tendon t has frictionloss, expected none"),
        ({"tail": TENDON.format("") + '<equality><tendon tendon1="t"/></equality>'}, "between tendons given"),
        ({"head": '<option gravity="0 0 -1e300"/>'}, "expected one along -z of at most 1000 m/s2"),
        ({"shoulder": "universe"}, "joint name universe given, expected another"),
        ({"head": '<include file="../outside.xml"/>'}, "which lies outside the folder of the model"),
        ({"inside": '<body><joint type="slide" range="0.1 0.2"/><geom size="0.01"/></body>'}, "a joint without a name"),
    ],
)  # fmt: skip
def test_what_an_arm_cannot_have_is_refused(tmp_path, changed, message):
    refused(message, load_arm, mjcf(tmp_path, **changed))


@pytest.mark.parametrize("name", ["tool", "payload", "wrist_sensor", "universe"])
def test_links_may_have_the_names_of_the_laboratory(tmp_path, name):
    usual, named = load_arm(mjcf(tmp_path)), load_arm(mjcf(tmp_path, lower=name))
    pose = np.array([0.2, 0.4])
    np.testing.assert_allclose(named.inertia(pose), usual.inertia(pose), rtol=1e-12)
    np.testing.assert_allclose(named.controller.tool_pose(pose)[0], usual.controller.tool_pose(pose)[0], atol=1e-12)


def test_a_joint_may_be_named_tool_or_as_an_axis_of_the_tool(tmp_path):
    assert load_arm(mjcf(tmp_path, shoulder="tool")).joints == ("tool", "elbow")
    gains = axis_gains("single_joint", ("x", "roll", "elbow"), HAND_CONTROLLER)
    assert gains.tolist() == [HAND_CONTROLLER.gain] * 3


def test_two_hinges_of_one_body_work(tmp_path):
    arm = load_arm(mjcf(tmp_path, before='<joint name="twist" axis="1 0 0" range="-30 30"/>'))
    assert arm.joints == ("shoulder", "twist", "elbow")
    assert linearize(arm, amplitudes=()).joint("twist").dc_gain == pytest.approx(1.0, abs=1e-6)


def test_a_joint_that_an_equality_fixes_is_held_there(tmp_path):
    fixed = '<equality><joint joint1="elbow" polycoef="0.3 0 0 0 0" active="{}"/></equality>'
    arm = load_arm(mjcf(tmp_path, tail=fixed.format("true")))
    assert arm.joints == ("shoulder",)
    assert any("elbow at 0.3" in remark for remark in arm.description.remarks)
    assert load_arm(mjcf(tmp_path, tail=fixed.format("false"))).joints == ("shoulder", "elbow")


def test_torque_limits_are_those_of_all_motors_on_their_smaller_side(tmp_path):
    one = '<motor joint="elbow" ctrlrange="-{} {}" gear="2"/>'
    for motors, limit in ((one.format(7, 12), 14.0), (one.format(10, 10) * 2, 40.0)):
        arm = arm_named(mjcf(tmp_path, tail=f"<actuator>{motors}</actuator>"))
        assert arm.actuators["elbow"].motor.maximum_torque == pytest.approx(limit)
    on_tendon = TENDON.format("") + '<actuator><motor name="m" tendon="t" ctrlrange="-9 9"/></actuator>'
    assert any(
        "act on no joint alone" in remark and "m" in remark
        for remark in arm_named(mjcf(tmp_path, tail=on_tendon)).remarks
    )


def test_a_floating_base_stays_where_the_file_puts_it(tmp_path):
    path = tmp_path / "floating.xml"
    path.write_text(
        '<mujoco><worldbody><body name="base" pos="0 0 1"><freejoint/><geom size="0.1"/>'
        '<body name="link" pos="0.1 0 0">'
        '<joint name="hinge" axis="0 1 0" range="-60 60"/><geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.04"/>'
        "</body></body></worldbody></mujoco>"
    )
    np.testing.assert_allclose(load_arm(str(path)).controller.tool_pose(np.zeros(1))[0], [0.1, 0.0, 1.0], atol=1e-12)


def test_an_end_of_a_range_that_a_urdf_leaves_out_is_zero(tmp_path):
    for limit, expected in (('upper="1"', (0.0, 1.0)), ('lower="-1"', (-1.0, 0.0))):
        motion = arm_named(urdf(tmp_path, limit=f'{limit} effort="20" velocity="2"')).motions["j"]
        assert (motion.lower, motion.upper) == expected


@pytest.mark.parametrize(
    ("limit", "message"),
    [
        ('lower="1" upper="-1" effort="5" velocity="1"', "range 1 to -1 given, expected a lower end below"),
        ('lower="nan" upper="1" effort="5" velocity="1"', "range nan to 1 given"),
        ('lower="-1" upper="1" effort="-50" velocity="1"', "effort = -50 of joint j given, expected 0 or more"),
        ('lower="-1" upper="1" effort="1e308" velocity="1"', r"j: effort = 1e\+308 given, expected 1e-06 to 1e\+07"),
        ('lower="-1" upper="1" effort="5" velocity="1e-300"', "j: velocity = 1e-300 given, expected 0.001 to 10000"),
    ],
)  # fmt: skip
def test_limits_that_cannot_be_are_refused(tmp_path, limit, message):
    refused(message, load_arm, urdf(tmp_path, limit=limit))


def test_other_things_in_a_urdf(tmp_path):
    xacro = '<xacro:include xmlns:xacro="http://www.ros.org/wiki/xacro" filename="a.xacro"/>'
    refused("macros of xacro given, expected the URDF that xacro makes", load_arm, urdf(tmp_path, xacro))
    deep = "<gazebo>" + "<a>" * 3000 + "</a>" * 3000 + "</gazebo>"
    assert load_arm(urdf(tmp_path, deep)).joints == ("j",)
    twice = '<link name="a"/>'
    refused("two links with the name 'a' given", load_arm, urdf(tmp_path, twice))
    broken = '<link name="b"><inertial><origin xyz="nan 0 0"/><mass value="1"/></inertial></link>'
    refused("<origin xyz='nan 0 0'> given, expected finite numbers", load_arm, urdf(tmp_path, broken))
    light = '<link name="b"><inertial><mass value="-3"/></inertial></link>'
    refused("a mass of -3 kg given, expected 0 or more", load_arm, urdf(tmp_path, light))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('joints = ["lift", "bend"]\nlocked = {bend = 0.3}', "joint bend given in joints and in locked"),
        ("locked = {bend = 100.0}", "joint bend locked at 100 given, expected -2.2 to 2.2, its range"),
        ("[joint.bend]\nlower = 3.0", "bend: a range from 3 to 2.2 rad given"),
        ("[joint.bend]\nbandwidth = 30.0", "bend: a servo of 30 Hz given, expected at most 25 Hz"),
        ("[joint.bend]\neffort = 1e308", r"bend: effort = 1e\+308 given, expected"),
        ("[joint.bend]\ncoulomb = 1e6", r"bend: coulomb = 1e\+06 N m given, expected less than the largest torque"),
        ("[joint.bend]\nkp = 10.0\nkd = 1.0\nbandwidth = 2.0", "bandwidth and kp given, which say the same"),
        ("[payloads.none]\nmass = 5.0", "expected another name than none"),
        ('[payloads."mass=1"]\nmass = 7.0', "none that begins with mass="),
        ("[payloads.a]\ncentre = [0.0, 0.0, 0.0]", "payloads.a: no mass given"),
        ("[payloads.a]\nmass = 1e300", "expected at most 100000 kg within 100 m"),
    ],
)  # fmt: skip
def test_settings_that_cannot_be_are_refused(tmp_path, text, message):
    folder = write_arm(tmp_path)
    (folder / "arm.toml").write_text(text + "\n")
    refused(message, load_arm, str(folder))


@pytest.mark.parametrize("delay", [3, 12, 100])
def test_the_truth_knows_bus_delays_of_any_length(tmp_path, delay):
    folder = write_arm(tmp_path)
    usual = linearize(load_arm(str(folder)), amplitudes=()).joint("lift")
    (folder / "arm.toml").write_text(f"[every_joint]\ndelay = {delay}\n")
    late = linearize(load_arm(str(folder)), amplitudes=()).joint("lift")
    assert late.delay_samples == delay + 1
    assert late.bandwidth_hz == pytest.approx(usual.bandwidth_hz, rel=1e-6)
    np.testing.assert_allclose(late.dominant_poles, usual.dominant_poles, rtol=1e-6)


def test_a_log_knows_the_files_of_its_arm(tmp_path, experiment):
    folder = write_arm(tmp_path)
    arm = load_arm(str(folder))
    kind = {"variant": str(folder), "payload": "none", "pose": arm.description.operating_pose, "axes": ("lift",)}
    (log,) = simulate([experiment(duration=1.0, **kind)])
    assert logged_arm(log).description.fingerprint == log.provenance["arm_sha256"]
    (folder / "arm.toml").write_text("[joint.bend]\nbandwidth = 3.0\n")
    refused("are others than when the log was made", logged_arm, log)
