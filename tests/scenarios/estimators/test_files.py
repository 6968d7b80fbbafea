"""Files of tasks and of models, and messages."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat, savemat

import sysid
from scenarios.estimators.model_file import find_model, read_model_numbers
from scenarios.estimators.no_model import NoModelError
from scenarios.estimators.record_on_wire import request, requested
from scenarios.estimators.task import PROTOCOL, Task
from scenarios.estimators.task_files import FORMATS, write_task
from scenarios.estimators.wire import WireError, complete, pack, unpack
from scenarios.files.netcdf import Contents, Variable

MODEL = {"dt": 0.02, "A": [[0.5, 0.1], [0.0, 0.2]], "B": [[1.0], [2.0]], "C": [[1.0, 0.0]]}


def test_the_record_is_the_same_in_all_formats(tmp_path: Path, data: sysid.IOData, task: Task) -> None:
    """To the last bit."""
    write_task(tmp_path, data, task, FORMATS)
    for read in (sysid.read_netcdf(tmp_path / "data.nc"), sysid.read_mat(tmp_path / "data.mat")):
        np.testing.assert_array_equal(read.u, data.u)
        np.testing.assert_array_equal(read.y, data.y)
        assert read.dt == data.dt
    table = sysid.read_csv(tmp_path / "data.csv", inputs=("u1",), outputs=("y1",))
    np.testing.assert_array_equal(np.hstack((table.u, table.y)), np.hstack((data.u, data.y)))
    assert loadmat(tmp_path / "data.mat")["window"].item() == 5
    told = json.loads((tmp_path / "task.json").read_text())
    assert told["protocol"] == PROTOCOL == 1
    assert (told["orders"], told["frequencies"], told["inputs"]) == ({"na": 1, "nb": 1, "nk": 1}, [0.5, 2.0, 10.0], 1)
    assert (told["samples"], told["window"], told["input_names"]) == (400, 5, ["command"])


def test_only_what_is_asked_for_is_written(tmp_path: Path, data: sysid.IOData, task: Task) -> None:
    write_task(tmp_path, data, task, ("mat",))
    assert {path.name for path in tmp_path.iterdir()} == {"data.mat", "task.json"}


def test_a_lost_sample_is_nan_in_all_formats(tmp_path: Path, task: Task) -> None:
    data = sysid.IOData(np.ones(4), [1.0, np.nan, 3.0, 4.0], 0.02, missing=True)
    write_task(tmp_path, data, task, FORMATS)
    assert json.loads((tmp_path / "task.json").read_text())["missing"] is True
    for read in (sysid.read_netcdf, sysid.read_mat):
        name = {sysid.read_netcdf: "data.nc", sysid.read_mat: "data.mat"}[read]
        np.testing.assert_array_equal(read(tmp_path / name, missing=True).y, data.y)
    np.testing.assert_array_equal(
        sysid.read_csv(tmp_path / "data.csv", inputs=("u1",), outputs=("y1",), missing=True).y, data.y
    )


def test_a_model_is_the_same_in_all_formats(tmp_path: Path) -> None:
    for ending in (".json", ".mat", ".nc"):
        folder = tmp_path / ending[1:]
        folder.mkdir()
        path = folder / f"model{ending}"
        if ending == ".json":
            path.write_text(json.dumps(MODEL))
        elif ending == ".mat":
            savemat(path, {**MODEL, "something_else": "text"})
        else:
            dims = {"A": ("state", "to"), "B": ("state", "input"), "C": ("output", "state")}
            arrays = {name: Variable(dims[name], np.array(MODEL[name]), {}) for name in dims}
            path.write_bytes(Contents(arrays, {"dt": 0.02}).to_bytes())
        found = read_model_numbers(find_model(folder))
        assert set(found) == set(MODEL)
        for name, value in MODEL.items():
            np.testing.assert_array_equal(np.squeeze(found[name]), np.squeeze(value))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "cannot read model.json"),
        ("[" * 100_000, "cannot read model.json"),
        ("[1]", "holds no JSON object"),
        ('{"Q": 1}', "unknown 'Q', expected some of dt, A, B"),
        ('{"A": "x"}', "A of type <U1 given"),
        ('{"A": [[1], [1, 2]]}', "A of type list given"),
        ('{"A": {"re": 1}}', "A of type object given"),
        ('{"A": true}', ""),
    ],
)
def test_json_that_is_no_model_is_refused(text: str, why: str, tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    path.write_text(text)
    if not why:
        assert read_model_numbers(path)["A"] == 1.0
        return
    with pytest.raises(NoModelError) as caught:
        read_model_numbers(path)
    assert caught.value.kind == "malformed" and why in str(caught.value)


def test_null_is_no_number(tmp_path: Path) -> None:
    """JSON has no NaN; within numbers null stands for it, instead of all of them it is as if nothing was said."""
    path = tmp_path / "model.json"
    path.write_text('{"dt": 0.02, "bandwidth_ci95": [null, null], "covariance": null, "K": NaN}')
    found = read_model_numbers(path)
    assert set(found) == {"dt", "bandwidth_ci95", "K"}
    assert np.isnan(found["bandwidth_ci95"]).all() and np.isnan(found["K"])


def test_whole_numbers_of_any_length_are_numbers(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    path.write_text('{"A": [' + "1" * 300 + ', 3], "D": -2}')
    found = read_model_numbers(path)
    np.testing.assert_array_equal(found["A"], [float("1" * 300), 3.0])
    assert found["D"] == -2.0


def test_damaged_files_are_no_models(tmp_path: Path) -> None:
    for name, content in (("model.mat", b"MATLAB 5.0 MAT-file" + bytes(200)), ("model.nc", b"CDF")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(NoModelError, match=name):
            read_model_numbers(tmp_path / name)


def test_a_request_arrives_as_it_was(data: sysid.IOData, task: Task) -> None:
    got, asked = requested(*unpack(pack(*request(data, task))))
    assert vars(asked).keys() == vars(task).keys() and asked.orders == task.orders and asked.seed == task.seed
    np.testing.assert_array_equal(asked.frequencies, task.frequencies)
    for name, value in vars(data).items():
        np.testing.assert_array_equal(getattr(got, name), value)


@pytest.mark.parametrize(
    "message",
    [
        b"garbage, more of it than a beginning has",
        b"hmtb" + struct.pack("<IQ", 2**31, 0),
        b"hmtb" + struct.pack("<IQ", 2, 8) + b"{}" + bytes(8),
        b"hmtb" + struct.pack("<IQ", 1, 0) + b"{",
        pack({"a": 1}) + b"x",
        pack({}, {"x": np.zeros(2)}).replace(b"[2]", b"[3]"),
        pack({}, {"x": np.zeros(2)}).replace(b"[2]", b'["]'),
        pack({}, {"x": np.zeros((2, 2))}).replace(b"[2, 2]", b"[-4,0]"),
    ],
)
def test_other_bytes_are_no_message(message: bytes) -> None:
    with pytest.raises(WireError):
        if complete(bytearray(message)):
            unpack(message)


def test_half_a_message_is_waited_for() -> None:
    message = pack({"a": [1]}, {"x": np.ones((2, 0))})
    assert not any(complete(bytearray(message[:n])) for n in range(len(message)))
    assert unpack(message)[0] == {"a": [1]} and unpack(message)[1]["x"].shape == (2, 0)
