"""`hmtb figures`: every kind for anyone's table, against numbers computed here, and for logs of several joints."""

import csv as csv_module
import json
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from itertools import product

import numpy as np
import pytest
from scipy.linalg import hankel
from scipy.signal import lfilter

from hmtb_twin import simulate
from hmtb_twin.parameters.values import LARGE_MOTION
from scenarios.commands.cli import main
from scenarios.commands.figures import FORMATS, KINDS
from scenarios.experiments.registry import load
from scenarios.record_figures.figure_models import figure_models, model_names
from scenarios.record_figures.measured_record import MeasuredRecord
from scenarios.record_figures.record_figures import KINDS as EVERY_KIND
from scenarios.report.figure_files import FORMATS as WRITTEN
from sysid import IOData
from tests.scenarios.commands.conftest import DT, table
from tests.scenarios.web_page import Page

JOINTS = ("shoulder_yaw", "shoulder_pitch", "elbow_pitch")
MODELS = ("--models", "arx:1/1", "okid:2/5")


@pytest.fixture(scope="module")
def record():
    """Input and output of a pole at 0.9 with gain one, its disturbance white in the equation; about their means."""
    rng = np.random.default_rng(3)
    u = np.repeat(rng.choice([-1.0, 1.0], 1000), 2)
    y = lfilter([0, 0.1], [1, -0.9], u) + lfilter([1], [1, -0.9], 0.01 * rng.standard_normal(2000)) + 2.0
    return u, y


@pytest.fixture(scope="module")
def drawn(record, tmp_path_factory):
    """Folder with the figures of the record as CSV, and what the command printed."""
    folder = tmp_path_factory.mktemp("figures")
    u, y = record
    path = table(folder / "robot.csv", {"t": DT * np.arange(len(u)), "volts": u, "angle": y})
    words = ["figures", path, "--input", "volts", "--output", "angle", *MODELS, "--format", "csv", "--json"]
    with redirect_stdout(StringIO()) as out:
        assert main([str(word) for word in [*words, "--out", folder / "out"]]) == 0
    return folder / "out", json.loads(out.getvalue())


def curves(folder, kind, **choice):
    """Curves of a figure by panel and name, as x and y, of the views that were chosen."""
    found: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for row in csv_module.DictReader((folder / f"{kind}.csv").read_text(encoding="utf-8").splitlines()):
        if all(row[name] == value for name, value in choice.items()):
            point = float(row["x"]), float(row["y"])
            found.setdefault((row["panel"], row["curve"]), []).append(point)
    return {name: np.array(points).T for name, points in found.items()}


def windowed(x, z, lag, frequencies):
    """Two-sided cross spectrum by a Hamming window: the definition, lag by lag."""
    covariances = [np.mean(np.r_[x[tau:] * z[: len(z) - tau], np.zeros(tau)]) for tau in range(lag + 1)]
    mirrored = [np.mean(np.r_[z[tau:] * x[: len(x) - tau], np.zeros(tau)]) for tau in range(lag + 1)]
    both = np.r_[mirrored[:0:-1], covariances]
    lags = np.arange(-lag, lag + 1)
    phases = np.exp(-2j * np.pi * DT * np.outer(frequencies, lags))
    return DT * phases @ (np.hamming(2 * lag + 1) * both)


def past(u, y, p):
    """Rows of [u(t), u(t-1), y(t-1), ..., u(t-p), y(t-p)] and the outputs y(t)."""
    columns = [u[p:]]
    for lag in range(1, p + 1):
        columns += [u[p - lag : len(u) - lag], y[p - lag : len(y) - lag]]
    return np.column_stack(columns), y[p:]


def test_every_kind_has_its_figure_its_caption_and_its_values(drawn):
    folder, output = drawn
    assert [figure["kind"] for figure in output["figures"]] == list(KINDS) == list(EVERY_KIND)
    assert output["not_drawn"] == output["warnings"] == []
    numbers = [number for figure in output["figures"] for number in figure["thesis"]]
    assert set(map(str, (22, 25, *range(27, 31), *range(49, 53), *range(64, 79)))) <= set(numbers)
    assert all("In the thesis: figure" in figure["caption"] for figure in output["figures"])
    assert {path.name for path in folder.iterdir()} == {"figures.html", *(f"{kind}.csv" for kind in KINDS)}


