"""Data sets for classes: nothing published reveals the truth, and submissions are graded on the complete data."""

import json
import os
import shutil
import stat
import struct
import tempfile
from dataclasses import replace

import h5py
import numpy as np
import pytest

from hmtb_twin.files.netcdf import read_netcdf
from scenarios.datasets import open_data_set
from scenarios.datasets import withhold as withhold_module
from scenarios.datasets.arm_truth import read_arm
from scenarios.datasets.build import build
from scenarios.datasets.check import examine
from scenarios.datasets.grade import Grade, grade_all
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.score import Score, Scores, score_model
from scenarios.datasets.spec import Scoring
from scenarios.datasets.withhold import build_withheld, check_withholdable, read_persons, read_roster
from scenarios.experiments.registry import names
from sysid import oe, write_model
from sysid.validation.predictors import ModelPredictor
from tests.mat_bytes import HEAD, nested, part, variable
from tests.refusals import refused

RUN = 6
"""Withheld samples in a row that are no coincidence: a single one is a count of the resolver, and in every record."""


def contents(folder):
    """Every file as it is, and every array and attribute of NetCDF files without compression."""
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        yield path.name, path.name.encode() + b"\n" + path.read_bytes()
        if path.suffix != ".nc":
            continue
        with h5py.File(path) as file:
            values = [value for entry in (file, *file.values()) for value in entry.attrs.values()]
            values += [entry[...] for entry in file.values()]
        for array in map(np.asarray, values):
            numbers = array.dtype.kind in "biufc"
            yield path.name, array.tobytes() if numbers else b"\n".join(str(one).encode() for one in array.ravel())


def secrets_of(complete):
    """Whatever would give the truth away, as text and as bytes."""
    forms = {"seed": {str(complete.seed).encode(), struct.pack("<Q", complete.seed)}}
    for entry in DataSetPlan(complete):
        one = entry.experiment
        for seed in (one.seed, *(e.parameters["seed"] for e in one.excitation if "seed" in e.parameters)):
            forms[f"seed of {entry.name}"] = {str(seed).encode(), struct.pack("<Q", seed)}
        for value in (one.plant.supply_pressure, one.plant.process_noise, *one.specimen.kp, *one.specimen.mass):
            forms[f"drawn {value}"] = {repr(float(value)).encode(), f"{value:.9g}".encode(), struct.pack("<d", value)}
    return forms


@pytest.mark.slow
def test_no_published_byte_reveals_a_secret(school):
    complete = school.withheld / school.ann.name
    forms = secrets_of(open_data_set(complete).spec)
    assert sum(name.startswith("drawn") for name in forms) >= 10
    for place, content in contents(school.ann):
        for secret, texts in forms.items():
            assert not any(text in content for text in texts), f"{secret} in {place}"
    # The search finds them where they are.
    everything = b"\n".join(content for _, content in contents(complete))
    assert all(any(text in everything for text in texts) for texts in forms.values())
    assert not (school.ann / "truth").exists() and not (school.ann / "baselines").exists()
    baselines = (school.ann / "baselines.csv").read_text()
    assert "oe" in baselines and "truth" not in baselines
    assert stat.S_IMODE(school.withheld.stat().st_mode) == 0o700


@pytest.mark.slow
def test_outputs_behind_the_window_of_a_scored_record_are_not_published(school):
    place = "data/test/twin-0-noise.nc"
    complete, public = (
        read_netcdf(folder / place).variables for folder in (school.withheld / school.ann.name, school.ann)
    )
    assert {name for name, one in public.items() if "sample" in one.dims} == {"sample", "t", "u", "joint_commanded"}
    assert np.array_equal(public["y"].values, complete["y"].values[:20])
    assert np.array_equal(public["u"].values, complete["u"].values)
    published = b"\n".join(content for _, content in contents(school.ann))
    for name in ("y", "joint_measured", "force", "torque"):
        for column in complete[name].values.T:
            for begin in range(20, len(column) - RUN):
                run = column[begin : begin + RUN]
                if len(np.unique(run)) == RUN:  # a joint that stands still is no secret
                    assert run.tobytes() not in published, f"{name} from sample {begin} on"


