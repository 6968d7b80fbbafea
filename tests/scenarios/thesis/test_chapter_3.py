"""The page on chapters II and III answers every figure of theirs and says what each record says."""

import re

import numpy as np
import pytest

from scenarios.thesis import figures_chapter_3 as draw
from scenarios.thesis.chapter_3 import THESIS
from scenarios.thesis.figures_waveforms import waveform_figures
from scenarios.thesis.nonparametric import PULSE, SINES


def test_every_figure_of_chapters_two_and_three_is_answered_once():
    numbers = [number for entry in waveform_figures().values() for number in entry.thesis]
    assert set(numbers) == set(map(str, range(11, 17)))
    numbers += [number for figures in THESIS.values() for entry in figures.values() for number in entry]
    assert len(numbers) == len(set(numbers))
    assert set(numbers) == {*map(str, range(11, 17)), *map(str, range(20, 37)), *(f"A{n}" for n in range(1, 30))}


def test_the_page_has_the_figures_and_a_row_for_every_test(report):
    shown = report.context["chapter_3"]
    single, several = shown["single"], shown["several"]
    assert [row.name for row in single] == [str(n) for n in range(1, 9)]
    assert len(several) == 15
    assert all(cell is not None for row in (*single, *several) for cell in row.cells)
    assert all("thesis" not in picture.name for picture in report.gallery.pictures)


def test_a_record_shows_the_steps_of_the_converters(study):
    figure = draw.record(study.logs["siso-7-shoulder_yaw"], "shoulder_yaw", length=2.0)
    whole, _, command, measured = figure.axes
    assert whole.get_xlim() == pytest.approx((0.0, 24.0))
    for axes, step in ((command, 0.327), (measured, 2e3 * np.pi / 2**16)):
        (label,) = axes.texts
        sentence = re.search(r"[\d.]+", label.get_text())
        multiple = float(sentence[0]) / step
        assert multiple == pytest.approx(max(round(multiple), 1), abs=0.02), "ten periods may miss a level"
        values = np.asarray(axes.lines[0].get_ydata())
        assert np.unique(np.round(values, 6)).size < values.size, "levels come again"


def test_phase_of_the_window_is_drawn_only_where_the_input_has_power(study):
    entry, estimates = study.joints["elbow_pitch"], study.nonparametric["elbow_pitch"]
    _, phase = draw.transfer_function(entry, estimates).axes
    drawn = [np.asarray(line.get_xdata()) for line in phase.lines if line.get_marker() == "v"]
    assert len(drawn) == 1
    assert {2.5, 10.0} <= set(np.round(drawn[0], 6))
    assert len(drawn[0]) < 0.2 * len(estimates.spectra[SINES].frequencies)


def test_four_spectra_have_a_panel_each_in_milliradians(study):
    entry, estimates = study.joints["shoulder_pitch"], study.nonparametric["shoulder_pitch"]
    figure = draw.four_spectra(study, entry, estimates, PULSE)
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        "disturbance",
        "output",
        "input",
        "cross, magnitude",
    ]
    output = figure.axes[1]
    (line,) = [entry for entry in output.lines if entry.get_label() == "by repetition"]
    np.testing.assert_allclose(np.asarray(line.get_ydata()), 1e6 * estimates.repeated[PULSE].output)
