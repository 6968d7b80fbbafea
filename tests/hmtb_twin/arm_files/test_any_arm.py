"""Arms from example-robot-data and from a user's folder, against what Pinocchio alone reads from their files."""

import mujoco
import numpy as np
import pytest

from hmtb_twin import linearize, load_arm, simulate
from hmtb_twin.truth.linearization import simulated
from scenarios import load
from tests.independent_arm import IndependentArm
from tests.refusals import refused

ARMS = ("panda", "ur10", "xarm7", "kinova")


@pytest.fixture(params=[*ARMS, "folder"])
def arm(request):
    name = str(request.getfixturevalue("folder")) if request.param == "folder" else request.param
    return load_arm(name)


def test_the_linear_truth_is_that_of_an_independent_linearisation(arm):
    pose = arm.pose(arm.description.operating_pose)
    truth = linearize(arm, amplitudes=())
    independent = IndependentArm(arm)
    A, B = independent.linear(pose)
    z = np.exp(2j * np.pi * np.geomspace(0.1, 20.0, 40) * arm.description.sample_time)
    n = len(arm.joints)
    theirs = np.array([np.linalg.solve(one * np.eye(len(A)) - A, B)[:n] for one in z])
    ours = truth.model.frequency_response(np.geomspace(0.1, 20.0, 40))
    # the bus delays what is measured
    ours = ours * z[:, None, None] ** arm.delays[:, None]
    assert np.abs(ours - theirs).max() < 1e-6
    for joint, hz in independent.bandwidths(pose).items():
        assert truth.joint(joint).bandwidth_hz == pytest.approx(hz, rel=1e-6)
        assert truth.joint(joint).delay_samples == 1 + arm.description.bus[joint].delay


@pytest.mark.parametrize("friction", [False, True])
def test_trajectories_are_those_of_an_independent_ode(arm, friction):
    arm = load_arm(arm.variant, friction=friction)
    pose = arm.pose(arm.description.operating_pose)
    offsets = 5e-3 * np.repeat(np.random.default_rng(1).choice([-1.0, 1.0], 10), 5)
    command = np.tile(pose, (60, 1))
    # both begin at rest at the pose
    command[10:, 1] += offsets
    independent = IndependentArm(arm)
    theirs = independent.simulate(command)
    # ours are read at the start of a tick, and late by the bus
    late = int(arm.delays[1])
    ours = simulated(arm, pose, command)[1 + late :, 1]
    reference = theirs[: len(ours), 1] - pose[1]
    assert np.abs(ours - reference).max() < 1e-5 * np.abs(reference).max()


def test_it_rests_exactly_where_it_is_commanded(arm):
    data = arm.rest(arm.pose(arm.description.operating_pose))
    mujoco.mj_step(arm.model, data, nstep=100)
    np.testing.assert_allclose(data.qpos, arm.pose(arm.description.operating_pose), atol=1e-12)


