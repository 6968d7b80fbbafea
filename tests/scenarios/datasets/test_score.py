"""The score: its formulas, its rules about what may be seen, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.io import savemat

from hmtb_twin.files.netcdf import Contents, Variable
from scenarios.datasets.score import Score, Scores, metric, score, score_model
from scenarios.datasets.spec import Scoring
from sysid import IOData, Polynomials, StateSpace
from sysid.models import block_diagonal, innovations_form
from sysid.validation import fit_percent
from sysid.validation.predictors import Hold, ModelPredictor, StackedPredictor, StaticGain
from tests.refusals import refused


@pytest.fixture(scope="module")
def record(data_set):
    return data_set.test[0]


def test_metrics_and_means_are_those_of_the_books():
    rng = np.random.default_rng(0)
    y = rng.standard_normal((500, 2)) * [1.0, 3.0]
    hat = y + rng.standard_normal((500, 2))
    rmse = np.sqrt(np.mean((y - hat) ** 2, axis=0))
    np.testing.assert_allclose(metric(Scoring("rmse", "rad"), y, hat), rmse)
    np.testing.assert_allclose(metric(Scoring("rmse", "deg"), y, hat), np.degrees(rmse))
    np.testing.assert_allclose(metric(Scoring("nrmse"), y, hat), 100.0 * rmse / y.std(axis=0))
    np.testing.assert_allclose(metric(Scoring("fit"), y, hat), fit_percent(y, hat))
    # A model beyond all numbers has an infinite error, missing outputs have none.
    y, hat = np.ones((3, 1)), np.array([[1.0], [np.nan], [np.inf]])
    assert metric(Scoring(), y, hat) == np.inf
    refused("measured outputs are missing", metric, Scoring(), hat, y)
    refused("nrmse is not defined", metric, Scoring("nrmse"), y, y)
    scores = Scores(Scoring(), (Score("a", "elbow_pitch", 1.0), Score("b", "elbow_pitch", 3.0), Score("b", "yaw", 5.0)))
    assert scores.mean == 3.0  # every record and output counts once
    assert scores.by_joint == {"elbow_pitch": 2.0, "yaw": 5.0}


def test_the_window_is_not_scored_and_its_predictions_are_not_looked_at(data_set, record):
    window = record.state_initialization_window_length or 0
    hat = np.array(record.y)
    hat[:window] = np.nan
    hat[window:] += 0.001
    assert score({record.name: hat}, data_set).mean == pytest.approx(1.0)
    hat[window] += 1.0
    scored = len(hat) - window
    expected = 1000.0 * np.sqrt((1.001**2 + (scored - 1) * 1e-6) / scored)
    assert score({record.name: hat}, data_set).mean == pytest.approx(expected)


def test_a_model_sees_no_output_behind_the_window(record):
    """Outputs behind the window are replaced by rubbish: the simulation stays the same to the bit."""
    data = record.iodata()
    assert data.window == 20
    rubbish = np.where(np.arange(len(data))[:, None] < data.window, data.y, 7.0)
    model = StateSpace([[0.9, 0.1], [0.0, 0.8]], [[0.1], [0.2]], [[1.0, 0.0]], [[0.0]], [[0.3], [0.1]], data.dt)
    point = {"inputs": data.u[0], "outputs": data.y[0]}
    for predictor in (ModelPredictor(model), ModelPredictor(model, **point), Hold(data.y[0])):
        simulated = [predictor.predicted(replace(data, y=y), 0) for y in (data.y, rubbish)]
        np.testing.assert_array_equal(*simulated)
    # Three steps ahead the output at t knows those up to t - 3.
    late = np.where(np.arange(len(data))[:, None] <= 100, data.y, 7.0)
    for predictor in (ModelPredictor(model), Hold(data.y[0])):
        one, other = (predictor.predicted(replace(data, y=y), 3) for y in (data.y, late))
        np.testing.assert_array_equal(one[:104], other[:104])
        assert not np.array_equal(one[104:], other[104:])


def test_without_operating_point_a_model_finds_state_and_level_in_the_window():
    rng = np.random.default_rng(1)
    model = StateSpace([[0.9, 0.1], [0.0, 0.8]], [[0.1], [0.2]], [[1.0, 0.0]], [[0.0]], None, 0.02)
    u, state, y = rng.standard_normal((300, 1)), np.array([3.0, -2.0]), []
    for row in u:
        y.append(model.C @ state)
        state = model.A @ state + model.B @ row
    data = IOData(u + 0.4, np.array(y) - 1.3, 0.02, window=40)
    np.testing.assert_allclose(ModelPredictor(model).predicted(data, 0), data.y, atol=1e-9)
    known = ModelPredictor(model, np.array([0.4]), np.array([-1.3]))
    np.testing.assert_allclose(known.predicted(data, 0), data.y, atol=1e-9)
    # Without a window it starts at rest at its operating point; without that nothing tells the level.
    assert known.predicted(replace(data, window=0), 0)[0] == pytest.approx(-1.3)
    refused("no initialisation window", ModelPredictor(model).predicted, replace(data, window=0), 0)
    refused("one of them given", ModelPredictor, model, inputs=np.zeros(1))


def test_predictors_of_single_outputs_are_stacked():
    rng = np.random.default_rng(2)
    gain = np.array([[1.0, 0.5], [0.0, 2.0]])
    u = rng.standard_normal((50, 2))
    data = IOData(u, u @ gain.T + [0.1, 0.2], 0.02, window=10)
    whole = StaticGain.fitted([data])
    np.testing.assert_allclose(whole.gain, gain, atol=1e-12)
    np.testing.assert_allclose(whole.level, [0.1, 0.2], atol=1e-12)
    rows = StackedPredictor(tuple(StaticGain.fitted([data.select(outputs=[i])]) for i in range(2)))
    np.testing.assert_allclose(rows.predicted(data, 0), whole.predicted(data, 0), atol=1e-12)


def test_score_of_a_model_is_the_score_of_its_predictions(data_set, record):
    model = StateSpace([[0.9]], [[0.1]], [[1.0]], [[0.0]], None, 0.02)
    hat = ModelPredictor(model).predicted(record.iodata(), 0)
    of_model = score_model(model, data_set)
    assert of_model == score({record.name: hat}, data_set)
    assert of_model == score_model(lambda one: ModelPredictor(model), data_set)
    assert of_model.scores[0].joint == "elbow_pitch"
    refused("the data have 1 input", score_model, block_diagonal([model, model]), data_set)
    polynomials = Polynomials(B=[0.0, 0.1], F=[1.0, -0.9])
    expected = score_model(innovations_form(polynomials, 0.02), data_set)
    assert score_model(polynomials, data_set) == score_model(lambda one: polynomials, data_set) == expected
    refused("type ndarray given, expected a StateSpace, Polynomials", score_model, lambda one: one.y, data_set)
    refused("type str given", score_model, "oe", data_set)


def as_csv(path, values):
    path.write_text("elbow_pitch\n" + "".join(f"{value!r}\n" for value in values.tolist()))


def as_mat(path, values):
    savemat(path, {"y": values[:, None]})


def as_netcdf(path, values):
    y = Variable(("sample", "output"), values[:, None], {})
    output = Variable(("output",), np.array(["elbow_pitch"]), {})
    path.write_bytes(Contents({"y": y, "output": output}, {}).to_bytes())


def test_files_of_every_format_give_the_same_numbers(data_set, record, tmp_path):
    hat = record.y + np.random.default_rng(0).standard_normal(len(record)) * 1e-3
    (tmp_path / "notes.md").write_text("other files are ignored")
    for ending, write in ((".csv", as_csv), (".nc", as_netcdf), (".mat", as_mat)):
        path = tmp_path / f"{record.name}{ending}"
        write(path, hat)
        assert score(tmp_path, data_set) == score([path], data_set) == score({record.name: hat}, data_set)
        path.unlink()


def test_predictions_that_do_not_fit_are_refused(data_set, record, tmp_path):
    path, mat = tmp_path / f"{record.name}.csv", tmp_path / f"{record.name}.mat"
    missing = np.array(record.y)
    missing[[30, 50]] = np.nan
    refused(f"no predictions of {record.name}: 0 of 1 given", score, tmp_path, data_set)
    for values, match in (
        (record.y[:-1], r"predictions of shape \(199, 1\) given, expected \(200, 1\): 200 samples of elbow_pitch"),
        (missing, "2 numbers behind the window are not finite, the first at sample 30 of elbow_pitch"),
    ):
        as_csv(path, values)
        refused(match, score, tmp_path, data_set)
    for text, match in (
        ("elbow\n0.0\n", "outputs elbow given, expected elbow_pitch in this order"),
        ("elbow_pitch\n0.0,1.0\n", "row 2: '0.0,1.0' given, expected 1 numbers"),
        ("elbow_pitch\n0.5\n0;5\n", "row 3: '0;5' given, expected 1 numbers"),
    ):
        path.write_text(text)
        refused(match, score, tmp_path, data_set)
    as_mat(mat, record.y)
    refused("has two files of predictions", score, tmp_path, data_set)
    path.unlink()
    savemat(mat, {"y": record.y[None, :]})
    refused("time runs along the first axis", score, tmp_path, data_set)
    savemat(mat, {"z": record.y})
    refused("has no matrix y", score, tmp_path, data_set)
    as_csv(tmp_path / "binary-elbow_pitch.csv", record.y)
    refused("binary-elbow_pitch.csv: no test record", score, tmp_path, data_set)
    (tmp_path / "notes.md").write_text("x")
    refused("expected a folder, or files", score, tmp_path / "notes.md", data_set)
    refused("no predictions at", score, tmp_path / "absent", data_set)
    refused("unknown experiment 'other'", score, {record.name: record.y, "other": record.y}, data_set)
    refused("expected real numbers", score, {record.name: record.y.astype(complex)}, data_set)


def test_only_a_root_mean_square_error_has_a_unit_of_angles():
    assert [Scoring(metric).unit for metric in ("rmse", "nrmse", "fit")] == ["mrad", "%", "%"]
    assert Scoring("rmse", "deg").unit == "deg"
    for words in (("nrmse", "mrad"), ("fit", "rad"), ("rmse", "%")):
        refused("unit", Scoring, *words)
