from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import POSES, JointLog, Plant, Specimen, TwinError, linearize, load_arm, simulate
from hmtb_twin.parameters.variants import OPERATING_POSE
from hmtb_twin.truth.logged_arm import check_truth, logged_arm
from scenarios import load
from scenarios.experiments.scenario import Scenario
from scenarios.truth.attainable import attainable
from scenarios.truth.noise_free import noise_free
from tests.refusals import refused


@pytest.fixture(scope="module")
def log():
    return simulate([replace(load("siso-5-elbow_pitch"), name="short", duration=2.0)])[0]


def test_a_log_can_be_made_again_from_itself_and_has_no_specimen_where_it_is_nominal(log):
    again = simulate([Scenario.from_toml(log.provenance["scenario"])])[0]
    assert np.array_equal(log.measured, again.measured)
    assert not [key for key in log.provenance if key.startswith("specimen")]


@pytest.mark.parametrize(
    ("arm", "pose", "message"),
    [
        (load_arm("published"), OPERATING_POSE, "variant = published, not nominal"),
        (load_arm(payload="none"), OPERATING_POSE, "payload = none, not rpcm"),
        (load_arm(plant=Plant(supply_pressure=15.0)), OPERATING_POSE, r"supply_pressure = 15.0, not 20.7"),
        (load_arm(plant=Plant(process_noise=0.01)), OPERATING_POSE, r"process_noise = 0.01, not 0.0"),
        (load_arm(plant=Plant(friction="none")), OPERATING_POSE, "friction = none, not viscous"),
        (load_arm(), "home", "pose = home, not rpcm_holster_out_approach"),
        (load_arm(), np.array(POSES["home"]), "pose = given angles, not rpcm_holster_out_approach"),
    ],
)
def test_a_truth_of_something_else_is_refused(log, arm, pose, message):
    with pytest.raises(TwinError, match=f"^short: the truth has other settings than the log: {message}$"):
        attainable(log, truth=linearize(arm, pose, amplitudes=()))


@pytest.mark.parametrize("friction", ["viscous", "coulomb", "lugre"])
def test_dry_friction_is_no_part_of_a_truth(log, friction):
    arm = load_arm(plant=Plant(friction=friction, friction_level=2.0))
    check_truth(log, logged_arm(log), linearize(arm, np.array(POSES[OPERATING_POSE]), amplitudes=()))


SPECIMEN = Specimen(mass=(1.1,) * 8, shift=(0.1, -0.2, 1.0 / 3.0) * 8, payload_mass=0.9, dry_friction=(1.5,) * 7)


@pytest.fixture(scope="module")
def own():
    """A log of one specimen of an arm that hardly rubs, with hardly any noise."""
    plant = Plant(friction="viscous", process_noise=1e-9)
    setting = replace(load("siso-5-elbow_pitch"), name="own", duration=2.0, plant=plant, specimen=SPECIMEN)
    return simulate([setting])[0]


def test_a_log_gives_the_very_arm_back(own, tmp_path):
    path = tmp_path / "own.nc"
    own.save(path)
    again = JointLog.load(path)
    assert logged_arm(again) is load_arm(plant=Plant(friction="viscous", process_noise=1e-9), specimen=SPECIMEN)
    assert Scenario.from_toml(again.provenance["scenario"]).specimen == SPECIMEN


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (
            {"specimen_mass": "1.1, 1.1"},
            "^own: damaged provenance: specimen: mass = '1.1, 1.1' given, expected a tuple",
        ),
        ({"specimen_mass": "[1.1]"}, "^own: .* 1 entries of mass given, expected 8"),
        ({"specimen_weight": "1.1"}, "^own: specimen_weight in its provenance, expected one of .*specimen_mass, "),
    ],
)
def test_what_tells_of_no_specimen_is_refused(own, damage, message):
    refused(message, logged_arm, replace(own, provenance={**own.provenance, **damage}))


def test_a_truth_belongs_to_one_specimen_whatever_rubs_dry(own):
    arm = logged_arm(own)
    check_truth(own, arm, linearize(arm, amplitudes=()))
    smooth = replace(SPECIMEN, dry_friction=())
    check_truth(own, arm, linearize(load_arm(plant=arm.plant, specimen=smooth), amplitudes=()))
    with pytest.raises(
        TwinError, match=r"^own: the truth has other settings than the log: specimen_mass = \(\), not \(1.1, "
    ):
        check_truth(own, arm, linearize(load_arm(plant=arm.plant), amplitudes=()))


def test_the_noise_free_angles_are_those_of_the_specimen(own):
    arm = logged_arm(own)
    mean, _, origin = noise_free(own, arm, linearize(arm, amplitudes=()), own.true_angles)
    assert origin == "simulated anew without process noise"
    late = np.vstack([own.true_angles[:1], own.true_angles[:-1]])
    expected = np.where(arm.delays == 1, late, own.true_angles)
    np.testing.assert_allclose(mean, expected, atol=1e-7)
