"""Command and measured angle under a film."""

from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import JOINTS, simulate
from scenarios.experiments.film_plot import CURSOR, MotionPlot, plotted_joints, with_plot
from scenarios.experiments.registry import load


@pytest.fixture(scope="module")
def log():
    (log,) = simulate([replace(load("siso-5-elbow_pitch"), duration=3.0)]).logs
    return log


@pytest.fixture(scope="module")
def plot(log):
    return MotionPlot(log, (1.0, 3.0), (640, 480))


def test_excited_joints_are_plotted_or_those_that_move_most(log):
    whole = slice(None)
    assert plotted_joints(log, whole) == ["elbow_pitch"]
    commanded = np.outer(np.linspace(0.0, 1.0, len(log)), [0.1, 0.7, 0.2, 0.0, 0.3, 0.4, 0.05])
    tool = replace(log, axes=("x", "y"), volts=np.zeros((len(log), 2)), counts=np.zeros((len(log), 2)))
    expected = [JOINTS[number] for number in (1, 4, 5)]
    assert plotted_joints(replace(tool, commanded=commanded), whole) == expected


def test_curves_are_uncovered_up_to_the_time_of_the_frame(plot):
    start, middle, end = (plot.at(time).astype(int) for time in (1.0, 2.0, 3.0))
    (columns,) = np.nonzero((middle == CURSOR).all(axis=2).any(axis=0))
    assert columns.min() == pytest.approx(330, abs=30)
    left, right = columns.min(), columns.max() + 1
    assert np.array_equal(middle[:, 60:left], end[:, 60:left])
    assert np.array_equal(middle[:, right:600], start[:, right:600])
    assert (np.abs(start - end)[:, 60:left].max(axis=2) > 40).any(), "curves of the first half"
    assert (np.abs(start - end)[:, right:600].max(axis=2) > 40).any(), "curves of the second half"


@pytest.mark.slow
@pytest.mark.parametrize(("width", "height"), [(640, 480), (1280, 960), (1921, 480), (320, 240)])
def test_a_plot_is_as_wide_as_its_film_and_of_even_height(log, width, height):
    strip = MotionPlot(log, (1.0, 3.0), (width, height)).at(1.5)
    assert strip.dtype == np.uint8
    assert strip.shape[1:] == (width, 3)
    assert strip.shape[0] % 2 == 0
    assert strip.shape[0] < 0.7 * height


def test_narrow_films_and_single_pictures_have_no_plot(log):
    for width, times in ((300, [0.0, 1.0]), (640, [0.0])):
        frames = [np.zeros((48, width, 3), np.uint8) for _ in times]
        assert [frame.shape for frame in with_plot(iter(frames), log, np.array(times))] == [(48, width, 3)] * len(times)
    frames = [np.zeros((480, 640, 3), np.uint8)] * 2
    first, last = with_plot(iter(frames), log, np.array([0.0, 1.0]))
    assert first.shape == last.shape == (628, 640, 3)
