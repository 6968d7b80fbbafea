"""Files of requests and of models."""

import json

import numpy as np
import pytest
from scipy.io import savemat

import sysid
from hmtb_twin.files.netcdf import Contents, Variable
from scenarios.estimators.outcome import NoModelError
from scenarios.estimators.request_files import FORMATS, MOST_BYTES, read_model, read_request, write_request
from scenarios.estimators.task import PROTOCOL
from tests.mat_bytes import HEAD, part, variable
from tests.refusals import refused

MODEL = {"dt": 0.02, "A": [[0.5, 0.1], [0.0, 0.2]], "B": [[1.0], [2.0]], "C": [[1.0, 0.0]]}


@pytest.mark.parametrize("missing", [False, True])
def test_the_record_is_the_same_in_all_formats(missing, tmp_path, data, task):
    """To the last bit, a lost sample as NaN, and without names that tell what it is."""
    record = sysid.IOData(np.ones(4), [1.0, np.nan, 3.0, 4.0], 0.02, missing=True) if missing else data
    write_request(tmp_path, record, task, FORMATS)
    copies = [
        sysid.read_netcdf(tmp_path / "data.nc", missing=missing),
        sysid.read_mat(tmp_path / "data.mat", missing=missing),
        sysid.read_csv(tmp_path / "data.csv", inputs=("u1",), outputs=("y1",), missing=missing),
        read_request(tmp_path / "data.npz", tmp_path / "task.json")[0],
    ]
    for copy in copies:
        np.testing.assert_array_equal(copy.u, record.u)
        np.testing.assert_array_equal(copy.y, record.y)
        assert (copy.dt, copy.output_units) == (0.02, ("",))
    assert (copies[-1].window, copies[-1].name, copies[-1].input_names) == (record.window, "", ("u1",))
    assert not b"".join(path.read_bytes() for path in tmp_path.iterdir()).count(b"command")
    table = json.loads((tmp_path / "task.json").read_text())
    assert table["protocol"] == PROTOCOL == 1
    assert (table["samples"], table["inputs"], table["missing"]) == (len(record), 1, missing)


def test_the_task_arrives_as_it_was(tmp_path, data, task):
    """And only the formats that are asked for are written."""
    write_request(tmp_path, data, task, ("npz",))
    assert {path.name for path in tmp_path.iterdir()} == {"data.npz", "task.json"}
    copy = read_request(tmp_path / "data.npz", tmp_path / "task.json")[1]
    assert vars(copy).keys() == vars(task).keys()
    assert (copy.orders, copy.seed, copy.structure) == (task.orders, task.seed, task.structure)
    np.testing.assert_array_equal(copy.frequencies, task.frequencies)


@pytest.mark.parametrize("ending", ["json", "mat", "nc"])
def test_a_model_is_the_same_in_all_formats(ending, tmp_path):
    path = tmp_path / f"model.{ending}"
    if ending == "json":
        path.write_text(json.dumps(MODEL))
    elif ending == "mat":
        savemat(path, {**MODEL, "something_else": "text"})
    else:
        dims = {"A": ("state", "to"), "B": ("state", "input"), "C": ("output", "state")}
        arrays = {name: Variable(dims[name], np.array(MODEL[name]), {}) for name in dims}
        path.write_bytes(Contents(arrays, {"dt": 0.02}).to_bytes())
    numbers = read_model(tmp_path)
    assert set(numbers) == set(MODEL)
    for name, value in MODEL.items():
        np.testing.assert_array_equal(np.squeeze(numbers[name]), np.squeeze(value))


def test_special_numbers_of_json(tmp_path):
    """null within numbers is NaN, instead of all of them it is a number left out; any length of digits is a number."""
    num = f"[1e400, 1{'0' * 5000}, 1{'0' * 300}]"
    text = '{"bandwidth_ci95": [null, null], "covariance": null, "K": NaN, "A": true, "D": -2, "num": '
    (tmp_path / "model.json").write_text(f"{text}{num}}}")
    numbers = read_model(tmp_path)
    assert set(numbers) == {"bandwidth_ci95", "K", "A", "D", "num"}
    assert np.isnan(numbers["bandwidth_ci95"]).all() and np.isnan(numbers["K"])
    assert (numbers["A"], numbers["D"]) == (1.0, -2.0)
    np.testing.assert_array_equal(numbers["num"], [np.inf, np.inf, 1e300])


@pytest.mark.parametrize(
    ("name", "content", "why"),
    [
        ("model.json", b"{", "cannot read model.json"),
        ("model.json", b"[" * 100_000, "cannot read model.json"),
        ("model.json", b"[1]", "holds no JSON object"),
        ("model.json", b'{"Q": 1}', "unknown 'Q' given, expected some of dt, A, B"),
        ("model.json", b'{"A": "x"}', "A of type <U1 given"),
        ("model.json", b'{"A": [[1], [1, 2]]}', "A of type list given"),
        ("model.json", b'{"A": {"re": 1}}', "A of type dict given"),
        ("model.json", b'{"A": ' + b"[" * 900 + b"]" * 900 + b"}", "A of type list given"),
        ("model.mat", b"MATLAB 5.0 MAT-file" + bytes(200), "cannot read model.mat"),
        ("model.mat", HEAD + variable("A", part(200, bytes(8))), "cannot read model.mat"),
        ("model.nc", b"CDF", "model.nc is not a NetCDF4 file, or a damaged one"),
        ("model.txt", b"1", "no model file written"),
    ],
    ids=range(12),
)
def test_files_that_are_no_models(name, content, why, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(NoModelError) as caught:
        read_model(tmp_path)
    assert caught.value.kind == "malformed" and why in str(caught.value), str(caught.value)


def test_files_that_are_too_long_are_not_read(tmp_path):
    with (tmp_path / "model.json").open("wb") as file:
        file.truncate(MOST_BYTES + 1)
    refused("expected at most", read_model, tmp_path)