def truth_of(school):
    (path,) = (school.withheld / school.ann.name / "truth/arms").iterdir()
    return read_arm(path).joints["elbow_pitch"]


@pytest.mark.slow
def test_public_data_sets_load_check_and_cannot_be_scored_or_built(school):
    ann, bob = (open_data_set(folder) for folder in (school.ann, school.bob))
    assert ann.label == "class-ann-v1" and ann.hash != bob.hash
    assert not np.array_equal(ann.train[0].u, bob.train[0].u)
    record, complete = ann.test[0], open_data_set(school.withheld / ann.label).test[0]
    assert record.y.shape == (20,) and len(record) == 200 and record[5:100].y.shape == (15,)
    data = record.iodata()
    assert data.missing and np.isnan(data.y).sum() == 180 and data.window == 20
    model = ModelPredictor(truth_of(school).model)
    assert model.predicted(data, 0) == pytest.approx(model.predicted(complete.iodata(), 0), rel=1e-10)
    refused("behind the window are withheld", score_model, model, ann)
    refused("cannot be built", build, ann.spec, school.withheld)
    result = examine(school.ann)
    assert result.passed and any("withheld" in note for note in result.notes)


@pytest.mark.reliability
def test_an_interrupted_build_keeps_its_seeds_and_resumes(school, tmp_path, monkeypatch):
    spec = replace(school.spec, baselines=replace(school.spec.baselines, models=()))
    out, withheld = tmp_path / "out", tmp_path / "withheld"

    def interrupted(*_):
        raise KeyboardInterrupt

    def built(persons=("ann", "bob"), withheld=withheld):
        return build_withheld(spec, out, withheld, persons=persons)[0]

    with monkeypatch.context() as patch:
        patch.setattr(withhold_module, "metadata_files", interrupted)
        with pytest.raises(KeyboardInterrupt):
            built()
    seeds = read_persons(withheld)
    assert not list(out.glob("*")) and len(seeds) == 2
    refused("other persons", built, ("ann",))
    paths = built()
    assert [path.name for path in paths] == ["class-ann-v1", "class-bob-v1"] and read_persons(withheld) == seeds
    assert built() == paths
    (paths[0] / "SHA256SUMS").write_text("")
    refused("is another data set", built)
    refused("outside of what is published", built, ("ann",), out / "class-ann-v1" / "w")


def test_seeds_come_from_the_system_unless_one_is_given(tmp_path):
    def seeds(name, seed):
        (tmp_path / name).mkdir()
        return list(withhold_module._seeds(tmp_path / name, {"ann": "a", "bob": "b"}, seed).values())

    assert seeds("one", 3) == seeds("two", 3) != seeds("three", 4)
    drawn = [*seeds("four", None), *seeds("five", None)]
    assert len(set(drawn)) == 4 and max(drawn) > 2**50


@pytest.mark.slow
def test_specs_whose_truth_is_public_are_refused(school):
    weak = replace(school.spec.records[1], scenarios=(names("operator")[0],), axes=(), excitation=(), duration=None)
    for change, match in (
        ({"twins": None}, "anyone can compute their truth"),
        ({"scoring": replace(school.spec.scoring, steps=2)}, "need the withheld outputs"),
        ({"withheld": True}, "spec of a public data set"),
        ({"records": (school.spec.records[0], weak)}, "depend on the withheld outputs"),
    ):
        refused(match, check_withholdable, replace(school.spec, **change))


