"""The files drawn are those that the thesis describes."""

import numpy as np
import pytest

from scenarios.experiments.registry import load
from scenarios.thesis.figures_waveforms import waveform, waveform_figures


def test_tones_lie_where_the_captions_say():
    figures = waveform_figures()
    (sines,) = figures["sum-of-sines"].files.values()
    spectrum = sines.psd()
    np.testing.assert_allclose(spectrum.frequency[spectrum.density > 1e-9], [0.5, 2.0])
    assert np.abs(np.fft.rfft(sines.points))[[1, 4]] == pytest.approx([50.0, 50.0]), "height one each"
    sweep, printed = figures["chirp"].files.values()
    spectrum = printed.psd()
    assert spectrum.frequency[spectrum.density > 1e-9] == pytest.approx([5.0])
    spectrum = sweep.psd()
    inside = (spectrum.frequency >= 0.5) & (spectrum.frequency <= 2.5)
    assert spectrum.density[inside].sum() > 0.9 * spectrum.density.sum()
    (pulse,) = figures["bipolar-ramping-pulse"].files.values()
    spectrum = pulse.psd()
    np.testing.assert_allclose(spectrum.frequency[spectrum.density > 1e-9] % 2.0, 1.0, atol=1e-9)


def test_files_of_tests_are_those_played():
    for name, number in (("prbs", 5), ("bipolar-ramping-pulse", 7)):
        (file,) = waveform_figures()[name].files.values()
        played = load(f"siso-{number}-elbow_pitch").excitation[0].waveform()
        assert np.array_equal(file.points, played.points)


def test_a_figure_shows_every_point_and_every_line():
    files = waveform_figures()["chirp"].files
    figure = waveform(files)
    assert len(figure.axes) == 2 * len(files)
    for left, right, file in zip(figure.axes[::2], figure.axes[1::2], files.values(), strict=True):
        (steps,) = left.lines
        assert np.array_equal(np.asarray(steps.get_ydata())[:-1], file.points)
        (stems,) = right.collections
        assert len(stems.get_paths()) == 51
