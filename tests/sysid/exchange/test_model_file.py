"""Model files: every bit comes back, equal models are equal bytes, damaged files are refused in words."""

import json
import re
import warnings
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import sysid
from sysid import ContinuousEstimate, Estimate, IOData, Polynomials, StateSpace, SysidWarning, read_model, write_model
from sysid.models import band, innovations_form
from sysid.models.data_summary import DataSummary
from tests.refusals import refused

DT = 0.02
PAGE = Path(__file__).parents[3] / "docs/model-file.md"


@cache
def estimate(method):
    """Two inputs, a gap in the output where the estimator takes one; two outputs where it takes several."""
    rng = np.random.default_rng(7)
    u = np.repeat(rng.choice([-1.0, 1.0], (150, 2)), 2, axis=0)
    truth = innovations_form(Polynomials(B=[[0, 0.1, 0.05], [0, 0, 0.2]], F=[[1, -1.5, 0.7], [1, -0.5, 0]]), DT, 0.01)
    y = sysid.simulate(truth, u, rng=rng)
    names = {"input_names": ("torque", 'of "oil" \n µ'), "input_units": ("N m", "°"), "name": "prbs"}
    data = IOData(u, y, DT, **names)
    y2 = np.hstack((y, np.roll(y, 1, axis=0) + 0.1 * rng.standard_normal(y.shape)))
    gap = IOData(u, np.where(np.arange(300)[:, None] == 40, np.nan, y), DT, missing=True, **names)
    both = IOData(u, y2, DT, output_units=("rad", "m"), **names)
    return {
        "arx": lambda: sysid.arx(data, 2, 2, (1, 2)),
        "oe": lambda: sysid.oe(gap, 2, (2, 1), 1),
        "bj": lambda: sysid.bj([data[:150], data[150:]], 2, 1, 1, 2, (1, 2)),
        "pem_ss": lambda: sysid.pem_ss(both, sysid.n4sid(both, 3)),
        "n4sid": lambda: sysid.n4sid(both, 3),
        "okid": lambda: sysid.okid(both, 3, p=3),
        "tfest": lambda: sysid.tfest(gap[:120], 1, 0, delay=[None, 0.0], max_delay=0.06, offset=True),
        "procest": lambda: sysid.procest(data, ["P1Z", "P1"]),
        "d2c oe": lambda: sysid.d2c(sysid.oe(data, (2, 1), (2, 1), (1, 2))),
        "d2c pem_ss": lambda: sysid.d2c(estimate("pem_ss")),
        "c2d": lambda: sysid.c2d(estimate("procest"), 0.01),
        "ar": lambda: sysid.ar(IOData(np.zeros((300, 0)), y, DT), 2),
    }[method]()


METHODS = ("arx", "oe", "bj", "pem_ss", "n4sid", "okid", "ar", "tfest", "procest", "d2c oe", "d2c pem_ss", "c2d")


def assert_equal(one, other):
    """Equal to the last bit, NaN included."""
    assert type(one) is type(other) or not isinstance(one, np.ndarray)
    if isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        assert one.tobytes() == other.tobytes() or np.isnan(one).any()
        np.testing.assert_array_equal(one, other)
    elif isinstance(one, Estimate | StateSpace | Polynomials | DataSummary):
        for field in fields(one):
            if not field.name.startswith("realise"):
                assert_equal(getattr(one, field.name), getattr(other, field.name))
    elif hasattr(one, "items"):
        assert one.keys() == other.keys()
        for key in one:
            assert_equal(one[key], other[key])
    elif isinstance(one, tuple):
        assert len(one) == len(other)
        for part, same in zip(one, other, strict=True):
            assert_equal(part, same)
    else:
        assert one == other or (one != one and other != other)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize("method", METHODS)
