"""Charts hold what was measured, in the unit of their axes, and every figure of the thesis has its place."""

import csv
import json

import numpy as np
import pytest

from scenarios.experiments.registry import load
from scenarios.record_figures.period_spectra import excited_lines
from scenarios.report.chart_drawing import draw
from scenarios.report.figure_files import ReportFigure, thesis_numbers, write_figures
from scenarios.thesis.figures import report_figures, without_counterpart
from scenarios.thesis.long_tables import LongTables
from scenarios.thesis.motion_section import motion_chart, read_motion
from scenarios.thesis.nonparametric import PULSE, SINES
from sysid.plots import PALETTE
from tests.refusals import refused

LOOK = PALETTE["measured"]


@pytest.fixture(scope="module")
def figures(report):
    return report.figures


def curve(panel, label):
    (found,) = (one for one in panel.series if one.label == label)
    return found


def test_every_figure_of_the_thesis_is_answered_once_or_has_a_reason(figures):
    numbers = [number for figure in figures.values() for number in figure.thesis]
    numbers += [number for entry, reason in without_counterpart() for number in entry if reason]
    assert len(numbers) == len(set(numbers))
    assert set(numbers) == {str(n) for n in range(1, 89)} | {f"A{n}" for n in range(1, 64)}
    assert thesis_numbers("11-13 A2 A4-A5") == ("11", "12", "13", "A2", "A4", "A5")


def test_tones_of_the_waveforms_lie_where_the_thesis_puts_them(figures):
    views = figures["waveforms"].chart.views

    def lines(name):
        volts, power = views[(name,)]
        assert len(volts.series[0].y) == 101
        return power.series[0].x[np.asarray(power.series[0].y) > 1e-9]

    np.testing.assert_allclose(lines("two sines"), [0.5, 2.0])
    assert lines("chirp (2.15) as printed") == pytest.approx([5.0])
    np.testing.assert_allclose(lines("pulse") % 2.0, 1.0, atol=1e-9)
    for name, number in (("PRBS", 5), ("pulse", 7)):
        played = load(f"siso-{number}-elbow_pitch").excitation[0].waveform()
        assert np.array_equal(views[(name,)][0].series[0].y[:-1], played.points)


def test_phase_of_the_window_is_drawn_only_where_the_input_has_power(figures, study):
    _, phase = figures["transfer_function"].chart.views["elbow pitch",]
    tones = curve(phase, "where the input has power")
    spectrum = study.nonparametric["elbow_pitch"].spectra[SINES]
    np.testing.assert_array_equal(tones.x, spectrum.frequencies[excited_lines(spectrum)])
    assert 0 < len(tones.x) < 0.5 * len(spectrum.frequencies)
    assert not any("window" in one.label for one in phase.series)


def test_spectra_are_in_milliradians(figures, study):
    panels = figures["four_spectra"].chart.views["shoulder pitch", "pulse"]
    assert [panel.title for panel in panels] == ["disturbance", "output", "input", "cross, magnitude"]
    expected = 1e6 * study.nonparametric["shoulder_pitch"].repeated[PULSE].output
    np.testing.assert_allclose(curve(panels[1], "by repetition").y, expected)


def test_three_joint_models_have_their_own_fits_and_correlations(figures, study):
    views = figures["several"].chart.views
    assert {key[1] for key in views} == {"exchange", "5–10 Hz chirp"}
    angles, _, _, *tests = views["shoulder yaw", "5–10 Hz chirp"]
    for entry in study.multivariable.pair():
        fit = entry.fit("mimo-12")
        simulated, ahead = fit.simulation["shoulder_yaw"], fit.one_step["shoulder_yaw"]
        label = f"{entry.kind}: {simulated:.1f} % simulated, {ahead:.1f} % one step ahead"
        assert curve(angles, label).x[-1] <= 24.0, "a record shorter than what is asked for is shown to its end"
        drawn = [one for panel in tests for one in panel.series if one.label == label]
        np.testing.assert_array_equal(drawn[0].y, entry.residual_test("mimo-12").autocorrelation[1:, 0, 0])
        np.testing.assert_array_equal(drawn[1].y, entry.residual_test("mimo-12").cross_correlation[:, 0, 0])


def test_roots_beyond_the_map_are_counted(figures, study):
    (panel,) = figures["roots"].chart.views["three joints",]
    okid = study.multivariable.model("OKID").model
    outside = sum(max(abs(z.real), abs(z.imag)) >= panel.x_limits[1] for z in okid.zeros())
    name = "OKID model, zeros" + (f" ({outside} beyond)" if outside else "")
    assert len(curve(panel, name).x) == len(okid.zeros()) - outside


