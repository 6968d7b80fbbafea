"""A drawn record hides no peak and invents none."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from scenarios.thesis.envelope import COLUMNS, columns, envelope
from sysid.plots import PALETTE
from tests.refusals import refused

STYLE = PALETTE["measured"]


def test_no_peak_is_lost():
    values = np.sin(np.arange(12_000) / 7.0)
    values[[3_333, 11_999]] = 5.0, -4.0
    time, low, high = columns(values, 0.02)
    assert len(time) == len(low) == len(high) == COLUMNS
    assert (high.max(), low.min()) == (5.0, -4.0)
    assert (time[0], time[-1]) == (0.0, pytest.approx(11_999 * 0.02))
    assert np.all(np.diff(time) > 0)
    assert abs(time[high.argmax()] - 3_333 * 0.02) <= 12_000 / COLUMNS * 0.02


def test_neighbouring_columns_meet():
    _, low, high = columns(np.arange(5_000.0), 0.02)
    assert np.array_equal(high[:-1], low[1:])


def test_a_long_record_is_a_band_in_the_unit_of_the_axis():
    axes = Figure().subplots()
    envelope(axes, np.linspace(-0.01, 0.03, 12_000), 0.02, STYLE, scale=1000.0, start=4.0, label="measured")
    assert not axes.lines
    (band,) = axes.collections
    x, y = np.asarray(band.get_paths()[0].vertices).T
    assert (x.min(), x.max()) == (pytest.approx(4.0), pytest.approx(4.0 + 11_999 * 0.02))
    assert (y.min(), y.max()) == (pytest.approx(-10.0), pytest.approx(30.0))
    assert len(x) < 2.1 * COLUMNS


def test_a_short_record_is_drawn_as_it_is():
    axes = Figure().subplots()
    values = np.random.default_rng(1).standard_normal(2 * COLUMNS)
    envelope(axes, values, 0.02, STYLE, scale=2.0, held=True)
    (line,) = axes.lines
    assert np.array_equal(line.get_ydata(), 2.0 * values)
    assert line.get_drawstyle() == "steps-post"


def test_missing_samples_leave_a_gap_only_where_nothing_is_known():
    values = np.ones(12_000)
    values[::3] = np.nan
    values[6_000:6_100] = np.nan
    _, low, high = columns(values, 0.02)
    assert np.array_equal(np.isnan(low), np.isnan(high))
    assert 0 < np.isnan(low).sum() <= 5
    assert np.all(low[np.isfinite(low)] == 1.0)


def test_several_channels_are_refused():
    refused(r"\(4, 2\)", envelope, Figure().subplots(), np.zeros((4, 2)), 0.02, STYLE)
