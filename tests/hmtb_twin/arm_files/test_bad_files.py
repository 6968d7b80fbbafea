"""Files that are no arm: one line each, or they work."""

import numpy as np
import pytest

from hmtb_twin import TwinError, linearize, load_arm
from hmtb_twin.arm_files.known_arms import arm_named
from tests.refusals import refused

LINK = (
    '<link name="{}"><inertial><mass value="{}"/>'
    '<inertia ixx="{}" ixy="0" ixz="0" iyy="{}" iyz="0" izz="{}"/></inertial></link>'
)


def link(name, mass=1.0, moment=0.01):
    return LINK.format(name, mass, moment, moment, moment)


def joint(name, parent, child, kind="revolute", inside='<limit lower="-1" upper="1" effort="20" velocity="2"/>'):
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="0.2 0 0"/><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="0 1 0"/>{inside}</joint>'
    )


def urdf(tmp_path, *parts):
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="r">{link("base")}{"".join(parts)}</robot>')
    return str(path)


def test_what_is_refused(tmp_path):
    def tried(*parts):
        return urdf(tmp_path, *parts)

    refused(
        "the arm moves the link a, which is given no mass",
        load_arm,
        tried(link("a", 0.0, 0.0), joint("j", "base", "a")),
    )
    refused(
        "two joints with the name 'j'|repeated name",
        load_arm,
        tried(link("a"), link("b"), joint("j", "base", "a"), joint("j", "a", "b")),
    )
    refused("no hinge of an arm found", load_arm, tried(link("a"), joint("j", "base", "a", "prismatic")))
    refused("joint name 'a b' given", load_arm, tried(link("a"), joint("a b", "base", "a")))
    (tmp_path / "arm.urdf").write_text("<robot")
    refused("no XML", load_arm, str(tmp_path / "arm.urdf"))
    (tmp_path / "arm.urdf").write_text("<sdf/>")
    refused("<sdf> given, expected <mujoco> of MJCF or <robot> of URDF", load_arm, str(tmp_path / "arm.urdf"))
    refused("no arm at", load_arm, str(tmp_path / "none.urdf"))
    refused("unknown variant 'pandda', available: nominal.*as panda", load_arm, "pandda")


def test_joints_that_follow_others_and_limits_that_are_missing_work(tmp_path):
    mimic = '<limit lower="-1" upper="1" effort="5" velocity="1"/><mimic joint="j1"/>'
    path = urdf(
        tmp_path,
        *(link(name) for name in "abcd"),
        joint("j1", "base", "a", inside='<limit effort="0" velocity="0"/>'),
        joint("j2", "a", "b"),
        joint("finger", "b", "c"),
        joint("j3", "b", "d", inside=mimic),
    )
    arm = load_arm(path)
    assert arm.joints == ("j1", "j2")
    assert any("follow others" in remark and "j3" in remark for remark in arm.description.remarks)
    rows = {(row.owner, row.parameter): row for row in arm.description.assumed}
    assert rows["j1", "lower"].value < -3.0
    assert rows["j1", "effort"].value >= 1.0 and rows["j1", "velocity"].value > 1.0
    assert ("j2", "effort") not in rows


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('<joint name="lift"', '<joint stiffness="5" name="lift"'), "joint lift has a spring"),
        (
            ("<actuator>", '<equality><connect body1="flange" body2="turret" anchor="0 0 0"/></equality><actuator>'),
            "closes a",
        ),
        (("<worldbody>", '<option gravity="0 1 -9"/><worldbody>'), "gravity 0 1 -9 given"),
        (("<worldbody>", '<asset><mesh name="m" file="../../etc/m.stl"/></asset><worldbody>'), "outside the folder"),
        (('name="bend"', 'name="lift"'), "repeated name"),
        (('name="flange"', 'name="flange" gravcomp="1"'), "gravity compensation"),
    ],
)
def test_mjcf_that_is_refused(folder, change, message):
    text = (folder / "mine.xml").read_text()
    assert change[0] in text
    (folder / "mine.xml").write_text(text.replace(*change, 1))
    with pytest.raises(TwinError, match=message) as caught:
        load_arm(str(folder))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sample_rate = 10", "sample_rate = 10 given, expected a whole number from 50 to 1000 Hz"),
        ("colour = 'red'", "unknown key 'colour'"),
        ("[joint.knee]\neffort = 3", "joint.knee: no joint of the arm, available: swivel, lift, bend"),
        ("[joint.lift]\neffort = -3", "joint.lift.effort = -3 given, expected above 0, in N m"),
        ("[joint.lift]\neffort = {value = 3, tag = 'guess'}", "tag 'guess' given"),
        ("[joint.lift]\nkp = 3", "one of kp and kd given"),
        ("[poses]\nwork = [0, 0]", "poses.work: 2 angles given, expected 3"),
        ("[poses]\nwork = [0, 0, 9]", "poses.work: bend beyond the range"),
        ("operating_pose = 'away'", "operating_pose = 'away' given, available"),
        ("joints = ['lift', 'swivel']", "expected them from the base outward"),
        ("joints = ['lift', 'gripper']", "joint gripper is a slide"),
        ("tool = 'nose'", "unknown tool 'nose'"),
        ("model = '../mine.xml'", "expected a file in the folder or below"),
        ("[payloads.x]\nmass = 1\ninertia = [1, 1, 3]", "principal moments"),
        ("title = 3", "title = 3 given, expected a text"),
        ("x =", "not a TOML file"),
    ],
)
def test_settings_that_are_refused(folder, text, message):
    (folder / "arm.toml").write_text(text)
    with pytest.raises(TwinError, match=message) as caught:
        load_arm(str(folder))
    assert "arm.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_hundred_joints(tmp_path):
    names = [f"l{k}" for k in range(101)]
    parts = [link(name, 0.1, 1e-3) for name in names]
    hang = '<limit lower="-1" upper="1" effort="2000" velocity="2"/>'
    parts += [joint(f"j{k}", names[k - 1] if k else "base", names[k], inside=hang) for k in range(100)]
    description = arm_named(urdf(tmp_path, *parts[:101], *parts[101:]))
    assert len(description.joints) == 100


