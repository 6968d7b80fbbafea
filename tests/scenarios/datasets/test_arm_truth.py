"""The truth of an arm: what its file tells is what the laboratory says, to the bit."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hmtb_twin import Specimen, linearize, load_arm
from scenarios.datasets.arm_truth import arm_contents, arm_files, arm_joints, model_sha256, read_arm
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.spec import DataSetSpec, load_spec
from scenarios.datasets.spec_tables import TruthSpec
from scenarios.experiments.logged_arm import experiment_arm
from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import read_netcdf

MATRICES = ("A", "B", "C", "D", "K", "innovation_covariance")


def test_the_file_of_a_build_gives_the_truth_back(tiny: Path, tiny_spec: DataSetSpec) -> None:
    plan = DataSetPlan(tiny_spec)
    stored, true = read_arm(tiny / plan[0].arm_truth), linearize(load_arm(), plan[0].experiment.pose, amplitudes=())
    for name in MATRICES:
        np.testing.assert_array_equal(getattr(stored.truth.model, name), getattr(true.model, name))
    assert stored.truth.model.input_names == true.model.input_names
    assert stored.truth.plant == true.plant
    assert stored.truth.specimen == true.specimen
    np.testing.assert_array_equal(stored.rest, true.angles)
    assert list(stored.joints) == ["shoulder_yaw", "shoulder_pitch", "elbow_pitch"]
    for name, joint in stored.joints.items():
        expected = true.joint(name)
        for matrix in MATRICES:
            np.testing.assert_array_equal(getattr(joint.model, matrix), getattr(expected.model, matrix))
        for key in ("poles", "zeros", "shares"):
            np.testing.assert_array_equal(getattr(joint, key), getattr(expected, key))
        for key in ("bandwidth_hz", "dc_gain", "delay_samples"):
            assert getattr(joint, key) == getattr(expected, key)


def test_a_specimen_with_noise_in_its_drives_and_trials_comes_back_whole(tmp_path: Path) -> None:
    """Everything that a truth can hold: gain K, drooping rest, trial amplitudes, a specimen."""
    spec = replace(load_spec("hmtb-siso-v1"), truth=TruthSpec(amplitudes=(1e-3,)))
    entry = DataSetPlan(spec)[0]
    specimen = Specimen(payload_mass=1.5, kp=(0.9,) * 7)
    plant = replace(entry.experiment.plant, process_noise=0.01)
    entry = replace(entry, experiment=replace(entry.experiment, plant=plant, specimen=specimen))  # type: ignore[type-var]
    contents = arm_contents(spec, entry, ("elbow_pitch",))
    assert contents.to_bytes() == arm_contents(spec, entry, ("elbow_pitch",)).to_bytes()
    path = tmp_path / "arm.nc"
    path.write_bytes(contents.to_bytes())
    stored = read_arm(path)
    arm = experiment_arm(entry.experiment)
    true = linearize(arm, entry.experiment.pose, amplitudes=(1e-3,))
    assert stored.truth.specimen == specimen
    assert stored.truth.plant == true.plant
    assert stored.truth.small_signal_error == true.small_signal_error
    assert np.abs(stored.truth.model.gain).max() > 0.0
    np.testing.assert_array_equal(stored.truth.model.gain, true.model.gain)
    # What follows from it does too: the noise model of a joint seen alone.
    one, other = (t.subset(("elbow_pitch",), ("elbow_pitch",)) for t in (stored.truth, true))
    np.testing.assert_array_equal(one.gain, other.gain)
    assert np.abs(stored.rest - true.angles).max() > 1e-4
    np.testing.assert_array_equal(stored.rest, arm.rest(true.angles).qpos[:7])
    assert json.loads(str(stored.attributes["specimen"]))["payload_mass"] == 1.5


def test_the_hash_is_of_the_model() -> None:
    assert model_sha256(load_arm()) == model_sha256(load_arm())
    others = [load_arm(friction=False), load_arm(payload="none"), load_arm(specimen=Specimen(drag=(1.1,) * 7))]
    assert len({model_sha256(arm) for arm in (load_arm(), *others)}) == 4


def test_which_joints_are_told_of() -> None:
    assert arm_joints(DataSetPlan(load_spec("hmtb-fleet-v1"))) == ("elbow_pitch",)
    assert arm_joints(DataSetPlan(load_spec("hmtb-siso-v1"))) == ("shoulder_yaw", "shoulder_pitch", "elbow_pitch")


def test_an_arm_without_linear_truth_says_why(tmp_path: Path, tiny_spec: DataSetSpec) -> None:
    plan = DataSetPlan(tiny_spec)
    heavy = replace(plan[0].experiment, specimen=Specimen(mass=(20.0,) * 8))  # type: ignore[type-var]
    (contents,) = arm_files(plan, replace(plan[0], experiment=heavy)).values()
    assert contents.attributes["stable"] == 0
    path = tmp_path / "arm.nc"
    path.write_bytes(contents.to_bytes())
    with pytest.raises(ScenarioError, match=r"no linear truth: .*the drives cannot hold"):
        read_arm(path)


def test_other_files_are_refused(tiny: Path) -> None:
    record = next((tiny / "data" / "test").iterdir())
    with pytest.raises(ScenarioError, match="is not the truth of an arm"):
        read_arm(record)
    with pytest.raises(ScenarioError, match="no file"):
        read_arm(tiny / "absent.nc")
    assert read_netcdf(record).attributes["part"] == "test"
