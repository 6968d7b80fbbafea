"""Baselines and attainable scores: the right model reaches the best score, none goes below, every row repeats."""

import csv
import io
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hmtb_twin.parameters.variants import joint_index
from hmtb_twin.run.experiment_row import experiment_arm
from hmtb_twin.truth.linearization import simulated
from scenarios.datasets.attainable_scores import attainable_files
from scenarios.datasets.baselines import BaselineData, baseline, dead_zone, differences, report
from scenarios.datasets.build import build
from scenarios.datasets.plan import ATTAINABLE, BASELINES, DataSetPlan
from scenarios.datasets.score import score, score_model
from scenarios.datasets.spec import BaselineSpec, Method, Scoring
from scenarios.datasets.tables import read_table, table_text
from scenarios.experiments.excitation_computer import Excitation
from tests.refusals import refused

# What all of them set up takes seconds.
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def small(tiny_spec, tmp_path_factory):
    """With friction and without."""
    common = {"axes": ("elbow_pitch",), "each_axis": False, "frictions": ("viscous", "lugre")}
    prbs = Excitation("prbs", {"amplitude": 1.0, "clock": 2, "register": 15})
    # Small enough for linear dynamics, whose error grows with the motion: half a percent at 1 V.
    noise = Excitation("white_noise", {"amplitude": 0.3})
    train, test = tiny_spec.records
    methods = ("hold", "gain", "arx:4/4", "armax:3/3/3", "iv4:2/2", "oe:2/2", "okid:2/5", "n4sid:3", "truth")
    spec = replace(
        tiny_spec,
        name="small",
        seed=11,
        window=100,
        baselines=BaselineSpec(methods),
        records=(
            replace(train, name="prbs", duration=40.0, excitation=(prbs,), **common),
            replace(test, duration=30.0, excitation=(noise,), **common),
        ),
    )
    return build(spec, tmp_path_factory.mktemp("small"), workers=1)


@pytest.fixture(scope="module")
def floors(small):
    with (small.folder / ATTAINABLE).open(newline="") as stream:
        return {line["experiment"]: line for line in csv.DictReader(stream)}


class Physics:
    """The twin itself as a model, which knows the commands of a record and the arm, and starts at rest."""

    def __init__(self, small, record):
        self.experiment = next(entry for entry in DataSetPlan(small.spec) if entry.name == record.name).experiment

    def predicted(self, record, steps):
        arm, column = experiment_arm(self.experiment), joint_index("elbow_pitch")
        pose = arm.pose(self.experiment.pose)
        commands = np.tile(pose, (len(record), 1))
        commands[:, column] = record.u[:, 0]
        return (simulated(arm, pose, commands) + arm.rest(pose).qpos[:7])[:, [column]]


def test_the_right_model_reaches_the_stated_score(small, floors):
    """With dry friction and without, the twin simulated from the commands alone leaves the noise of the recorder."""
    scores = score_model(lambda record: Physics(small, record), small)
    assert [one.experiment for one in scores.scores] == list(floors)
    for one in scores.scores:
        stated = floors[one.experiment]
        assert float(stated["attainable_by_chance"]) <= one.value
        assert one.value == pytest.approx(float(stated["attainable"]), rel=1e-6)


def test_without_friction_the_small_signal_truth_reaches_it_within_chance(small, floors):
    scores = baseline(BaselineData(small, small.spec.baselines), Method("truth")).test.scores
    values = {one.experiment: one.value for one in scores}
    smooth, rough = floors["noise-viscous"], floors["noise-lugre"]
    lower, floor = float(smooth["attainable_by_chance"]), float(smooth["attainable"])
    # An initial state and a constant more or less: what chance takes off a floor it may put on it.
    assert lower <= values["noise-viscous"] <= floor + 3.0 * (floor - lower)
    # Stuck joints are beyond linear systems, the more so beyond that of small signals.
    assert values["noise-lugre"] > 2.0 * float(rough["attainable"])
    assert float(rough["attainable"]) < float(rough["best_linear"]) < float(rough["small_signal"])


def test_no_baseline_goes_below_a_floor(small, floors):
    published = sorted((small.folder / "baselines").iterdir())
    assert len(published) == len(small.spec.baselines.models)
    for path in published:
        for experiment, joint, value in json.loads(path.read_text())["test"]:
            stated = floors[experiment]
            assert joint == stated["joint"]
            assert float(value) >= float(stated["attainable_by_chance"]), f"{path.stem} on {experiment}"
            if path.stem != "truth":
                assert float(value) >= 0.999 * float(stated["best_linear"]), f"{path.stem} on {experiment}"


@pytest.mark.thorough
def test_every_row_is_made_again_by_its_command(small, monkeypatch, result):
    rows = read_table(small.folder / BASELINES)
    assert [one["method"] for one in rows] == [method.name for method in small.spec.baselines.methods]
    monkeypatch.chdir(small.folder.parent)
    for one in rows:
        words = one["command"].split()
        assert words[:4] == ["hmtb", "dataset", "baselines", "small-v1"]
        assert not any(result(*words[1:])["differences"].values())


