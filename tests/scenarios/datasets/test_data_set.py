"""Opening a data set, and its records in the shape that others know."""

import json
import os
import shutil
from fractions import Fraction
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from scenarios.datasets import DataRecord, load, open_data_set
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.errors import ScenarioError
from sysid import arx


def test_three_lines_load_train_and_test(tiny: Path) -> None:
    train, test = load(tiny, joint="elbow_pitch")
    assert isinstance(train, DataRecord) and isinstance(test, DataRecord)
    u, y = train
    assert u.shape == y.shape == (200,) == (len(train),)
    assert train[0] is not None and np.array_equal(train[0], u) and np.array_equal(train[1], y)
    assert (train.name, train.sampling_time) == ("binary-elbow_pitch", 0.02)
    assert train.signals.dt == Fraction(1, 50)
    assert train.state_initialization_window_length is None
    assert test.state_initialization_window_length == 20
    assert not np.array_equal(u, test.u)
    with pytest.raises(ValueError, match="read-only"):
        u[0] = 1.0
    # A part with several records is a tuple of them.
    train, test = load(tiny)
    assert isinstance(train, tuple) and [record.joints for record in train] == [("shoulder_yaw",), ("elbow_pitch",)]
    assert isinstance(test, DataRecord)


def test_numbers_are_those_that_other_readers_find(tiny: Path) -> None:
    record = open_data_set(tiny).record("noise")
    path = tiny / "data/test/noise.nc"
    with xr.open_dataset(path, engine="h5netcdf") as found:
        assert np.array_equal(found.u.values[:, 0], record.u) and np.array_equal(found.y.values[:, 0], record.y)
        assert found.u.attrs["units"] == "rad" and found.attrs["sampling_time_denominator"] == 50
        assert list(found.u.coords["input"].values) == ["elbow_pitch"]
        assert np.array_equal(found["sample"], np.arange(200)) and found["sample"].dtype == np.int64
    with h5py.File(path) as file:
        assert np.array_equal(file["y"][:, 0], record.y)


def test_a_record_goes_to_the_estimators_with_names_units_and_window(tiny: Path) -> None:
    data = open_data_set(tiny).record("noise").iodata()
    assert (data.input_names, data.output_units, data.dt, data.window) == (("elbow_pitch",), ("rad",), 0.02, 20)
    assert data.name == "noise" and data.intersample == "zoh"
    train = open_data_set(tiny).select(joint="elbow_pitch").train[0].iodata()
    assert train.window == 0
    assert np.isfinite(arx(train.detrend(), 2, 2).residuals).all()


def test_consecutive_samples_keep_what_is_left_of_the_window(tiny: Path) -> None:
    record = open_data_set(tiny).record("noise")
    part = record[5:50]
    assert np.array_equal(part.u, record.u[5:50]) and part.state_initialization_window_length == 15
    assert part[10:].state_initialization_window_length == 5 and part[20:].state_initialization_window_length == 0
    assert part.name == "noise" and record.state_initialization_window_length == 20
    for wrong in (2, slice(0, 10, 2), slice(8, 8)):
        with pytest.raises(ScenarioError, match="expected"):
            record[wrong]


def test_the_whole_data_set_is_reachable(tiny: Path, tiny_spec: DataSetSpec, tmp_path: Path) -> None:
    found = open_data_set(str(tiny))
    assert [len(found.train), len(found.validation), len(found.test)] == [2, 0, 1]
    assert (found.label, found.failed, found.spec) == ("tiny-v1", {}, tiny_spec)
    assert found.truth == tiny / "truth" and found.arms == ("arm-0",)
    assert found.records("test")[0].name == "noise" and len(found.records()) == 3
    folder = shutil.copytree(tiny, tmp_path / "copy", ignore=shutil.ignore_patterns("truth", "spec.toml"))
    assert open_data_set(folder).truth is None and len(load(folder, joint="elbow_pitch")[0]) == 200


