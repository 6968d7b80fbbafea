"""Every format holds the same numbers, to the last bit, and nothing of the truth."""

import json
import os
import re
import shutil
import subprocess
import sys
from contextlib import chdir
from hashlib import sha256
from pathlib import Path

import mlcroissant
import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
import yaml
from scipy.io import loadmat

import sysid
from hmtb_twin.files.netcdf import Contents, Variable, read_netcdf
from scenarios.datasets.index import read_index
from scenarios.datasets.withhold import public_contents
from scenarios.exchange.exporter import FORMATS, export
from scenarios.exchange.part_tables import PartTables
from scenarios.exchange.record_files import LARGEST, ascii_table, columns, csv, csv_metadata, mat
from tests.refusals import refused


@pytest.fixture(scope="module")
def exported(tiny, tmp_path_factory):
    # A copy without its truth: nothing but the index and the data may be needed.
    place = tmp_path_factory.mktemp("exported")
    folder = shutil.copytree(tiny, place / "set", ignore=shutil.ignore_patterns("truth", "manifest.jsonl"))
    (folder / "LICENSE").write_text("CC BY 4.0\n")
    return dict(zip(FORMATS, export(folder, place / "out", tuple(FORMATS)), strict=True))


@pytest.fixture
def contents(tiny):
    return read_netcdf(tiny / "data/test/noise.nc")


def same_bits(stored, expected):
    """Also minus zero is one, and the types agree."""
    return stored.dtype == expected.dtype and stored.shape == expected.shape and stored.tobytes() == expected.tobytes()


def test_the_mat_file_holds_the_bits(exported, contents):
    stored = loadmat(exported["mat"] / "test/noise.mat")
    for name, variable in contents.variables.items():
        if variable.values.dtype.kind == "U":
            assert [str(cell[0]) for cell in stored[f"{name}_names"].ravel()] == list(variable.values)
        else:
            expected = variable.values if variable.values.ndim == 2 else variable.values[:, None]
            assert same_bits(np.ascontiguousarray(stored[name]), np.ascontiguousarray(expected)), name
    assert stored["dt"].item() == 0.02
    plain = loadmat(exported["mat"] / "test/noise.mat", simplify_cells=True)
    assert plain["units"]["u"] == "rad" and (plain["units"]["force"], plain["units"]["torque"]) == ("N", "N m")
    assert plain["about"]["sampling_time_denominator"] == 50 and plain["about"]["part"] == "test"


def test_the_tables_hold_the_bits(exported, contents):
    table = columns(contents)
    header, *lines = (exported["csv"] / "test/noise.csv").read_text().splitlines()
    cells = [line.split(",") for line in lines]
    assert header.split(",") == [f"{column.name} [{column.unit}]" for column in table]
    assert header.startswith("sample [1],t [s],u_elbow_pitch [rad],y_elbow_pitch [rad],") and "torque_z [N m]" in header
    for number, column in enumerate(table):
        assert same_bits(np.array([row[number] for row in cells]).astype(column.values.dtype), column.values)
    metadata = json.loads((exported["csv"] / "test/noise.csv-metadata.json").read_text())
    assert metadata["url"] == "noise.csv" and metadata["hmtb:sampling_time_denominator"] == 50
    assert [entry["titles"] for entry in metadata["tableSchema"]["columns"]] == header.split(",")
    assert [entry["datatype"] for entry in metadata["tableSchema"]["columns"]][:3] == ["integer", "double", "double"]
    path = exported["ascii"] / "test/noise.txt"
    numbers = np.column_stack([column.values.astype(float) for column in table])
    assert same_bits(np.loadtxt(path, comments="%"), numbers)
    assert {"% column 3: u_elbow_pitch, rad", "% sampling time: 1/50 s"} <= set(path.read_text().splitlines())


def test_the_analyst_reads_mat_and_csv(exported, data_set):
    expected = data_set.record("noise").iodata()
    named = {"inputs": ("u_elbow_pitch [rad]",), "outputs": ("y_elbow_pitch [rad]",)}
    for data in (
        sysid.read_csv(exported["csv"] / "test/noise.csv", **named, dt=0.02),
        sysid.read_mat(exported["mat"] / "test/noise.mat"),
    ):
        assert np.array_equal(data.u, expected.u) and np.array_equal(data.y, expected.y) and data.dt == expected.dt