def test_a_row_that_differs_is_reported(small, tmp_path, printed):
    copy = Path(shutil.copytree(small.folder, tmp_path / "small-v1"))
    rows = [dict(one) for one in read_table(copy / BASELINES)]
    rows[0]["test"] = f"{float(rows[0]['test']) * (1 + 1e-8):.11g}"
    (copy / BASELINES).write_text(table_text(rows[0], rows))
    assert "published" in printed("dataset", "baselines", copy, "--method", "hold", code=1)
    other = printed("dataset", "baselines", copy, "--method", "arx", "--orders", "1", "1")
    assert "no such row is published" in other
    (copy / BASELINES).write_text("a,b\n1\n")
    refused("a row has more or fewer columns", read_table, copy / BASELINES)
    assert differences({"test": "1", "test_x": "", "orders": "2"}, {"test": "1.0000000001", "test_x": "3"}) == (
        "test_x = none, published 3",
    )


def test_models_come_from_the_training_part_of_their_own_arm(small):
    bench = BaselineData(small, BaselineSpec())
    assert [one.name for one in bench.training(small.record("noise-lugre"))] == ["prbs-lugre"]
    assert [one.name for one in bench.training(small.record("noise-viscous"))] == ["prbs-viscous"]
    assert set(baseline(bench, Method("gain")).trained) == {"prbs-viscous", "prbs-lugre"}
    assert report(bench, Method("gain"))["row"]["validation"] == ""
    # Of another arm where there is none of its own.
    other = replace(bench, data_set=replace(small, index=tuple(x for x in small.index if x.name != "prbs-lugre")))
    assert [one.name for one in other.training(small.record("noise-lugre"))] == ["prbs-viscous"]
    none = replace(bench, data_set=replace(small, index=tuple(x for x in small.index if x.part != "train")))
    assert "no training records of elbow_pitch" in report(none, Method("gain"))["row"]["failed"]


@pytest.mark.parametrize(
    "text",
    [
        "narx:3/3/1/2",
        pytest.param("neural_ss:2/2", marks=pytest.mark.thorough),
        pytest.param("hammerstein:2/2", marks=pytest.mark.thorough),
    ],
)
def test_nonlinear_baselines_score_well_and_repeat(small, text):
    bench = BaselineData(small, BaselineSpec())
    made = report(bench, Method.parsed(text))
    assert made == report(BaselineData(small, BaselineSpec()), Method.parsed(text))
    assert made["row"]["failed"] == ""
    hold = float(report(bench, Method("hold"))["row"]["test"])
    assert float(made["row"]["test"]) < 0.5 * hold


def test_the_known_dead_zone_is_friction_over_stiffness(small):
    rough, smooth = (small.record(name) for name in ("noise-lugre", "noise-viscous"))
    arm = experiment_arm(Physics(small, rough).experiment)
    expected = arm.drives["elbow_pitch"].coulomb_torque / arm.gains["elbow_pitch"].kp
    assert dead_zone(small, rough.arm, "elbow_pitch") == pytest.approx(expected) == pytest.approx(0.49e-3, rel=0.05)
    assert dead_zone(small, smooth.arm, "elbow_pitch") == 0.0
    refused("known dead zone is taken from the truth", dead_zone, small, "no-arm", "elbow_pitch")


def test_a_nonlinear_baseline_that_fails_says_why(small):
    bench = BaselineData(small, BaselineSpec())
    for text, reason in (("narx:30/30/1/3", "candidate terms of 1 input"), ("hammerstein:3/2", "1 <= nb <= nf")):
        row = report(bench, Method.parsed(text))["row"]
        assert reason in row["failed"]
        assert row["test"] == ""


def test_methods_are_understood_strictly():
    assert Method.parsed("oe:2/2") == Method("oe", (2, 2, 1))
    assert str(Method.parsed("okid:2")) == "okid:2/5"
    assert str(Method.parsed("hammerstein:2/2")) == "hammerstein:2/2/1"
    for text, match in (
        ("oe:2", "oe takes the orders"),
        ("hold:1", "method hold given orders"),
        ("ox:2/2", "unknown method 'ox'"),
        ("narx:2/2/1", "narx takes the orders na nb nk degree"),
        ("neural_ss:3/0", "neurons = 0 given, expected 1 or more"),
        ("oe:2/-2", "expected a method with its orders"),
    ):
        refused(match, Method.parsed, text)
    refused("each once", BaselineSpec, models=("oe:2/2", "oe:2/2/1"))


def test_scores_of_the_command_are_those_of_the_function(small, tmp_path, printed, result, complaint):
    hats = {record.name: record.y + 0.001 for record in small.test}
    for name, hat in hats.items():
        (tmp_path / f"{name}.csv").write_text("elbow_pitch\n" + "\n".join(map(repr, hat.tolist())))
    scored = result("dataset", "score", tmp_path, "--data", small.folder)
    assert scored["mean"] == score(hats, small).mean == pytest.approx(1.0)
    assert (scored["metric"], scored["unit"], scored["steps"]) == ("rmse", "mrad", 0)
    text = printed("dataset", "score", tmp_path, "--data", small.folder)
    assert "score: 1 mrad (rmse in simulation, mean over all records and outputs)" in text
    complaint("dataset", "score", tmp_path / "none", "--data", small.folder)


@pytest.mark.parametrize(("noise", "steps", "warns"), [(0.001, 1, True), (0.001, 0, False), (0.0, 1, False)])
def test_a_bound_that_no_model_reaches_has_a_note(tiny, tiny_spec, noise, steps, warns):
    records = tuple(replace(block, process_noises=(noise,)) for block in tiny_spec.records)
    plan = DataSetPlan(replace(tiny_spec, records=records, scoring=Scoring(steps=steps)))
    (table,) = attainable_files(plan, tiny, "table").values()
    (row,) = csv.DictReader(io.StringIO(table.decode()))
    assert ("no model does" in row["note"]) is warns