def test_the_page_holds_every_figure_and_loads_nothing(drawn):
    folder, _ = drawn
    text = (folder / "figures.html").read_text(encoding="utf-8")
    page = Page(text)
    assert [figure["data-chart"] for figure in page.of("figure")] == list(KINDS)
    assert not [entry for entry in (*page.of("script"), *page.of("link"), *page.of("img")) if "src" in entry]
    assert "hmtb figures" in text and "--models arx:1/1 okid:2/5" in text


def test_spectra_and_transfer_function_are_those_of_the_definition(drawn, record):
    folder, _ = drawn
    u, y = (signal - signal.mean() for signal in record)
    spectra = curves(folder, "spectra")
    frequencies, density = spectra["input", "Hamming window"]
    lag = len(u) // 10
    own, cross = windowed(u, u, lag, frequencies).real, windowed(y, u, lag, frequencies)
    np.testing.assert_allclose(density, np.where(own > 0.0, own, np.nan), rtol=1e-6)
    np.testing.assert_allclose(spectra["cross, magnitude", "Hamming window"][1], np.abs(cross), rtol=1e-6)
    hz, gain = curves(folder, "transfer")["1", "Hamming window"]
    known = np.isfinite(gain)
    np.testing.assert_allclose(gain[known], np.abs(cross / own)[known], rtol=1e-6)
    # Below 5 Hz the estimate is near the true gain.
    low = known & (hz < 5.0)
    true = np.abs(0.1 / (np.exp(2j * np.pi * hz * DT) - 0.9))
    np.testing.assert_allclose(gain[low], true[low], rtol=0.15)


def test_correlations_are_coefficients_and_the_pulse_response_is_the_true_one(drawn, record):
    folder, _ = drawn
    u, y = (signal - signal.mean() for signal in record)
    found = curves(folder, "correlations")
    lags, values = found["input to output", "as recorded"]
    for lag in (0, 1, 7):
        expected = np.sum(y[lag:] * u[: len(u) - lag]) / (len(u) * y.std() * u.std())
        assert values[lags == lag][0] == pytest.approx(expected, rel=1e-6)
    assert found["output angle", "as recorded"][1].max() == pytest.approx(1.0)
    _, pulse = found["pulse response", "from correlations"]
    np.testing.assert_allclose(pulse[:20], lfilter([0, 0.1], [1, -0.9], np.eye(1, 20)[0]), atol=0.01)


def test_bode_plots_and_poles_are_those_of_the_system(drawn):
    folder, output = drawn
    hz, gain = curves(folder, "bode")["1", "ARX 1/1/1"]
    true = 0.1 / (np.exp(2j * np.pi * hz * DT) - 0.9)
    np.testing.assert_allclose(gain, np.abs(true), rtol=0.03)
    _, phase = curves(folder, "bode")["2", "ARX 1/1/1"]
    assert np.abs(phase - np.degrees(np.angle(true)))[:-5].max() < 3.0
    real, imaginary = curves(folder, "roots", Models="ARX 1/1/1")["1", "ARX 1/1/1, poles"]
    assert (real[0], imaginary[0]) == pytest.approx((0.9, 0.0), abs=0.01)
    # Beside the figures the command prints the models.
    assert [model["model"] for model in output["models"]["robot"]] == ["ARX 1/1/1", "OKID 2/5"]