def test_every_model_of_every_data_set_has_a_mark(figures, study):
    for joint, sets in study.data_sets.items():
        (panel,) = figures["data_sets"].chart.views[joint.replace("_", " "),]
        assert sum(len(one.x) for one in panel.series) == len(sets.models)


def test_files_hold_every_view_and_every_value(figures, tmp_path):
    chart = figures["waveforms"].chart
    write_figures([ReportFigure("waveforms", chart, "Waveforms.")], tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"waveforms.csv"} | {
        f"waveforms-{view}.{kind}"
        for view in ("white-noise", "two-sines", "prbs", "chirp-as-played", "chirp-2-15-as-printed", "pulse")
        for kind in ("svg", "png")
    }
    head, *rows = csv.reader((tmp_path / "waveforms.csv").read_text(encoding="utf-8").splitlines())
    assert head == ["Waveform", "panel", "x axis", "y axis", "curve", "x", "y", "low", "high"]
    panels = [panel for view in chart.views.values() for panel in view]
    assert len(rows) == sum(len(one.y) for panel in panels for one in panel.series)


def test_every_chart_can_be_drawn(figures):
    for figure in figures.values():
        panels = next(iter(figure.chart.views.values()))
        drawing = draw(panels, figure.chart.columns)
        shown = [axes for axes in drawing.axes if axes.axison]
        assert [axes.get_xlabel() for axes in shown] == [panel.x for panel in panels], figure.name


def test_a_study_without_a_record_leaves_its_figure_out(study, answer):
    known = report_figures(study, answer)
    counted: list[tuple[int, int]] = []
    bare = report_figures(
        study.__class__(**{**vars(study), "data_sets": {}, "joints": {}}),
        answer,
        lambda *numbers: counted.append(numbers),
    )
    assert set(known) - set(bare) >= {"responses", "orders", "outputs"}
    assert counted == [(number, len(counted)) for number in range(1, len(counted) + 1)]


def test_the_map_of_motions_has_a_panel_for_each_and_a_mark_for_each_print():
    cell = {"joint": "elbow_pitch", "gain": 4e-3, "volts": 1.0, "friction": 1e-3, "armax_bandwidth_hz": 0.9}
    cell |= {"oe_bandwidth_hz": None, "okid_bandwidth_hz": 1.1}
    cells = [cell, {**cell, "friction": 7e-4, "armax_bandwidth_hz": 1.0}, {**cell, "volts": 2.0}]
    ((key, panels),) = motion_chart(cells).views.items()
    assert (key, [panel.title for panel in panels]) == (("elbow pitch",), ["4 mrad", "8 mrad"])
    armax, oe, _ = panels[0].series
    assert armax.x == pytest.approx([0.07, 0.1]) and armax.y == [1.0, 0.9] and np.isnan(oe.y).all()
    assert [text for _, _, text in panels[0].marks] == ["printed ARMAX (4.12)", "printed OKID (5.10)"]


RECORD = dict(read_motion())
CELL = RECORD["map"][0]
WRONG = ({"friction": float("nan")}, {"gain": -1.0}, {"joint": "tail"}, {"oe_bandwidth_hz": "fast"})
CHANGES = [{"map": [{}]}, {"joints": 5}, {"printed": [{}]}, {"arms": {}}, *({"map": [CELL | one]} for one in WRONG)]
CHANGES += [{"nominal": RECORD["nominal"] | {"score": 10**400}}]


@pytest.mark.parametrize("content", [{}, ["answers", "map"], *(RECORD | change for change in CHANGES)])
def test_what_is_no_record_of_motions_is_refused(tmp_path, content):
    path = tmp_path / "motion.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    refused("cannot read .*expected a motion.json of hmtb motion", read_motion, path)
    path.write_text("[" * 100_000, encoding="utf-8")
    refused("cannot read .*RecursionError", read_motion, path)
    refused("cannot read", read_motion, tmp_path / "missing.json")


def test_long_tables_become_files_with_plain_numbers():
    tables = LongTables()
    table = "Fits &amp; more\nModel ¦ Test 1 ¦ Test 2\n## {}\nOE ¦ −1.5 / 2\n"
    link = tables.take(table.format("yaw") + "## elbow\n\nOE&nbsp;† ¦ 3 ¦ 4 ¦\n", "fits")
    assert str(link) == (
        '<p class="file">Table <a href="tables/fits.csv">tables/fits.csv</a>, 2 rows: Fits &amp; more</p>'
    )
    assert tables.texts == {"fits": ",Model,Test 1,Test 2\nyaw,OE,-1.5 / 2,\nelbow,OE †,3,4\n"}
    tables.take(table.replace("## {}\n", ""), "plain")
    assert tables.texts["plain"] == "Model,Test 1,Test 2\nOE,-1.5 / 2,\n"
    refused("each name once", tables.take, table, "fits")
