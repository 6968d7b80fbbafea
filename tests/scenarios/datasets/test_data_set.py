"""Opening a data set, and its records in the shape of public benchmarks."""

import json
import os
import shutil
from fractions import Fraction

import h5py
import numpy as np
import pytest

from scenarios.datasets import DataRecord, load, open_data_set
from scenarios.datasets.index import read_index
from sysid import arx
from sysid.records import reading_process
from tests.refusals import refused


def test_three_lines_load_train_and_test(tiny):
    train, test = load(tiny, joint="elbow_pitch")
    assert isinstance(train, DataRecord) and isinstance(test, DataRecord)
    u, y = train
    assert u.shape == y.shape == (200,) == (len(train),)
    assert np.array_equal(train[0], u) and np.array_equal(train[1], y) and not np.array_equal(u, test.u)
    assert (train.name, train.sampling_time, train.signals.dt) == ("binary-elbow_pitch", 0.02, Fraction(1, 50))
    assert (train.state_initialization_window_length, test.state_initialization_window_length) == (None, 20)
    with pytest.raises(ValueError, match="read-only"):
        u[0] = 1.0
    # A part with several records is a tuple of them.
    train, test = load(tiny)
    assert isinstance(train, tuple) and [record.joints for record in train] == [("shoulder_yaw",), ("elbow_pitch",)]
    assert isinstance(test, DataRecord)


def test_a_record_goes_to_the_estimators_with_names_units_and_window(data_set):
    data = data_set.record("noise").iodata()
    assert (data.input_names, data.output_names) == (("elbow_pitch commanded",), ("elbow_pitch measured",))
    assert (data.output_units, data.dt, data.window) == (("rad",), 0.02, 20)
    assert data.name == "noise" and data.intersample == "zoh"
    train = data_set.select(joint="elbow_pitch").train[0].iodata()
    assert train.window == 0
    assert np.isfinite(arx(train.detrend(), 2, 2).residuals).all()


def test_consecutive_samples_keep_what_is_left_of_the_window(data_set):
    record = data_set.record("noise")
    part = record[5:50]
    assert np.array_equal(part.u, record.u[5:50]) and part.name == "noise"
    windows = [one.state_initialization_window_length for one in (record, part, part[10:], part[20:])]
    assert windows == [20, 15, 5, 0]
    for wrong in (2, slice(0, 10, 2), slice(8, 8)):
        refused("expected", record.__getitem__, wrong)


def test_the_whole_data_set_is_reachable(tiny, data_set, tiny_spec, copy):
    assert [len(data_set.train), len(data_set.validation), len(data_set.test), len(data_set.records())] == [2, 0, 1, 3]
    assert (data_set.label, data_set.failed, data_set.spec) == ("tiny-v1", {}, tiny_spec)
    assert (data_set.truth, data_set.arms) == (tiny / "truth", ("arm-0",))
    assert data_set.records("test")[0].name == "noise"
    shutil.rmtree(copy / "truth")
    (copy / "spec.toml").unlink()
    assert open_data_set(copy).truth is None and len(load(copy, joint="elbow_pitch")[0]) == 200


def test_a_fleet_opens_without_reading_its_records(tmp_path):
    common = {"part": "train", "block": "b", "joints": ["elbow_pitch"], "failed": None}
    lines = [
        {**common, "name": f"n{k}", "arm": f"twin-{k}-arm-0", "twin": k, "file": f"data/train/n{k}.nc"}
        for k in range(3000)
    ]
    (tmp_path / "experiments.json").write_text(json.dumps({"data_set": "fleet-v1", "hash": "0", "experiments": lines}))
    fleet = open_data_set(tmp_path)  # none of its 3000 files is there
    assert len(fleet.train) == 3000 and len(fleet.select(twin=7).train) == 1
    assert "n7" in repr(fleet.select(twin=7).train[0])
    refused(r"no file .*n7\.nc", lambda: fleet.record("n7").u)