def test_markov_parameters_errors_and_hankel_values_follow_from_a_regression(drawn, record):
    folder, _ = drawn
    u, y = (signal - signal.mean() for signal in record)
    rows, target = past(u, y, 5)
    solution, *_ = np.linalg.lstsq(rows, target, rcond=None)
    direct, from_u, from_y = solution[0], solution[1::2], solution[2::2]
    markov = curves(folder, "markov")
    np.testing.assert_allclose(markov["Markov parameters of the observer", "of the command"][1], from_u, atol=1e-3)
    np.testing.assert_allclose(markov["Markov parameters of the observer", "of the measurement"][1], from_y, atol=1e-3)
    system = [direct]
    for k in range(1, 81):
        own = from_u[k - 1] if k <= 5 else 0.0
        system.append(own + sum(from_y[i - 1] * system[k - i] for i in range(1, min(k, 5) + 1)))
    panel = "Markov parameters of the system"
    _, recursion = markov[panel, "from the observer, by recursion"]
    np.testing.assert_allclose(recursion, system[: len(recursion)], atol=1e-3)

    singular = np.linalg.svd(hankel(system[1:41], system[40:80]), compute_uv=False)
    _, sizes = curves(folder, "hankel")["Hankel singular values", "Hankel singular value"]
    np.testing.assert_allclose(sizes, (singular / singular[0])[:5], rtol=0.05, atol=1e-3)
    _, squares = curves(folder, "hankel")["part of their sum in the first ones", "of the squares"]
    np.testing.assert_allclose(squares, 100 * np.cumsum(singular[:5] ** 2) / np.sum(singular**2), atol=0.05)

    errors = curves(folder, "errors")
    p, prediction = errors["errors over p", "prediction error"]
    residual = target - rows @ solution
    expected = 100 * np.sqrt(residual @ residual / (len(rows) - rows.shape[1])) / y.std()
    assert prediction[p == 5][0] == pytest.approx(expected, rel=2e-3)
    # The best estimate of a sample from five samples of both channels on both sides, and the input in between.
    inputs, outputs = (np.lib.stride_tricks.sliding_window_view(signal, 11) for signal in (u, y))
    around = np.hstack((inputs, np.delete(outputs, 5, axis=1)))
    left = outputs[:, 5] - around @ np.linalg.lstsq(around, outputs[:, 5], rcond=None)[0]
    _, smoothing = errors["errors over p", "smoothing error"]
    assert smoothing[p == 5][0] == pytest.approx(100 * left.std() / y.std(), rel=2e-3)
    assert np.all(smoothing < prediction)


def test_residuals_and_their_tests_are_those_of_the_equation(drawn, record):
    folder, _ = drawn
    u, y = record
    # Least squares with a constant: the operating point is estimated with the model.
    rows = np.column_stack((y[:-1], u[:-1], np.ones(len(u) - 1)))
    residual = y[1:] - rows @ np.linalg.lstsq(rows, y[1:], rcond=None)[0]
    found = curves(folder, "tests", Model="ARX 1/1/1")
    (panel,) = {panel for panel, _ in found if panel.startswith("angle, p = ")}
    lags, values = found[panel, "ARX 1/1/1"]
    assert list(lags) == list(range(1, 26))
    for lag in (1, 2, 10):
        expected = residual[lag:] @ residual[:-lag] / (residual @ residual)
        assert values[lags == lag][0] == pytest.approx(expected, abs=0.005)
    (panel,) = {panel for panel, _ in found if panel.startswith("with input volts, p = ")}
    lags, values = found[panel, "ARX 1/1/1"]
    centred = u[1:] - u[1:].mean()
    expected = residual[3:] @ centred[:-3] / (np.linalg.norm(residual) * np.linalg.norm(centred))
    assert values[lags == 3][0] == pytest.approx(expected, abs=0.005)


@pytest.fixture
def two(tmp_path):
    """Two inputs on two outputs, one of the four paths missing."""
    rng = np.random.default_rng(1)
    u = np.repeat(rng.standard_normal((1500, 2)), 2, axis=0)
    first = lfilter([0, 0.1], [1, -0.9], u[:, 0]) + lfilter([0, 0.3], [1, -0.6], u[:, 1])
    second = lfilter([0, 0.2], [1, -0.6], u[:, 1])
    y = np.column_stack([first, second]) + 0.01 * rng.standard_normal((3000, 2))
    signals = {"left": u[:, 0], "right": u[:, 1], "elbow": y[:, 0], "wrist": y[:, 1]}
    return table(tmp_path / "two.csv", {"t": DT * np.arange(3000), **signals})