@pytest.mark.parametrize(
    ("text", "match"),
    [("", "no lines"), ("ann\n\nbob\n", "line 2: ''"), ("../ann\n", "line 1"), ("ann\nANN\n", "is there twice")],
)
def test_a_roster_is_read_strictly(tmp_path, text, match):
    path = tmp_path / "roster"
    path.write_text(text)
    refused(match, read_roster, path)
    path.write_text("ann\nbob-2\n")
    assert read_roster(path) == ("ann", "bob-2")


@pytest.mark.slow
def test_submissions_are_graded_as_hmtb_dataset_score_does(school, tmp_path, printed, result):
    complete = open_data_set(school.withheld / school.ann.name)
    truth = truth_of(school)
    model = {name: getattr(truth.model, name).tolist() for name in "ABCD"} | {"dt": 0.02}
    for person in ("ann", "bob", "eve"):
        (tmp_path / person).mkdir()
        (tmp_path / person / "model-elbow_pitch.json").write_text(json.dumps(model))
    write_model(truth.model, tmp_path / "bob" / "model-elbow_pitch.json")
    (record,) = complete.test
    predictions = "\n".join(map(repr, (record.y + 0.001).tolist()))
    (tmp_path / "ann" / f"{record.name}.csv").write_text(f"elbow_pitch\n{predictions}")
    graded = result("dataset", "grade", school.withheld, tmp_path, code=1)
    ann, bob = (graded["grades"][person] for person in ("ann", "bob"))
    assert (ann["score"], ann["unit"]) == (pytest.approx(1.0), "mrad")
    assert ann["best_baseline"]["method"].startswith("oe")
    assert ann["models"][0]["bandwidth_hz"] == pytest.approx(truth.bandwidth_hz) and ann["models"][0]["stable"]
    assert abs(ann["models"][0]["error_percent"]) < 1e-6 < abs(bob["models"][0]["error_percent"])
    # Without predictions the model is scored; the arm of ann is not that of bob.
    assert bob["score"] == pytest.approx(score_model(truth.model, school.withheld / "class-bob-v1").mean, rel=1e-9)
    assert "unknown person 'eve'" in graded["refused"]["eve"]
    assert "oe" in printed("dataset", "grade", school.withheld, tmp_path / "ann")
    assert not ann["too_good"] and graded["missing"] == []
    shutil.rmtree(tmp_path / "bob")
    assert result("dataset", "grade", school.withheld, tmp_path, code=1)["missing"] == ["bob"]


@pytest.mark.parametrize("text", ["[" * 100_000, '{"": {"data_set": "x", "seed": 1e400}}', '{"ann": 1}', "[]", "{"])
def test_a_damaged_list_of_persons_is_refused(tmp_path, text):
    (tmp_path / "persons.json").write_text(text)
    refused("cannot read .*persons.json", read_persons, tmp_path)


def test_a_folder_that_others_may_open_keeps_no_secret(tmp_path, school):
    (tmp_path / "open").mkdir()
    # Whatever the mask of the process takes away.
    (tmp_path / "open").chmod(0o755)
    refused("others may open it", build_withheld, school.spec, tmp_path / "out", tmp_path / "open")
    refused("a seed is a whole number", build_withheld, school.spec, tmp_path / "out", tmp_path / "new", seed=-1)


@pytest.mark.parametrize(("metric", "copied", "honest"), [("rmse", 0.0, 0.031), ("fit", 100.0, 99.0)])
def test_a_score_that_the_noise_forbids_is_marked(metric, copied, honest):
    by_chance = {"rmse": 0.03, "fit": 99.5}[metric]
    for value, expected in ((copied, True), (honest, False)):
        scores = Scores(Scoring(metric), (Score("test", "elbow_pitch", value),))
        assert Grade("set", scores, None, by_chance, {}, ()).too_good is expected
        assert not Grade("set", scores, None, None, {}, ()).too_good