def test_a_fleet_opens_without_reading_its_records(tmp_path: Path) -> None:
    listing = {"part": "train", "block": "b", "joints": ["elbow_pitch"], "failed": None}
    lines = [
        {**listing, "name": f"n{k}", "arm": f"twin-{k}-arm-0", "twin": k, "file": f"data/train/n{k}.nc"}
        for k in range(3000)
    ]
    (tmp_path / "experiments.json").write_text(json.dumps({"data_set": "fleet-v1", "hash": "0", "experiments": lines}))
    found = open_data_set(tmp_path)  # none of its 3000 files is there
    assert len(found.train) == 3000 and len(found.select(twin=7).train) == 1
    assert "n7" in repr(found.select(twin=7).train[0])
    with pytest.raises(ScenarioError, match=r"no file .*n7\.nc"):
        found.record("n7").u  # noqa: B018 - the look at it reads it


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ({"joint": "wrist_roll"}, "no experiment with joints = wrist_roll; there are: shoulder_yaw; elbow_pitch"),
        ({"joint": ("elbow_pitch", "shoulder_yaw")}, "joints = elbow_pitch, shoulder_yaw"),
        ({"block": "bnary"}, "'binary'; 'noise'"),
        ({"twin": 3}, "twin = 3"),
        ({"joint": "shoulder_yaw"}, "no test records selected, but 1 for train"),
    ],
)
def test_what_is_not_there_is_said_with_what_is(tiny: Path, wanted: dict, said: str) -> None:
    with pytest.raises(ScenarioError, match=said):
        load(tiny, **wanted)


def test_no_data_set_is_refused_with_the_reason(tiny: Path, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="no such folder"):
        load(tmp_path / "none")
    with pytest.raises(ScenarioError, match=r"no experiments\.json"):
        load(tmp_path)
    (tmp_path / "late-v1.unfinished").mkdir()
    with pytest.raises(ScenarioError, match="not built to its end"):
        load(tmp_path / "late-v1")
    with pytest.raises(ScenarioError, match="unknown part 'tests'"):
        open_data_set(tiny).records("tests")
    with pytest.raises(ScenarioError, match="unknown experiment 'nois'"):
        open_data_set(tiny).record("nois")


@pytest.mark.parametrize(
    "broken",
    [
        lambda index: index.pop("hash"),
        lambda index: index["experiments"][0].pop("part"),
        lambda index: index["experiments"][0].update(file="../data/train/x.nc"),
        lambda index: index["experiments"][0].update(file="/data/train/x.nc"),
        lambda index: index.update(experiments=3),
    ],
)
def test_a_damaged_index_is_refused(tiny: Path, tmp_path: Path, broken) -> None:
    index = json.loads((tiny / "experiments.json").read_text())
    broken(index)
    (tmp_path / "experiments.json").write_text(json.dumps(index))
    with pytest.raises(ScenarioError, match=r"experiments\.json is damaged"):
        open_data_set(tmp_path)


def test_an_index_nested_without_end_and_a_pipe_in_place_of_a_record_are_refused(tiny: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(tiny, tmp_path / "copy")
    record = folder / "data" / "train" / "binary-elbow_pitch.nc"
    record.unlink()
    os.mkfifo(record)
    with pytest.raises(ScenarioError, match=r"binary-elbow_pitch\.nc is no ordinary file"):
        [one.u for one in open_data_set(folder).train]
    (folder / "experiments.json").write_text("[" * 200_000)
    with pytest.raises(ScenarioError, match=r"experiments\.json is damaged"):
        open_data_set(folder)


def test_a_swapped_or_damaged_file_is_refused(tiny: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(tiny, tmp_path / "copy")
    first, second = (folder / f"data/train/binary-{joint}.nc" for joint in ("shoulder_yaw", "elbow_pitch"))
    shutil.copy(second, first)
    with pytest.raises(ScenarioError, match="is of experiment 'binary-elbow_pitch', expected 'binary-shoulder_yaw'"):
        open_data_set(folder).train[0].u  # noqa: B018
    first.write_bytes(second.read_bytes()[:1000])
    with pytest.raises(ScenarioError, match="damaged"):
        open_data_set(folder).train[0].u  # noqa: B018


def test_a_failed_experiment_is_listed_and_left_out(tiny: Path, tmp_path: Path) -> None:
    index = json.loads((tiny / "experiments.json").read_text())
    index["experiments"][0]["failed"] = "it fell over"
    (tmp_path / "experiments.json").write_text(json.dumps(index))
    found = open_data_set(tmp_path)
    assert found.failed == {"binary-shoulder_yaw": "it fell over"} and len(found.train) == 1
    with pytest.raises(ScenarioError, match="it fell over"):
        found.record("binary-shoulder_yaw")
