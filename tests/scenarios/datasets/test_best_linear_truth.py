"""Best linear approximations of a data set: one for each class of excitation, and read back with its interval."""

from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin.control.control_station import ControlStation
from hmtb_twin.files.netcdf import read_netcdf
from hmtb_twin.parameters.values import LARGE_MOTION
from hmtb_twin.parameters.variants import joint_index
from hmtb_twin.run.experiment_row import experiment_arm
from scenarios.datasets import best_linear_truth
from scenarios.datasets.arm_truth import arm_truth
from scenarios.datasets.best_linear_truth import (
    best_linear_contents,
    best_linear_pieces,
    excitation_class,
    matching_multisines,
    recorded_realisations,
)
from scenarios.datasets.build import build
from scenarios.datasets.data_set import open_data_set
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.record_block import RecordBlock
from scenarios.datasets.spec import BaselineSpec, DataSetSpec, TruthSpec
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.multisines import Multisines, multisine_experiments
from scenarios.truth.best_linear import best_linear
from sysid import bla
from tests.refusals import refused

MULTISINES = Multisines(f_min=0.4, f_max=4.0, period=2.56, realisations=3, periods=2, settling=1)
LARGE = RecordBlock("m", "train", axes=("elbow_pitch",), multisines=MULTISINES, hand_controller=LARGE_MOTION)
MULTISINE = replace(LARGE, frictions=("none",))
PRBS = Excitation("prbs", {"amplitude": 1.0, "clock": 2, "register": 9})
NOISE = Excitation("white_noise", {"amplitude": 1.0})
AXES = ("shoulder_yaw", "elbow_pitch")
BOTH = replace(LARGE, name="both", part="test", axes=AXES, multisines=None, excitation=(NOISE,), duration=20.0)
BLOCKS = (
    replace(MULTISINE, name="multisine", amplitudes=(0.01, 0.03), draw_waveforms=True),
    replace(BOTH, name="prbs", part="train", each_axis=True, repeats=2, excitation=(PRBS,), draw_waveforms=True),
    BOTH,
)
TRUTH = TruthSpec(best_linear=tuple(block.name for block in BLOCKS))
SPEC = DataSetSpec("approximated", 1, "Classes of excitation", 3, BLOCKS, truth=TRUTH)


def test_there_is_a_piece_for_each_class():
    """Realisations and repeats differ by chance; arm, joints and amplitude do not."""
    plan = DataSetPlan(SPEC)
    assert best_linear_pieces(plan) == [
        "multisine-10mrad-01",
        "multisine-30mrad-01",
        "prbs-shoulder_yaw-r1",
        "prbs-elbow_pitch-r1",
        "both",
    ]
    assert best_linear_pieces(DataSetPlan(replace(SPEC, truth=replace(SPEC.truth, best_linear=())))) == []
    assert len({excitation_class(entry) for entry in plan}) == 5


@pytest.mark.slow
def test_the_file_is_the_approximation_and_lies_about_the_truth(tmp_path):
    entry = DataSetPlan(SPEC)[0]
    contents = best_linear_contents(SPEC, entry, threads=1)
    path = tmp_path / "best.nc"
    path.write_bytes(contents.to_bytes())
    stored = {name: variable.values for name, variable in read_netcdf(path).variables.items()}
    response = stored["response"][..., 0] + 1j * stored["response"][..., 1]
    best = best_linear(*matching_multisines(SPEC, entry), measured=entry.joints, threads=2)
    np.testing.assert_array_equal(response, best.servo.response.response)
    np.testing.assert_array_equal(stored["covariance"], best.servo.response.covariance)
    assert contents.attributes["degrees_of_freedom"] == best.servo.response.degrees_of_freedom
    assert stored["output"].tolist() == ["elbow_pitch"] and stored["distortion"] == best.distortion_percent
    # Without friction it is the small-signal truth but for chance.
    truth = arm_truth(experiment_arm(entry.experiment), entry.experiment.pose)
    expected = truth.channel("elbow_pitch", "elbow_pitch").frequency_response(stored["frequency"])
    np.testing.assert_allclose(np.abs(response / expected), 1.0, atol=0.02)
    low, high = stored["bandwidth_ci95"][:, 0, 0]
    assert low < stored["bandwidth"][0, 0] < high < low + 0.1


def commands(experiment, arm):
    return ControlStation(experiment, arm, np.random.default_rng(experiment.seed).spawn(2)[0]).commands


