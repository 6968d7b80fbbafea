"""Report of one model: the verdict first, every number that the command prints, charts that need no network."""

import json
import re
import shlex

import numpy as np
import pytest
from scipy.signal import lfilter

from scenarios.commands.cli import main
from scenarios.identification.file_identification import identify_files
from scenarios.identification.identification import figures
from scenarios.identification.result_tables import verdict
from scenarios.model_report import model_charts, summary
from scenarios.model_report.plain_english import graded

DT = 0.05


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    """A first-order lag of gain 2 with three samples of delay and white noise, 800 samples."""
    rng = np.random.default_rng(11)
    u = np.repeat(rng.choice([-1.0, 1.0], 80), 10)
    y = lfilter([0, 0, 0, 0.4], [1, -0.8], u)
    y += 0.02 * rng.standard_normal(len(y))
    path = tmp_path_factory.mktemp("record") / "lag.csv"
    table = np.column_stack((DT * np.arange(len(u)), u, y))
    np.savetxt(path, table, delimiter=",", header="t,u,y", comments="")
    return path


@pytest.fixture(scope="module")
def found(record):
    return identify_files([record], method="oe", orders=(1, 1, 3), held_out=0.25)


def test_the_summary_says_verdict_gain_and_bandwidth(found):
    head = summary(found)
    assert head.grade == "Sufficient" and head.badge == "yes"
    assert verdict(found.result).endswith(head.reason)
    (sentence,) = head.sentences
    gain, low, high = map(float, re.findall(r"is ([\d.]+) \(95 % interval ([\d.]+) to ([\d.]+)\)", sentence)[0])
    assert low < 2.0 < high and gain == pytest.approx(2.0, rel=0.02)
    # of 0.4/(1 - 0.8/q) by bisection on its gain
    hz = float(re.findall(r"up to ([\d.]+) Hz", sentence)[0])
    z = np.exp(2j * np.pi * hz * DT)
    assert abs(0.4 / (1.0 - 0.8 / z)) == pytest.approx(np.sqrt(2.0), rel=0.03)


def test_spectral_analysis_is_drawn_where_the_input_has_power(tmp_path):
    times = DT * np.arange(800)
    tones = np.array([0.5, 1.25, 4.0])
    u = np.sin(2.0 * np.pi * tones * times[:, None]).sum(axis=1)
    y = lfilter([0, 0.4], [1, -0.8], u) + 0.02 * np.random.default_rng(4).standard_normal(800)
    path = tmp_path / "tones.csv"
    np.savetxt(path, np.column_stack((times, u, y)), delimiter=",", header="t,u,y", comments="")
    found = identify_files([path], method="oe", orders=(1, 1, 1), held_out=0.25)
    ((gain, phase),) = model_charts(found.result)["bode"].chart.views.values()
    for panel in (gain, phase):
        drawn = next(series for series in panel.series if series.label == "spectral analysis")
        at = drawn.x[np.isfinite(drawn.y)]
        distance = np.abs(at[:, None] - tones)
        assert np.all(distance.min(axis=1) < 0.1)
        assert np.all(distance.min(axis=0) < 0.1)
    # so too in the figures beside the report
    (upper, _) = figures(found.result)["bode"].axes
    spectrum = upper.get_lines()[0]
    assert spectrum.get_label() == "SPA"
    at = spectrum.get_xdata()[np.isfinite(spectrum.get_ydata())]
    assert len(at)
    assert np.all(np.abs(at[:, None] - tones).min(axis=1) < 0.1)


def test_lines_of_a_repeating_input_are_drawn_as_points_and_nothing_between_them(tmp_path):
    """Noise of the measured input has power of its own between them: gains there are those of leakage and noise."""
    rng = np.random.default_rng(8)
    period = rng.choice([-1.0, 1.0], 100)
    u = np.tile(period, 30)
    y = lfilter([0, 0.4], [1, -0.8], u) + 1e-3 * rng.standard_normal(3000)
    u = u + 0.02 * rng.standard_normal(3000)
    path = tmp_path / "repeats.csv"
    np.savetxt(path, np.column_stack((DT * np.arange(3000), u, y)), delimiter=",", header="t,u,y", comments="")
    found = identify_files([path], method="oe", orders=(1, 1, 1))
    ((gain, _),) = model_charts(found.result)["bode"].chart.views.values()
    drawn = next(series for series in gain.series if series.label == "spectral analysis")
    assert not drawn.style.line
    known = np.isfinite(drawn.y) & (drawn.x < 0.45 / DT)
    # lines lie 0.2 Hz apart, each as wide as the transform of the window of 300 lags
    off_lines = np.abs(drawn.x[known] / 0.2 - np.rint(drawn.x[known] / 0.2)) * 0.2
    assert known.sum() > 20 and off_lines.max() < 1.0 / (300 * DT)
    true = 20.0 * np.log10(np.abs(0.4 / (1.0 - 0.8 * np.exp(-2j * np.pi * drawn.x[known] * DT))))
    error = np.abs(drawn.y[known] - true)
    # lines of a short random sequence differ in power: weak ones show some of their neighbours
    assert np.median(error) < 0.5 and error.max() < 5.0


def test_a_badge_has_the_limit_of_its_verdict():
    assert graded("sufficient above 0.5 Hz: white; fit 90 %") == ("sufficient above 0.5 Hz", "yes", "white; fit 90 %")
    assert graded("residuals not tested; fit 90 %") == ("residuals not tested", "cannot", "fit 90 %")
    assert graded("not sufficient: the runs differ: 2") == ("not sufficient", "not", "the runs differ: 2")