def test_the_parquet_tables_hold_the_bits_and_the_units(exported, data_set, contents):
    """A table for each part with the records in order; null where a record has no such channel."""
    stored = pq.read_table(exported["parquet"] / "test.parquet")
    rows = stored.filter(pc.equal(stored["experiment"], "noise"))
    assert rows.column_names[:6] == ["experiment", "block", "arm", "joints", "sample", "t"]
    for column in columns(contents):
        assert same_bits(rows[column.name].to_numpy(), np.ascontiguousarray(column.values)), column.name
        assert stored.schema.field(column.name).metadata[b"unit"] == column.unit.encode()
    assert set(rows["joints"].to_pylist()) == {"elbow_pitch"}
    assert stored.schema.metadata[b"data_set"] == b"tiny-v1"
    for part in ("train", "test"):
        table = pq.ParquetFile(exported["parquet"] / f"{part}.parquet")
        assert table.schema_arrow == stored.schema
        assert table.num_row_groups == len(data_set.records(part))
        named = table.read()["experiment"].to_pylist()
        assert named == [one.name for one in data_set.records(part) for _ in range(len(one))]


def test_channels_that_a_record_lacks_and_withheld_outputs_are_null(data_set, contents, tiny_spec, tmp_path):
    tables = PartTables(tmp_path, data_set)
    record = data_set.record("noise")
    tables.add(record, contents)
    tables.add(record, public_contents(contents, "test", tiny_spec.window))
    other = dict(contents.variables)
    del other["force"]
    tables.add(record, Contents(other, contents.attributes))
    strange = {**contents.variables, "strange": contents.variables["status"]}
    refused("noise has the channels strange", tables.add, record, Contents(strange, contents.attributes))
    tables.close()
    _, public, less = np.array_split(np.arange(600), 3)
    stored = pq.read_table(tmp_path / "test.parquet")
    assert stored["y_elbow_pitch"].is_null().to_numpy().nonzero()[0].tolist() == public[20:].tolist()
    assert stored["status"].is_null().to_numpy().nonzero()[0].tolist() == public[20:].tolist()
    assert stored["force_x"].is_null().to_numpy().nonzero()[0].tolist() == [*public[20:], *less]
    assert stored["t"].to_pylist()[400:403] == [0.0, 0.02, 0.04] and stored["sample"].null_count == 0


@pytest.mark.slow
def test_the_public_name_is_the_function():
    code = (
        "from scenarios.exchange import export; import scenarios.exchange; assert callable(scenarios.exchange.export)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_card_says_where_the_parts_are(exported, tiny_spec):
    _, front, body = (exported["parquet"] / "README.md").read_text(encoding="utf-8").split("---\n", 2)
    card = yaml.safe_load(front)
    assert card["pretty_name"] == tiny_spec.title and card["license"] == "cc-by-4.0"
    splits = {entry["split"]: entry["path"] for entry in card["configs"][0]["data_files"]}
    assert splits == {part: f"{part}.parquet" for part in ("train", "test")}
    assert card["size_categories"] == ["n<1K"]
    (example,) = re.findall(r"```python\n(.*?)```", body, re.S)
    names: dict = {}
    with chdir(exported["parquet"]):
        exec(example, names)
    assert names["u"].shape == names["y"].shape == (200, 1)


@pytest.mark.slow
def test_croissant_reads_the_tables(exported, data_set):
    entry = mlcroissant.Dataset(exported["parquet"] / "croissant.json")
    assert not entry.metadata.ctx.issues.errors
    train = data_set.train[0]
    records = list(entry.records("train"))[: len(train)]
    assert [row["train/t"] for row in records] == pytest.approx(np.arange(len(train)) / 50)
    assert [row[f"train/y_{train.joints[0]}"] for row in records] == train.y.tolist()
    assert {row["train/experiment"] for row in records} == {train.name.encode()}


def test_an_export_is_described_and_has_checksums(exported, data_set, contents, monkeypatch):
    monkeypatch.setattr("time.asctime", lambda: "another time")
    for file, to_bytes in {
        "mat/test/noise.mat": mat,
        "csv/test/noise.csv": csv,
        "ascii/test/noise.txt": ascii_table,
    }.items():
        name, _, path = file.partition("/")
        assert (exported[name] / path).read_bytes() == to_bytes(contents)
    assert set(exported) == set(FORMATS)
    for name, folder in exported.items():
        assert folder.name == f"tiny-v1-{name}" and (folder / "LICENSE").read_text() == "CC BY 4.0\n"
        index = json.loads((folder / "export.json").read_text())
        assert index["hash"] == data_set.records_hash and len(index["records"]) == 3
        assert all((folder / record["file"]).is_file() for record in index["records"])
        sums = dict(reversed(line.split("  ")) for line in (folder / "SHA256SUMS").read_text().splitlines())
        files = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()} - {"SHA256SUMS"}
        assert set(sums) == files
        assert all(sha256((folder / file).read_bytes()).hexdigest() == hash for file, hash in sums.items())