def test_estimates_come_back(method, tmp_path):
    original = estimate(method)
    level = (1.0, -0.0)[: original.model.nu], (0.1, 2.0, 3.0)[: original.model.ny]
    data = replace(original.data, input_offset=level[0], output_offset=level[1])
    original = replace(original, data=data, diagnostics={**original.diagnostics, "odd": (np.inf, 1j)})
    path = write_model(original, tmp_path / "model.json", command="hmtb identify")
    back = read_model(path)
    assert_equal(original, back)
    assert str(back) == str(original)
    if isinstance(original, ContinuousEstimate):
        assert_equal(original.continuous.states, back.continuous.states)
        assert_equal(original.continuous.delays, back.continuous.delays)
    assert (back.fpe, back.aic, back.bic) == (original.fpe, original.aic, original.bic)
    assert path.read_bytes() == write_model(back, tmp_path / "again.json", command="hmtb identify").read_bytes()
    f = [0.1, 1.0, 5.0]
    expected, got = (one.frequency_response(f).covariance for one in (original, back))
    if method == "n4sid":
        assert got is expected is None
    else:
        # of other methods than those with polynomials, the matrices are linear in the parameters
        tolerance = 0.0 if original.polynomials is not None else 1e-4 * np.abs(expected).max()
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=tolerance)


@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
def test_states_that_turn_with_the_parameters_keep_the_interval(tmp_path):
    """Realise in coordinates that jump: the response does not depend on them, its derivatives must not either."""
    original = estimate("okid")

    def turned(theta):
        model = original.realise(theta)
        turn = np.linalg.qr(np.random.default_rng(crc32(theta.tobytes())).random((3, 3)))[0]
        return replace(model, A=turn.T @ model.A @ turn, B=turn.T @ model.B, C=model.C @ turn, K=turn.T @ model.gain)

    back = read_model(write_model(replace(original, realise=turned), tmp_path / "model.json"))
    expected, got = (band(one, lambda model: model.step_response(20)).ci95[1] for one in (original, back))
    np.testing.assert_allclose(got, expected, rtol=1e-4)


NUMBERS = st.floats(allow_nan=False, allow_infinity=False, width=64)


@given(st.lists(NUMBERS, min_size=8, max_size=8))
def test_every_finite_number_keeps_its_bits(tmp_path_factory, numbers):
    path = tmp_path_factory.getbasetemp() / "bits.json"
    A, B, C, D = np.reshape(numbers, (4, 2))
    model = StateSpace([A, B], C[:, None], [D], [[-0.0]], None, 5e-14)
    assert_equal(model, read_model(write_model(model, path)))


@pytest.mark.parametrize(
    "model",
    [
        StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), [[1.0, 2.0]], None, DT),
        StateSpace([[0.5]], np.zeros((1, 0)), [[1.0]], np.zeros((1, 0)), [[0.1]], DT, [[2.0]], output_names=("e",)),
        Polynomials(B=[0, 0.1], F=[1, -0.9]),
        Polynomials(B=[[0, 0.1]], A=[1, 0.1, -1e-300]),
    ],
)
def test_models_come_back(model, tmp_path):
    assert_equal(model, read_model(write_model(model, tmp_path / "model.json")))


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = write_model(Polynomials(B=[0, 1.0]), tmp_path / "model.json")
    before = path.read_bytes()
    with monkeypatch.context() as patch, pytest.raises(FileExistsError):
        patch.setattr("sysid.exchange.files.secrets.token_hex", lambda _: "0")
        (tmp_path / "model.json.0.partial").symlink_to(path)
        write_model(Polynomials(B=[0, 2.0]), path)
    assert path.read_bytes() == before
    assert [one.name for one in tmp_path.iterdir()] == ["model.json"]
    (tmp_path / "folder.json").mkdir()
    refused("is a folder", write_model, Polynomials(), tmp_path / "folder.json")
    refused(r"ends with \.json", write_model, Polynomials(), tmp_path / "model.txt")
    refused("got ndarray", write_model, np.eye(2), path)