def test_a_binary_sequence_is_matched_in_strength_and_band():
    refused("excites shoulder_yaw, elbow_pitch at once", best_linear_contents, SPEC, list(DataSetPlan(SPEC))[-1])
    entry = next(entry for entry in DataSetPlan(SPEC) if entry.name == "prbs-elbow_pitch-r1")
    setting, multisines = matching_multisines(SPEC, entry)
    assert setting.axes == ("elbow_pitch",)
    assert multisines.realisations == 8
    arm, column = experiment_arm(entry.experiment), joint_index("elbow_pitch")
    command = commands(entry.experiment, arm)[:, column]
    power = np.abs(np.fft.rfft(command - command.mean())) ** 2
    inside = power[: round(multisines.f_max * 20.0) + 1].sum() / power.sum()
    assert inside == pytest.approx(0.95, abs=0.02)
    # The velocity limit takes some of what is asked for.
    assert multisines.rms > command.std()
    played = [commands(one, arm)[multisines.samples :, column] for one in multisine_experiments(setting, multisines)]
    assert np.sqrt(np.mean(np.var(played, axis=1))) == pytest.approx(command.std(), rel=0.02)


@pytest.mark.parametrize(
    ("table", "match"),
    [
        ({"amplitudes": (0.0,)}, "above 0 and up to 1 rad"),
        ({"amplitudes": (0.1, 0.1)}, "expected each once"),
        ({"floors": -1}, "floors = -1 given, expected 0 to 1000000"),
        ({"search_steps": -1}, "search_steps = -1 given, expected 0 to 10000"),
        ({"realisations": 1}, "realisations = 1 given, expected 2 to 10000"),
        ({"best_linear": ("prsb",)}, r"truth\.best_linear: unknown block 'prsb': did you mean 'prbs'"),
    ],
)
def test_a_wrong_truth_table_is_refused(table, match):
    refused(match, lambda: replace(SPEC, truth=TruthSpec(**table)))


MEASURED = tuple(
    replace(
        MULTISINE, name=name, part=part, draw_waveforms=True, multisines=replace(MULTISINES, rms=rms, realisations=2)
    )
    for name, part, rms in (("known", "train", 0.03), ("stronger", "train", 0.02), ("new", "test", 0.03))
)
OWN = replace(
    DataSetSpec("own", 1, "Multisines that are a measurement", 5, MEASURED, baselines=BaselineSpec(models=())),
    truth=TruthSpec(best_linear=("new",), realisations=4, floors=0),
)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.* is not periodic")
def test_recorded_realisations_of_a_class_are_the_measurement(tmp_path, monkeypatch):
    """Records of one class count whatever their part, others do not; only what is missing is simulated."""
    folder = build(OWN, tmp_path, workers=1).folder
    plan = DataSetPlan(OWN)
    entry = next(entry for entry in plan if entry.name == "new-01")
    own = recorded_realisations(plan, folder, entry)
    assert [one.name for one, _ in own] == ["known-01", "known-02", "new-01", "new-02"]
    records = [
        record.iodata() for block in ("known", "new") for record in open_data_set(folder).select(block=block).records()
    ]
    expected = bla([replace(record, window=128) for record in records], 128, lines=entry.experiment.multisines.lines)
    stored = read_netcdf(folder / entry.best_linear)
    response = stored.variables["response"].values
    np.testing.assert_array_equal(response[..., 0] + 1j * response[..., 1], expected.response.response)
    assert stored.attributes["realisations"] == 4
    with monkeypatch.context() as patch:
        patch.setattr(best_linear_truth, "simulate", None)
        best_linear_contents(OWN, entry, recorded=own)
        with pytest.raises(TypeError):
            best_linear_contents(OWN, entry, recorded=own[:3])
    # Two at least are simulated: a measurement of one realisation is none.
    more = best_linear_contents(OWN, entry, recorded=own[:3], threads=1)
    assert more.attributes["realisations"] == 5
    assert more.attributes["provenance_realisations simulated"] == "2"
    (folder / plan[0].data).unlink()
    assert [one.name for one, _ in recorded_realisations(plan, folder, entry)] == ["known-02", "new-01", "new-02"]


def test_silent_lines_and_other_excitations_keep_records_apart(tmp_path):
    """Odd multisines of two seeds have different lines; nothing but a multisine has realisations."""
    odd = tuple(replace(block, multisines=replace(block.multisines, odd=True)) for block in OWN.records)
    plan = DataSetPlan(replace(OWN, records=odd))
    for entry in plan:
        (tmp_path / entry.data).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / entry.data).touch()
    refused("new-01", recorded_realisations, plan, tmp_path, next(entry for entry in plan if entry.name == "new-01"))
    assert recorded_realisations(DataSetPlan(SPEC), tmp_path, list(DataSetPlan(SPEC))[-1]) == ()