def test_numbers_are_given_read_or_assumed(folder):
    arm = load_arm(str(folder))
    assert arm.joints == ("swivel", "lift", "bend")
    assert arm.description.rigid.locked == {"gripper": 0.01}
    assert arm.description.operating_pose == "home"
    np.testing.assert_array_equal(arm.pose("home"), [0.1, 0.5, 0.7])
    rows = {(row.owner, row.parameter): row for row in arm.description.numbers}
    assert rows["swivel", "effort"].value == 60.0
    assert rows["lift", "effort"].value == 80.0
    assert rows["swivel", "coulomb"].value == arm.drives["swivel"].coulomb_torque == 0.5
    assert arm.drives["swivel"].drag == pytest.approx(2.0)
    assert arm.drives["lift"].motor.armature == pytest.approx(0.15)
    assert {rows["swivel", name].tag for name in ("effort", "coulomb", "viscous", "armature", "lower")} == {"source"}
    assert rows["bend", "effort"].tag == rows["lift", "coulomb"].tag == rows["bend", "armature"].tag == "assumed"
    (folder / "arm.toml").write_text(
        "title = 'mine'\nsample_rate = 200\ndrives = 'hydraulic'\n[every_joint]\nbandwidth = 1.0\n"
        "[joint.bend]\neffort = {value = 30, source = 'data sheet'}\nlower = -1.0\n"
        "[poses]\nwork = [0.0, 0.4, 0.2]\n[payloads.tool]\nmass = 1.5\ncentre = [0, 0, 0.1]\n"
        "inertia = [0.01, 0.01, 0.01]\n"
    )
    changed = load_arm(str(folder), "tool")
    assert changed.description.sample_rate == 200
    assert changed.drives_kind == "hydraulic"
    assert changed.drives["bend"].maximum_torque == pytest.approx(30.0)
    (row,) = [row for row in changed.description.numbers if (row.owner, row.parameter) == ("bend", "effort")]
    assert (row.source, row.tag) == ("data sheet", "source")
    heavier = np.abs(changed.weight(changed.pose("work"))) - np.abs(arm.weight(changed.pose("work")))
    assert heavier[1] > 1.0
    truth = linearize(changed, "work", amplitudes=(1e-3,))
    assert truth.spectral_radius < 1.0
    assert truth.dt == 1.0 / 200
    assert truth.small_signal_error[1e-3] < 1e-2


@pytest.mark.parametrize("name", ["siso-5-elbow_pitch", "prbs-panda_joint4"])
def test_logs_as_tables_hold_every_number_and_the_torques_that_carry_the_weight(name):
    other = name.partition("panda")[1] or None
    (log,) = simulate(load(name, duration=4.0, arm=other))
    table, arrays = log.to_dataframe(), log.to_xarray()
    arm = load_arm(log.provenance["variant"])
    joint = log.axes[0]
    np.testing.assert_array_equal(table[f"{joint}_measured"], log.measured[:, log.joint_index(joint)])
    np.testing.assert_array_equal(arrays.commanded.sel(joint=joint), log.commanded[:, log.joint_index(joint)])
    np.testing.assert_array_equal(table.index, log.time)
    assert table.shape[1] == sum(array[0].size for array in arrays.data_vars.values())
    weight = arm.weight(arm.pose(arm.description.operating_pose))
    np.testing.assert_allclose(log.effort[0], weight, atol=1e-9)
    np.testing.assert_allclose(arrays.effort.mean("time"), weight, atol=0.02 * np.abs(weight).max())
    assert name in repr(log)
    assert max(len(repr(one)) for one in (log, arm, arm.description, simulate([]))) < 300


@pytest.mark.slow
def test_where_drives_hardly_hold_an_arm_a_lighter_pose_is_found():
    arm = load_arm("baxter")
    description = arm.description
    assert description.operating_pose == "light"
    assert any("the pose light is a rule's" in remark for remark in description.remarks)
    largest = np.array([description.actuators[joint].motor.maximum_torque for joint in arm.joints])
    loads = {}
    for name in description.poses:
        loads[name] = np.abs(arm.controller.gravity_torque([arm.pose(name)])[0] / largest).max()
    assert loads["light"] < 0.7 < min(load for name, load in loads.items() if name != "light")
    # with torque to spare small motions are linear
    errors = linearize(arm, amplitudes=(0.01,)).small_signal_error
    assert errors[0.01] < 1e-3


def test_a_pose_of_the_user_that_leaves_no_torque_is_said_or_refused(folder):
    def at(effort):
        text = f"[joint.lift]\neffort = {effort}\n[poses]\nout = [0.0, 0.0, 0.0]\n"
        (folder / "arm.toml").write_text('operating_pose = "out"\n' + text)
        return load_arm(str(folder))

    weight = np.abs(at(200.0).controller.gravity_torque([np.zeros(3)])[0][1])
    assert not any("little is left" in remark for remark in at(200.0).description.remarks)
    assert any("of the torque of lift: little is left" in remark for remark in at(1.2 * weight).description.remarks)
    refused("the drive of lift would need 125 % of its largest torque", at, 0.8 * weight)