def test_a_saved_model_knows_its_record_and_the_warnings_of_its_fit(tmp_path):
    rng = np.random.default_rng(0)
    u = rng.standard_normal(400)
    data = IOData(u, np.append(0.0, u[:-1]) + rng.standard_normal(400), DT)
    fitted = sysid.oe(data, 1, 1)
    warned = replace(fitted, diagnostics={**fitted.diagnostics, "warnings": ("rank 1 of 2", "no noise")})
    path = write_model(warned, tmp_path / "servo.json")
    with pytest.warns(SysidWarning) as caught:
        model = read_model(path)
    expected = ["servo.json: warning of the fit: rank 1 of 2", "servo.json: warning of the fit: no noise"]
    assert [str(one.message) for one in caught] == expected
    with pytest.warns(SysidWarning, match="estimated from this record"):
        sysid.compare(model, data)
    # Files of earlier releases have no hash: they are read, and nothing is said of their record.
    content = json.loads(path.read_text())
    del content["estimate"]["data"]["hashes"]
    content["estimate"]["diagnostics"] = {}
    path.write_text(json.dumps(content))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (fit,) = sysid.compare(read_model(path), data)
    assert not fit.is_training
    content["estimate"]["data"]["hashes"] = ["abc"]
    path.write_text(json.dumps(content))
    refused("data.hashes: expected 64 hexadecimal digits per experiment", read_model, path)


BROKEN = [
    (r'"version": 1', '"version": 2', "version 2 given, expected 1"),
    (r'"version": 1', '"version": true', "version True given"),
    (r'"format": "sysid-model"', '"format": "other"', "no model file"),
    (r'"estimate": {', '"pickle": {', "expected one of the keys estimate, state_space, polynomials"),
    (r'"estimate": {', '"polynomials": {}, "estimate": {', "expected one of the keys estimate"),
    (r'"method": "arx"', '"method": "arx", "method": "oe"', "'method' stands twice"),
    (r'"method": "arx"', '"methods": "arx"', "estimate: unknown key 'methods', expected"),
    (r'"method": "arx"', '"method": 3', "method: expected a text"),
    (r'"dt": 0.02,', '"dt": NaN,', "NaN given, expected finite"),
    (r'"dt": 0.02,', '"dt": 1e999,', "dt must lie between"),
    (r'"dt": 0.02,', f'"dt": {"9" * 5000},', "a whole number of .* digits, expected at most 20"),
    (r'"dt": 0.02,', '"dt": null,', "dt: expected a number, got None"),
    (r'"A": \[', '"A": [[1.0, 2.0, 3.0],', "A"),
    (r'"D": \[', '"D": ["0.0"], "E": [', "unknown key 'E'"),
    (r'"samples": \[300\]', '"samples": [300, 4]', "a number of samples for each of the names"),
    (r'"samples": \[300\]', '"samples": [-3]', "a number of samples for each of the names"),
    (r'"intersample": "zoh"', '"intersample": 1', "intersample: expected a text"),
    (r'"intersample": "zoh"', '"intersample": "spline"', "expected zoh, foh or bl"),
    (r'"parameters": \[', '"parameters": [1.0, ', r"covariance: expected shape \(7, 7\), got \(6, 6\)"),
    (r'"parameters": \[', '"parameters": [null, ', "parameters: 1 value.s. NaN"),
    (r'"na": 2,(?=.*\n.*\n.*"nc")', '"na": 3,', "layout: expected that of 6 parameters"),
    (r'"na": 2,(?=.*\n.*\n.*"nc")', '"na": -2,', "layout: expected that of 6 parameters"),
    (r'"nk": \[1, 2\](?!\n *},)', '"nk": [2, 1]', "layout: the polynomials with these parameters are not the model"),
    (r'"nk": \[1, 2\](?!\n *},)', '"nk": [1, 10000000]', "layout.nk: expected delays below"),
    (r'"nf": \[0, 0\]', '"nf": [0]', "layout: expected that of 6 parameters"),
    (r'"layout": {', '"derivatives": null, "layout": {', "expected one of layout"),
    (r'"covariance": \[', '"covariance": [[], ', "covariance: expected rows of equal length"),
    (r'"noise_variance": \[', '"noise_variance": [[1.0], ', r"noise_variance: expected shape \(1, 1\), got \(2, 1\)"),
    (r'"input_names": \[', '"input_names": "ab", "b": [', "unknown key 'b'"),
    (r'"torque",', '"torque", "more",', "input_names: expected 2"),
    (r'"diagnostics": {', '"diagnostics": {"x": {"array": [[1], 2], "shape": [2]},', "diagnostics.x"),
    (r'"diagnostics": {', '"diagnostics": {"x": {"array": [1, 2], "shape": [3]},', "diagnostics.x"),
    (r'"diagnostics": {', '"diagnostics": {"x": {"eval": "1"},', "diagnostics.x: unknown table"),
    (r'"diagnostics": {', f'"diagnostics": {{"x": {"[" * 100000}', "brackets are nested too deep|no JSON"),
    (r'"covariance": (?s:.*?)\]\s*\],', '"covariance": [],', r"covariance: expected shape \(6, 6\), got \(0,\)"),
    (r'"covariance": \[\s*\[.*?,', '"covariance": [[-1.0,', "covariance: expected a symmetric matrix"),
    (r'"covariance": \[\s*\[.*?,', '"covariance": [[1e308,', "covariance: expected a symmetric matrix"),
    (r'"residuals": (?s:.*?)\]\s*\],', '"residuals": [],', "residuals: expected shape"),
    (r'"samples": \[.*?\]', '"samples": [4611686018427387904]', "residuals: expected shape"),
    (r'"D": (?s:.*?)\]\s*\],', '"D": [[[1]]],', "D: expected shape"),
    (r'"na": 2,(?=.*\n.*\n.*"nc")', '"na": 99999999999999999999,', "layout: expected that of 6 parameters"),
    (r"\A", "﻿", "no JSON"),
]