def test_links_that_no_body_can_be_may_stand_still(tmp_path):
    impossible = LINK.format("antenna", 1.0, 0.01, 0.01, 0.05)
    arm = link("a"), joint("j", "base", "a")
    fixed = '<joint name="f" type="fixed"><parent link="base"/><child link="antenna"/></joint>'
    works = load_arm(urdf(tmp_path, *arm, impossible, fixed))
    without = load_arm(urdf(tmp_path, *arm))
    assert works.joints == without.joints == ("j",)
    assert float(works.inertia(works.pose("middle"))[0, 0]) == float(without.inertia(without.pose("middle"))[0, 0])
    moved = fixed.replace('"base"', '"a"')
    refused(
        "the arm moves the link antenna, which is given principal moments 0.01, 0.01, 0.05 kg m2",
        load_arm,
        urdf(tmp_path, *arm, impossible, moved),
    )


def test_a_point_mass_counts(tmp_path):
    point = LINK.format("tip", 0.5, 0.0, 0.0, 0.0)
    fixed = '<joint name="f" type="fixed"><origin xyz="0.3 0 0"/><parent link="a"/><child link="tip"/></joint>'
    arm = load_arm(urdf(tmp_path, link("a"), joint("j", "base", "a"), point, fixed))
    bare = load_arm(urdf(tmp_path, link("a"), joint("j", "base", "a")))
    added = arm.controller.inertia_matrix(np.zeros(1)) - bare.controller.inertia_matrix(np.zeros(1))
    np.testing.assert_allclose(added, 0.5 * 0.3**2, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "joints"), [("tiago", 7), ("b1-z1", 6), ("baxter", 7), ("go2", 3), ("talos_reduced", 9), ("so101", 5)]
)
def test_robots_of_the_collection_load_as_their_longest_arm(name, joints):
    arm = load_arm(name)
    assert len(arm.joints) == joints
    # Of Tiago some links are points, and an antenna has an inertia that no body has.
    points = any(remark.startswith("point masses") for remark in arm.description.remarks)
    assert points == (name == "tiago")
    bandwidth = linearize(arm, amplitudes=()).joint(arm.joints[-1]).bandwidth_hz
    assert 1.5 < bandwidth < 2.5
