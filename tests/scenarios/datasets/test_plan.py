"""What a spec asks for: names, seeds and arms of its experiments."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from hmtb_twin import load_arm
from hmtb_twin.arm_files.known_arms import arm_named
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.record_block import RecordBlock
from scenarios.datasets.spec import DataSetSpec, load_spec, shipped
from scenarios.experiments.arm_tests import command_gain
from tests.refusals import refused
from tests.user_arm import write_arm

FLEET = load_spec("hmtb-fleet-v1")


def of(count):
    return DataSetPlan(replace(FLEET, twins=replace(FLEET.twins, count=count)))


def waveform_seed(entry):
    return entry.experiment.excitation[0].parameters["seed"]


@pytest.mark.parametrize("label", shipped())
def test_a_shipped_spec_reads_back_and_names_its_experiments_and_seeds_once(label):
    spec = shipped()[label]
    assert spec.label == label
    assert DataSetSpec.from_toml(spec.to_toml()) == spec
    entries = list(islice(DataSetPlan(spec), 100))
    assert len({entry.name for entry in entries}) == len({entry.experiment.seed for entry in entries}) == len(entries)


@pytest.mark.parametrize("count", [4, 10, 11, 1000])
def test_a_twin_is_the_same_however_many_there_are(count):
    """Names have more digits then, which change nothing."""
    few, many = of(4)[9].experiment, of(count)[9].experiment
    assert replace(few, name="same") == replace(many, name="same")


def test_twins_have_arms_noise_and_waveforms_of_their_own():
    plan = of(50)
    first = [plan[number] for number in range(0, len(plan), 3)]
    assert len({entry.experiment.specimen for entry in first}) == 50
    assert len({waveform_seed(entry) for entry in first}) == 50
    assert np.ptp([entry.experiment.plant.supply_pressure for entry in first]) > 2.0


def test_more_repeats_leave_the_first_as_they_are():
    spec = load_spec("hmtb-mimo-v1")
    more = replace(spec, records=(replace(spec.records[0], repeats=12), *spec.records[1:]))
    two, second = DataSetPlan(spec)[1], DataSetPlan(more)[1]
    assert (two.name, second.name) == ("independent-r2", "independent-r02")
    assert two.experiment.seed == second.experiment.seed


def test_multisines_are_drawn_for_every_joint_amplitude_and_repeat_but_once_for_a_measurement():
    spec = load_spec("hmtb-nonlinear-v1")
    block = replace(spec.records[0], repeats=2)
    measurements = set()
    for entry in DataSetPlan(replace(spec, records=(block, *spec.records[1:]))):
        if entry.block == block.name:
            one = entry.experiment
            measurements.add((one.multisines.seed, one.axes, one.multisines.rms, entry.name.rpartition("-")[2]))
    assert len(measurements) == len({seed for seed, *_ in measurements}) == 2 * 4 * 2


def test_waveforms_are_those_written_and_names_are_unique():
    spec = load_spec("hmtb-thesis-v1")
    assert waveform_seed(DataSetPlan(spec)[0]) == 0
    again = replace(spec.records[0], name="again")
    refused("siso-5-shoulder_yaw", DataSetPlan, replace(spec, records=(*spec.records, again)))


@pytest.mark.parametrize("label", ["hmtb-siso-v1", "hmtb-mimo-v1"])
def test_lengths_and_windows_that_cannot_be_are_refused_before_anything_is_run(label):
    spec = shipped()[label]
    shortest = min(e.experiment.duration for e in DataSetPlan(spec) if e.part != "train")
    refused("expected 10 or more behind it to score", DataSetPlan, replace(spec, window=round(50 * shortest) - 9))
    assert len(DataSetPlan(replace(spec, window=round(50 * shortest) - 10)))


def test_a_duration_of_no_whole_number_of_samples_is_refused(tiny_spec):
    for duration in (4.00001, 0.0):
        spec = replace(tiny_spec, records=(replace(tiny_spec.records[0], duration=duration), tiny_spec.records[1]))
        refused(f"duration.* {duration}", DataSetPlan, spec)


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ('title = "Three short records"', 'title = "a\\u0000b"', "title = 'a.x00b' given, expected no control char"),
        ('title = "Three short records"', 'title = "a\\u202eb"', "title = 'a.u202eb' given"),
        ('description = "For tests."', 'description = "a\\u001b[2J"', "description = 'a.x1b"),
        ('creators = ["The HMTB twin contributors"]', 'creators = ["A\\nB"]', "creators = 'A.nB' given"),
        ("version = 1", "version = 1000001", "version = 1000001 given, expected 1 to 1000000"),
        ('date = "2026-01-31"', 'date = "31.1.2026"', "expected a day as YYYY-MM-DD"),
        ('url = ""', 'url = "ftp://x"', "expected one of http"),
        ('creators = ["The HMTB twin contributors"]', "creators = []", "expected names to cite"),
        ("version = 1", "version = 1" + 5000 * "0", "4300 digits"),
        ("version = 1", "version = 0x" + 5000 * "f", "a whole number of 20000 bits"),
        ("seed = 7", "seed = 7\nwindow = " + 5000 * "[", "nested too deeply"),
        ("seed = 7", 'seed = 7\ntwins = { count = 1, mass = { kind = "lognormal", spread = 1e9 } }', "would be drawn"),
    ],
)
def test_a_spec_that_nobody_means_is_refused_in_a_line(tiny_spec, before, after, says):
    text = tiny_spec.to_toml()
    assert before in text
    refused(says, DataSetSpec.from_toml, text.replace(before, after, 1))


ARMS = load_spec("arms-siso-v1")


def with_block(**changes):
    """The spec of several arms with changes in its first block of Panda."""
    place = next(number for number, block in enumerate(ARMS.records) if block.arm == "panda")
    records = list(ARMS.records)
    records[place] = replace(records[place], **changes)
    return replace(ARMS, records=tuple(records))


def test_another_machine_has_its_own_joints_payload_pose_and_interface():
    plan = DataSetPlan(ARMS)
    of_panda = [entry for entry in plan if entry.experiment.variant == "panda"]
    joints = load_arm("panda").joints
    assert [entry.joints for entry in of_panda[:7]] == [(joint,) for joint in joints]
    assert {(entry.experiment.payload, entry.experiment.pose) for entry in of_panda} == {("none", "default")}
    assert of_panda[0].experiment.hand_controller.gain == command_gain(arm_named("panda"), joints[0])
    # each machine has one truth, and the test bed two arms
    assert len({entry.arm for entry in plan}) == 6
    assert 'arm = "panda"' in ARMS.to_toml()
    assert "shoulder" not in DataSetSpec.from_toml(ARMS.to_toml()).to_toml()


def test_tests_of_another_machine_are_named_behind_their_block():
    mine = RecordBlock("mine", "train", scenarios=("prbs",), arm="xarm7", duration=5.0)
    names = [entry.name for entry in DataSetPlan(replace(ARMS, records=(mine, *ARMS.records)))][:7]
    assert names == [f"mine-prbs-joint{number}" for number in range(1, 8)]


def test_what_another_machine_cannot_have_is_named(tmp_path):
    refused("arm and variants given", with_block, variants=("flight",))
    refused("arm = 'flight' given, expected another machine", with_block, arm="flight")
    for changes, message in (
        ({"arm": "pandda"}, "unknown variant 'pandda'.*panda"),
        ({"joints": ("joint9",)}, "records 'panda-prbs': unknown joint 'joint9'"),
        ({"payloads": ("rpcm", "mdm")}, "unknown payload 'rpcm'"),
        ({"poses": ("home",)}, "unknown pose 'home'"),
        ({"axes": ("elbow_pitch",)}, "unknown axis 'elbow_pitch'"),
        (
            {"scenarios": ("siso-5-elbow_pitch",), "excitation": (), "each_axis": False},
            "unknown test of the arm panda 'siso-5-elbow_pitch'",
        ),
    ):
        refused(message, DataSetPlan, with_block(**changes))
    folder = write_arm(tmp_path)
    (folder / "arm.toml").write_text("sample_rate = 200\n")
    refused("runs at 200 Hz, expected 50 Hz", DataSetPlan, with_block(arm=str(folder)))