@pytest.mark.parametrize(
    ("selection", "message"),
    [
        ({"joint": "wrist_roll"}, "no experiment with joints = wrist_roll; there are: shoulder_yaw; elbow_pitch"),
        ({"joint": ("elbow_pitch", "shoulder_yaw")}, "joints = elbow_pitch, shoulder_yaw"),
        ({"block": "bnary"}, "'binary'; 'noise'"),
        ({"twin": 3}, "twin = 3"),
        ({"joint": "shoulder_yaw"}, "no test records selected, but 1 for train"),
    ],
)
def test_an_empty_selection_is_refused_with_what_there_is(tiny, selection, message):
    refused(message, load, tiny, **selection)


def test_no_data_set_is_refused_with_the_reason(data_set, tmp_path):
    (tmp_path / "late-v1.unfinished").mkdir()
    refused("no such folder", load, tmp_path / "none")
    refused(r"no experiments\.json", load, tmp_path)
    refused("not built to its end", load, tmp_path / "late-v1")
    refused("unknown part 'tests'", data_set.records, "tests")
    refused("unknown experiment 'nois'", data_set.record, "nois")


@pytest.mark.parametrize(
    "damage",
    [
        lambda index: index.pop("hash"),
        lambda index: index["experiments"][0].pop("part"),
        lambda index: index["experiments"][0].update(file="../data/train/x.nc"),
        lambda index: index["experiments"][0].update(file="/data/train/x.nc"),
        lambda index: index["experiments"][0].update(name=None),
        lambda index: index["experiments"][0].update(arrays=1),
        lambda index: index.update(experiments=3),
        None,
    ],
)
def test_a_damaged_index_is_refused(tiny, tmp_path, damage):
    index = read_index(tiny)
    if damage is not None:
        damage(index)
    (tmp_path / "experiments.json").write_text(json.dumps(index) if damage else "[" * 200_000)
    refused(r"experiments\.json is damaged", open_data_set, tmp_path)


@pytest.mark.slow
def test_a_swapped_or_damaged_file_and_a_pipe_are_refused(copy, monkeypatch):
    first, second = (copy / f"data/train/binary-{joint}.nc" for joint in ("shoulder_yaw", "elbow_pitch"))
    shutil.copy(second, first)
    refused("'binary-elbow_pitch', expected 'binary-shoulder_yaw'", lambda: open_data_set(copy).train[0].u)
    first.write_bytes(second.read_bytes()[:1000])
    refused("damaged", lambda: open_data_set(copy).train[0].u)
    with h5py.File(second, "r+") as file:
        file["y"][100, 0] = 5.0
    refused("y differs from what the index says; see hmtb dataset check", lambda: open_data_set(copy).train[1].y)
    with h5py.File(second, "r+") as file:
        file.attrs["sampling_time_denominator"] = 0
    refused("differs|is damaged", lambda: open_data_set(copy).train[1].y)
    content = bytearray(second.read_bytes())
    heap = content.index(b"GCOL")
    content[heap + 16 : heap + 32] = bytes(16)  # on which the HDF5 library would loop
    second.write_bytes(content)
    monkeypatch.setattr(reading_process, "PATIENCE", 4.0)
    refused("did not end within 4 s", lambda: open_data_set(copy).train[1].y)
    first.unlink()
    os.mkfifo(first)
    refused(r"binary-shoulder_yaw\.nc is no ordinary file", lambda: open_data_set(copy).train[0].u)


@pytest.mark.parametrize("words", [{"name": "../x"}, {"part": "../.."}, {"data_set": "../../escaped"}])
def test_no_name_of_an_index_leads_out_of_a_folder(tiny, tmp_path, words):
    index = read_index(tiny)
    (index if "data_set" in words else index["experiments"][0]).update(words)
    (tmp_path / "experiments.json").write_text(json.dumps(index))
    refused("names no", open_data_set, tmp_path)


def test_a_failed_experiment_is_listed_and_left_out(tiny, tmp_path):
    index = read_index(tiny)
    index["experiments"][0]["failed"] = "it fell over"
    (tmp_path / "experiments.json").write_text(json.dumps(index))
    opened = open_data_set(tmp_path)
    assert opened.failed == {"binary-shoulder_yaw": "it fell over"} and len(opened.train) == 1
    refused("it fell over", opened.record, "binary-shoulder_yaw")