@pytest.mark.parametrize(("pattern", "replacement", "message"), BROKEN)
def test_damaged_files_are_refused(pattern, replacement, message, tmp_path):
    path = write_model(estimate("arx"), tmp_path / "model.json")
    text = path.read_text(encoding="utf-8")
    damaged = re.sub(pattern, lambda _: replacement, text, count=1)
    assert damaged != text
    path.write_text(damaged, encoding="utf-8")
    refused(rf"model\.json: (?s:.*)({message})", read_model, path)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize(
    ("method", "pattern", "replacement", "message"),
    [
        ("tfest", r'"zeros": 0(?=,\s*"delay")', '"zeros": 2', "paths: expected 1 rows of 2 proper transfer functions"),
        ("tfest", r'"delay": 0.0', '"delay": null', "paths: expected those of 5 parameters"),
        ("tfest", r'"delay": 0.0', '"delay": 0.02', "paths: the transfer functions with these parameters are not"),
        ("procest", r'"kind": "P1"', '"kind": "P4"', "a process model is P0, P1"),
        ("d2c oe", r'"noise": true', '"noise": 1', "unsampled: expected intersample zoh or foh"),
    ],
)
def test_damaged_files_in_continuous_time_are_refused(method, pattern, replacement, message, tmp_path):
    path = write_model(estimate(method), tmp_path / "model.json")
    text, count = re.subn(pattern, replacement, path.read_text(encoding="utf-8"), count=1)
    assert count
    path.write_text(text, encoding="utf-8")
    refused(message, read_model, path)


def test_files_that_are_cut_or_no_text_are_refused(tmp_path):
    path = write_model(estimate("arx"), tmp_path / "model.json")
    content = path.read_bytes()
    for length in range(0, len(content) - 2, 97):
        path.write_bytes(content[:length])
        refused(r"model\.json: no JSON in UTF-8, or cut short", read_model, path)
    for garbage, message in ((b"\xff\xfe\x00", "no JSON in UTF-8"), (b"[1]", "no model file"), (b"1", "no model")):
        path.write_bytes(garbage)
        refused(message, read_model, path)
    refused("cannot read", read_model, tmp_path / "none.json")
    refused("cannot read", read_model, tmp_path)


def test_the_page_lists_every_key(tmp_path):
    written = json.loads(write_model(estimate("arx"), tmp_path / "a.json", command="c").read_text(encoding="utf-8"))
    keys = {*written, *written["estimate"], "derivatives", "state_space"}
    keys |= {key for part in ("model", "polynomials", "data", "layout") for key in written["estimate"][part]}
    listed = set(re.findall(r"`(\w+)`", PAGE.read_text(encoding="utf-8")))
    assert keys <= listed, keys - listed


def test_estimates_convert_to_python_control():
    system = estimate("bj").to_control()
    assert (system.dt, system.nstates, system.output_labels) == (DT, 5, ["y1"])
    f = np.array([0.5, 3.0])
    response = system.frequency_response(2 * np.pi * f).complex
    np.testing.assert_allclose(np.moveaxis(response, -1, 0), estimate("bj").model.frequency_response(f), rtol=1e-10)