def test_several_outputs_have_multivariable_models_and_tests_of_every_pair(result, two, tmp_path):
    channels = ("--input", "left", "right", "--output", "elbow", "wrist")
    words = (*channels, "--models", "arx:1/1", "okid:2/6", "--format", "csv", "--out", tmp_path / "out")
    output = result("figures", two, *words)
    assert output["not_drawn"] == []
    views = {figure["kind"]: figure["views"] for figure in output["figures"]}
    paths = {f"{left} → {right}" for left, right in product(("left", "right"), ("elbow", "wrist"))}
    for kind in ("transfer", "correlations", "spectra", "bode", "markov"):
        assert {view[-1] for view in views[kind]} == paths
    models = {"ARX, block-diagonal", "OKID 2/6"}
    assert {tuple(view[1:]) for view in views["tests"]} == set(product(models, ("elbow", "wrist")))
    # A model of a block for each joint has no path between them; that of every path finds the one that is there.
    crossing = curves(tmp_path / "out", "bode", Path="right → elbow")
    assert "ARX, block-diagonal" not in {name for _, name in crossing}
    hz, gain = crossing["1", "OKID 2/6"]
    np.testing.assert_allclose(gain[:50], np.abs(0.3 / (np.exp(2j * np.pi * hz * DT) - 0.6))[:50], rtol=0.1)
    real, _ = curves(tmp_path / "out", "roots", Models="OKID 2/6")["1", "OKID 2/6, poles"]
    assert sorted(real) == pytest.approx([0.6, 0.9], abs=0.02)
    tested = curves(tmp_path / "out", "tests", Model="OKID 2/6", Output="elbow")
    assert {panel.split(",")[0] for panel, _ in tested} == {"elbow", "with input left", "with input right"}


def test_what_a_record_cannot_give_has_its_reason_and_the_rest_is_drawn(result, printed, csv, tmp_path):
    lines = csv.read_text(encoding="utf-8").splitlines()
    short = tmp_path / "short.csv"
    short.write_text("\n".join(lines[:80]), encoding="utf-8")
    words = (short, "--models", "arx:1/1", "--format", "csv", "--out", tmp_path / "out")
    output = result("figures", *words)
    reasons = {entry["kind"]: entry["reason"] for entry in output["not_drawn"]}
    assert set(reasons) == {"correlations", "markov", "errors", "hankel"}
    assert "no stretch without lost samples has 100 samples" in reasons["correlations"]
    assert "no model by okid among --models" in reasons["hankel"]
    assert {figure["kind"] for figure in output["figures"]} == set(KINDS) - set(reasons)
    shown = printed("figures", *words, "--overwrite")
    assert f"not drawn: correlations: {reasons['correlations']}" in shown
    assert reasons["correlations"] in (tmp_path / "out" / "figures.html").read_text(encoding="utf-8")


def test_gaps_are_cut_and_other_records_judge(result, csv, tmp_path):
    lines = csv.read_text(encoding="utf-8").splitlines()
    gap = tmp_path / "gap.csv"
    gap.write_text("\n".join([*lines[:500], *lines[700:]]), encoding="utf-8")
    words = ("--models", "arx:1/1", "--kinds", "tests", "outputs", "--format", "csv", "--out", tmp_path / "out")
    output = result("figures", gap, csv, *words)
    assert "cut there into 2 experiment(s)" in output["warnings"][0]
    assert set(output["models"]) == {"gap", "robot"}
    assert [figure["kind"] for figure in output["figures"]] == ["outputs", "tests"]
    assert {view[0] for view in output["figures"][0]["views"]} == {"gap", "robot"}


