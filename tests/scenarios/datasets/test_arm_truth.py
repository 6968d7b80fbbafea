"""The truth of an arm: its file holds what the laboratory computes, to the bit."""

from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import Specimen, linearize, load_arm
from hmtb_twin.run.experiment_row import experiment_arm
from scenarios.datasets.arm_truth import arm_files, arm_joints, model_sha256, read_arm
from scenarios.datasets.plan import DataSetPlan, arm_file
from scenarios.datasets.spec import TruthSpec, load_spec
from tests.refusals import refused

MATRICES = ("A", "B", "C", "D", "K", "innovation_covariance")


def test_the_file_of_a_build_gives_the_truth_back(tiny, tiny_spec):
    plan = DataSetPlan(tiny_spec)
    stored, true = read_arm(tiny / arm_file(plan[0].arm)), linearize(load_arm(), plan[0].experiment.pose, amplitudes=())
    assert stored.truth.model.input_names == true.model.input_names
    assert (stored.truth.plant, stored.truth.specimen) == (true.plant, true.specimen)
    np.testing.assert_array_equal(stored.rest, true.angles)
    assert list(stored.joints) == ["shoulder_yaw", "shoulder_pitch", "elbow_pitch"]
    pairs = [(stored.truth, true), *((joint, true.joint(name)) for name, joint in stored.joints.items())]
    for one, expected in pairs:
        for matrix in MATRICES:
            np.testing.assert_array_equal(getattr(one.model, matrix), getattr(expected.model, matrix))
    for one, expected in pairs[1:]:
        for key in ("poles", "zeros", "shares", "bandwidth_hz", "dc_gain", "delay_samples"):
            np.testing.assert_array_equal(getattr(one, key), getattr(expected, key))


@pytest.mark.slow
def test_a_specimen_with_noise_in_its_drives_and_trials_comes_back_whole(tmp_path):
    """Everything that a truth can hold: gain K, drooping rest, trial amplitudes, a specimen."""
    spec = replace(load_spec("hmtb-siso-v1"), truth=TruthSpec(amplitudes=(1e-3,)))
    plan = DataSetPlan(spec)
    entry = plan[0]
    specimen = Specimen(payload_mass=1.5, kp=(0.9,) * 7)
    plant = replace(entry.experiment.plant, process_noise=0.01)
    entry = replace(entry, experiment=replace(entry.experiment, plant=plant, specimen=specimen))
    (contents,) = arm_files(plan, entry).values()
    assert contents.to_bytes() == arm_files(plan, entry)[arm_file(entry.arm)].to_bytes()
    path = tmp_path / "arm.nc"
    path.write_bytes(contents.to_bytes())
    stored = read_arm(path)
    arm = experiment_arm(entry.experiment)
    true = linearize(arm, entry.experiment.pose, amplitudes=(1e-3,))
    assert (stored.truth.specimen, stored.truth.plant) == (specimen, true.plant)
    assert stored.truth.small_signal_error == true.small_signal_error
    assert np.abs(stored.truth.model.gain).max() > 0.0
    np.testing.assert_array_equal(stored.truth.model.gain, true.model.gain)
    assert np.abs(stored.rest - true.angles).max() > 1e-4
    np.testing.assert_array_equal(stored.rest, arm.rest(true.angles).qpos[:7])


def test_the_hash_is_of_the_model():
    others = [load_arm(friction=False), load_arm(payload="none"), load_arm(specimen=Specimen(drag=(1.1,) * 7))]
    assert len({model_sha256(arm) for arm in (load_arm(), load_arm(), *others)}) == 4


def test_joints_of_the_truth_are_those_of_the_records():
    assert arm_joints(DataSetPlan(load_spec("hmtb-fleet-v1")), "nominal") == ("elbow_pitch",)
    siso = DataSetPlan(load_spec("hmtb-siso-v1"))
    assert arm_joints(siso, "nominal") == ("shoulder_yaw", "shoulder_pitch", "elbow_pitch")
    # those of another machine are its own, those of a variant of the test bed the same as of any
    arms = DataSetPlan(load_spec("arms-siso-v1"))
    assert arm_joints(arms, "ur10") == load_arm("ur10").joints
    assert arm_joints(arms, "flight") == arm_joints(arms, "nominal") == load_arm().description.free


def test_an_arm_without_linear_truth_says_why(tmp_path, tiny_spec):
    plan = DataSetPlan(tiny_spec)
    heavy = replace(plan[0].experiment, specimen=Specimen(mass=(20.0,) * 8))
    (contents,) = arm_files(plan, replace(plan[0], experiment=heavy)).values()
    assert contents.attributes["stable"] == 0
    path = tmp_path / "arm.nc"
    path.write_bytes(contents.to_bytes())
    refused(r"no linear truth: .*the drives cannot hold", read_arm, path)


def test_other_files_are_refused(tiny):
    refused("is not the truth of an arm", read_arm, tiny / "data/test/noise.nc")
    refused("no file", read_arm, tiny / "absent.nc")