def test_lost_samples_and_extremes_come_back():
    values = np.array([[np.nan], [-0.0], [5e-324], [1.7976931348623157e308], [0.1]])
    names = Variable(("output",), np.array(["a"]), {})
    y = Variable(("sample", "output"), values, {"units": "rad", "role": "output"})
    about = {"sampling_time_numerator": 1, "sampling_time_denominator": 50}
    contents = Contents({"y": y, "output": names}, about)
    text = csv(contents).decode().splitlines()
    assert text == ["y_a [rad]", "NaN", "-0.0", "5e-324", "1.7976931348623157e+308", "0.1"]
    assert np.array([float(line) for line in text[1:]]).tobytes() == values.tobytes()


def test_withheld_outputs_are_missing_in_tables_and_absent_in_mat_files(contents, tiny_spec, tmp_path):
    shown = public_contents(contents, "test", tiny_spec.window)
    before, after = ({column.name: column.with_nan for column in columns(one)} for one in (contents, shown))
    assert list(after) == list(before)
    for name, values in after.items():
        if name == "t" or name.startswith(("u_", "sample")) or name.endswith("_commanded"):
            assert same_bits(values, before[name])
        else:
            assert np.array_equal(values[:20], before[name][:20]) and np.isnan(values[20:]).all()
    (tmp_path / "hidden.mat").write_bytes(mat(shown))
    stored = loadmat(tmp_path / "hidden.mat")
    assert stored["u"].shape == (200, 1) and np.array_equal(stored["y"], contents.variables["y"].values[:20])
    text = ascii_table(shown).decode() + csv(shown).decode() + csv_metadata(shown, "noise.csv").decode()
    assert "provenance" not in text and "seed" not in text and "withheld" in text


def test_a_variable_too_large_for_a_mat_file_is_refused(contents):
    huge = np.broadcast_to(0.0, (LARGEST // 8 + 1, 1))  # weighs nothing
    variables = {**contents.variables, "u": Variable(("sample", "input"), huge, {"units": "rad"})}
    refused(r"u has 2 GiB.*ncread", mat, Contents(variables, contents.attributes))


def test_an_export_that_cannot_work_is_refused_before_the_work(copy, tmp_path):
    (tmp_path / "tiny-v1-mat").mkdir()
    before = sorted(copy.rglob("*"))
    refused("already there", export, copy, tmp_path, ("csv", "mat"))
    refused("inside the data set", export, copy, copy / "mine", ("csv",))
    refused("unknown format 'matlab'", export, copy, tmp_path, ("csv", "matlab"))
    refused("no format given", export, copy, tmp_path, ())
    assert sorted(copy.rglob("*")) == before
    # Nothing stays of an export that fails on the way.
    index = read_index(copy)
    index["experiments"][2]["arrays"]["data/test/noise.nc"]["y"] = "0" * 64
    (copy / "experiments.json").write_text(json.dumps(index))
    refused(r"noise\.nc: y differ", export, copy, tmp_path / "new/out", ("csv",))
    assert sorted(os.listdir(tmp_path)) == ["tiny-v1", "tiny-v1-mat"]


def test_the_command_exports(tiny, tmp_path, result):
    exported = result("dataset", "export", tiny, "--format", "ascii, csv", "--out", tmp_path)
    folders = [Path(path) for path in exported["folders"]]
    assert [folder.name for folder in folders] == ["tiny-v1-ascii", "tiny-v1-csv"]
    assert (folders[1] / "train/binary-shoulder_yaw.csv").is_file()