def test_drawings_and_pages_are_replaced_only_when_asked(printed, complaint, csv, tmp_path):
    words = ("figures", csv, "--kinds", "record", "spectra", "--format", "svg,png", "--out", tmp_path / "out")
    printed(*words)
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"figures.html", "record-robot.svg", "record-robot.png", "spectra-robot-u-y.svg"} | {
        "spectra-robot-u-y.png"
    }
    assert "--overwrite replaces them" in complaint(*words)
    assert FORMATS == WRITTEN


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--kinds", "spektra"), "unknown kind of figure 'spektra': did you mean 'spectra'?"),
        (("--format", "pdf"), "unknown format 'pdf'"),
        (("--models", "n4sid"), "model 'n4sid' needs its orders, as n4sid:order"),
        (("--models", "foo"), "unknown model 'foo'"),
        (("--models", "truth"), "tells of no arm"),
        (("--joint", "elbow_pitch", "elbow_pitch"), "expected each joint once"),
        (("--input", "w"), "unknown column 'w'"),
    ],
)
def test_bad_input_is_one_line(complaint, csv, tmp_path, words, message):
    assert message in complaint("figures", csv, *words, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_records_with_other_channels_are_refused(complaint, csv, two, tmp_path):
    again = tmp_path / "again" / csv.name
    again.parent.mkdir()
    again.write_bytes(csv.read_bytes())
    assert "another file of that name" in complaint("figures", csv, again, "--out", tmp_path / "out")
    assert "unknown column 'u'" in complaint("figures", csv, two, "--out", tmp_path / "out")


def test_orders_are_chosen_where_none_are_given(record):
    u, y = record
    measured = MeasuredRecord("robot", None, (IOData(u - u.mean(), y - y.mean(), DT),))
    models, refused = figure_models(model_names(("arx", "okid"), 1), measured)
    assert refused == []
    assert [model.kind for model in models] == ["arx", "okid"]
    assert models[0].orders == "1/1/1"
    assert models[1].item.orders["p"] == 5


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Sixteen seconds of a test of several joints, of large motions."""
    stick = replace(LARGE_MOTION, compensation=0.95)
    scenario = replace(load("mimo-7-independent"), duration=16.0, hand_controller=stick)
    (made,) = simulate([scenario]).logs
    return made.save(tmp_path_factory.mktemp("log") / "several.nc")


@pytest.mark.slow
def test_several_joints_of_a_log(result, complaint, log, tmp_path):
    assert "name the joint" in complaint("figures", log, "--out", tmp_path / "out")
    words = ("--models", "arx:2/2", "okid:6/5", "truth", "--kinds", "record", "bode", "roots", "tests")
    output = result("figures", log, "--joint", *JOINTS, *words, "--format", "csv", "--out", tmp_path / "out")
    views = {figure["kind"]: figure["views"] for figure in output["figures"]}
    assert len(views["bode"]) == 9
    assert ["elbow pitch"] in views["bode"] and ["shoulder yaw → elbow pitch"] in views["bode"]
    assert len(views["tests"]) == 9
    # The truth of the arm is drawn beside, in rad/rad; each joint's own gain is near one at low frequencies.
    own = curves(tmp_path / "out", "bode", Path="elbow pitch")
    assert own["1", "truth"][1][0] == pytest.approx(1.0, abs=0.05)
    model = output["models"]["several"][1]
    assert np.shape(model["bandwidth_hz"]) == (3, 3)


@pytest.mark.slow
def test_several_joints_are_identified_as_one_model(result, printed, complaint, log, tmp_path):
    words = ("identify", log, "--joint", *JOINTS, "--method", "n4sid", "--orders", "6")
    output = result(*words, "--save", tmp_path / "several.json")
    assert output["outputs"] == [f"{joint} measured" for joint in JOINTS]
    assert np.shape(output["bandwidth_hz"]) == np.shape(output["residuals"]["independence_p"]) == (3, 3)
    shown = printed(*words, "--save", tmp_path / "again.json")
    for joint in JOINTS:
        assert f"bandwidth (-3 dB) of {joint}" in shown
        assert f"{joint} measured" in shown.partition("Residual tests, output by output")[2]
    assert "Coupling: command of a joint → angle of another" in shown
    last = shown.splitlines()[-1]
    assert last.startswith("next: hmtb compare") and last.endswith(f"--joint {' '.join(JOINTS)}")
    compared = result("compare", log, "--joint", *JOINTS, "--models", tmp_path / "several.json")
    np.testing.assert_allclose(compared["models"][0]["fit"]["simulation"], output["fit"]["simulation"], atol=0.5)
    assert "expected each joint once" in complaint("identify", log, "--joint", JOINTS[0], JOINTS[0])
    assert "armax takes one output, given 3" in complaint(
        "identify", log, "--joint", *JOINTS, "--method", "armax", "--orders", "2", "2", "2"
    )