@pytest.mark.reliability
def test_broken_submissions_are_refused_one_by_one(school, tmp_path):
    ann, bob = tmp_path / "ann", tmp_path / "bob"
    ann.mkdir()
    bob.mkdir()
    (bob / "notes.md").write_text("nothing")

    def refusal(text, name="model-elbow_pitch.json"):
        for path in ann.iterdir():
            path.unlink()
        (ann / name).write_text(text)
        grades = grade_all(school.withheld, tmp_path)
        assert "no predictions" in grades["bob"]
        return grades["ann"]

    assert "unknown joint" in refusal("{}", "model-elbow.json")
    assert "missing" in refusal("{}")
    assert "one of each" in refusal('{"A": [[0.5]], "B": [[1, 1]], "C": [[1]], "D": [[0, 0]], "dt": 0.02}')
    assert "without a sampling interval" in refusal(
        '{"format": "sysid-model", "version": 1, "software": "x", '
        '"polynomials": {"A": [1], "B": [1], "C": [1], "D": [1], "F": [1]}}'
    )
    assert "A" in refusal('{"A": [["a"]], "B": [[1]], "C": [[1]], "D": [[0]], "dt": 0.02}')
    # a delay of five hours in a file of 3 MB: the state would take 7 TiB
    file = write_model(oe(open_data_set(school.ann).train[0].iodata(), 1, 1, 1), tmp_path / "model.json")
    table = json.loads(file.read_text())
    file.unlink()
    table["estimate"]["polynomials"]["B"][:1] = [0] * 10**6
    table["estimate"]["layout"]["nk"] = [10**6]
    assert "model-elbow_pitch.json: Unable to allocate" in refusal(json.dumps(table))
    assert "no test record" in refusal("elbow_pitch\n0\n", "other.csv")
    # A link could lead to the withheld answer.
    (ann / "other.csv").unlink()
    (ann / "twin-0-noise.nc").symlink_to(school.withheld / "class-ann-v1/data/test/twin-0-noise.nc")
    assert "is a link" in str(grade_all(school.withheld, tmp_path)["ann"])
    (ann / "twin-0-noise.nc").unlink()
    os.mkfifo(ann / "twin-0-noise.nc")
    assert "a pipe" in str(grade_all(school.withheld, tmp_path)["ann"])
    (ann / "twin-0-noise.nc").unlink()
    assert "expected at most" in refusal("elbow_pitch\n" + 100_000 * "0.5\n", "twin-0-noise.csv")
    # The work of another person under one's own name; what a version control system keeps is no submission.
    shutil.rmtree(bob)
    bob.symlink_to(ann)
    (tmp_path / ".git").mkdir()
    (tmp_path / "a.mat").mkdir()  # a folder that is named like a file of predictions
    assert "is a link" in str(grade_all(school.withheld, tmp_path)["bob"])
    assert sorted(grade_all(school.withheld, tmp_path)) == ["a.mat", "ann", "bob"]
    bob.unlink()
    refused(r"cannot read .*persons\.json", grade_all, tmp_path, tmp_path)
    refused("no folder", grade_all, school.withheld, tmp_path / "absent")


@pytest.mark.slow
def test_a_damaged_submission_ends_no_grading_and_leaves_nothing_behind(school, tmp_path, monkeypatch):
    submissions, scratch = tmp_path / "submissions", tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    (record,) = open_data_set(school.withheld / school.bob.name).test
    damage = {"ann": variable("y", part(200, bytes(8))), "bob": nested(20_000)}
    for person, content in damage.items():
        (submissions / person).mkdir(parents=True)
        (submissions / person / f"{record.name}.mat").write_bytes(HEAD + content)
    grades = grade_all(school.withheld, submissions)
    # SciPy looks a type that does not exist up outside of its table: what it finds there differs from run to run
    for person in damage:
        assert f"{person}/{record.name}.mat" in grades[person] and "not a .mat file" in grades[person]
    assert "reading it crashed" in grades["bob"]
    assert list(scratch.iterdir()) == []