def test_charts_hold_the_measured_and_the_simulated_values(found):
    charts = model_charts(found.result)
    assert list(charts) == ["outputs", "step", "bode", "residuals"]
    (checked,) = found.result.checked
    views = charts["outputs"].chart.views
    measured, simulated = views["all", "y"][0].series
    # in the values of the record, without the operating point
    level = checked.output_offset
    np.testing.assert_array_equal(measured.y, checked.retrend().y[checked.window :, 0])
    np.testing.assert_array_equal(simulated.y, (found.result.fit.simulated + level)[checked.window :, 0])
    assert measured.x[0] == pytest.approx(checked.start + checked.window * DT)
    ((step,),) = charts["step"].chart.views.values()
    (response,) = step.series
    # a step of this lag: 2 (1 - 0.8^(k - 2)) from the third sample on
    k = np.arange(len(response.y))
    truth = np.where(k < 3, 0.0, 2.0 * (1.0 - 0.8 ** (k - 2.0)))
    np.testing.assert_allclose(response.y, truth, atol=0.03)
    ((gain, phase),) = charts["bode"].chart.views.values()
    assert gain.marks[0][1] == found.result.fitted.claims[0][0].hz
    model = next(series for series in gain.series if series.label == "model")
    expected = 20.0 * np.log10(abs(0.4 / (1.0 - 0.8 * np.exp(-2j * np.pi * model.x * DT))))
    np.testing.assert_allclose(model.y, expected, atol=0.3)
    assert (model.low <= model.y).all() and (model.y <= model.high).all()
    assert next(series for series in phase.series if series.label == "model").y[0] == pytest.approx(0.0, abs=5.0)


@pytest.mark.slow
@pytest.mark.parametrize("method", [None, "tfest", "procest", "impulseest"])
def test_the_page_is_complete_and_its_command_gives_the_same_model(record, tmp_path, capsys, method):
    words = ["identify", str(record), "--out", str(tmp_path / "out")]
    if method:
        words += ["--method", method]
    assert main(words) == 0
    printed = capsys.readouterr().out
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert not re.search(r"(src|href)=\"(https?:)?//", page)
    assert page.index('class="answer"') < page.index("<h2>The model</h2>") < page.index('data-chart="outputs"')
    data = json.loads(re.search(r'id="charts">(.*?)</script>', page, re.DOTALL)[1])
    assert set(data) == {"outputs", "step", "bode", "residuals"}
    # the printed line goes on with the same model
    line = next(line for line in printed.splitlines() if line.startswith("next: "))
    _, program, *again = shlex.split(line)
    assert program == "hmtb" and "--held-out" not in again
    again[again.index("--save") + 1] = str(tmp_path / "again.json")
    assert main([*again, "--json"]) == 0
    second = json.loads(capsys.readouterr().out)
    assert main([*again, "--held-out", "0.25", "--overwrite", "--json"]) == 0
    held_out = json.loads(capsys.readouterr().out)
    assert main([*words[:2], *words[4:], "--json"]) == 0
    first = json.loads(capsys.readouterr().out)
    assert second["method"] == first["method"] and second["orders"] == first["orders"]
    assert second["dc_gain"] == pytest.approx(first["dc_gain"], rel=1e-3)
    assert second["bandwidth_hz"] == pytest.approx(first["bandwidth_hz"], rel=1e-3)
    # the model is of all samples, its fits are those of a model that did not see the last quarter
    assert second["samples"] == first["samples"] > held_out["samples"]
    assert held_out["fit"]["simulation"] == pytest.approx(first["fit"]["simulation"], abs=0.01)
    assert held_out["dc_gain"] != pytest.approx(first["dc_gain"], rel=1e-6)
    # Python gives what the command gives, and so does the call on the page
    found = identify_files([record], method=method)
    assert found.result.fit.simulation.tolist() == first["fit"]["simulation"]
    assert list(found.result.fitted.estimate.parameters) == list(first["parameters"].values())
    assert first["dc_gain"] == pytest.approx(2.0, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["tfest", "procest", "impulseest", "arx"])
def test_an_end_where_no_input_moves_judges_nothing(record, tmp_path, method):
    """A steady last quarter would read a fit of 0 %, whatever the model is worth."""
    t, u, y = np.loadtxt(record, delimiter=",", skiprows=1).T
    # a last step early enough to settle; the lag forgets its input in 40 samples
    last = 300
    steady = np.where(np.arange(len(u)) < last, u, u[last])
    settled = lfilter([0, 0, 0, 0.4], [1, -0.8], steady)
    y = settled + 0.02 * np.random.default_rng(5).standard_normal(len(y))
    path = tmp_path / "steady.csv"
    np.savetxt(path, np.column_stack((t, steady, y)), delimiter=",", header="t,u,y", comments="")
    found = identify_files([path], method=method)
    assert found.held_out == 0.0 and "held_out" not in found.chosen_options
    assert any("no input moves in the last quarter" in warning for warning in found.warnings)
    assert found.result.fit.simulation.item() > 90.0
    assert found.result.fitted.estimate.dc_gain().item() == pytest.approx(2.0, rel=0.03)
    moving = identify_files([record], method=method)
    assert moving.held_out == 0.25
    assert not any("held out" in warning for warning in moving.warnings)
