"""Charts as data keep peaks and gaps; drawn ones label shared axes once and leave out what no axis can hold."""

import json
from dataclasses import replace

import numpy as np
import pytest

from scenarios.report.chart import COLUMNS, Chart, Panel, Series, by_view, record_series, with_log_ranges
from scenarios.report.chart_drawing import draw
from scenarios.report.figures import svg
from sysid.plots import PALETTE

LOOK = PALETTE["measured"]
MARKS = replace(LOOK, line="")


def test_no_peak_of_a_record_is_lost_and_neighbouring_columns_meet():
    values = np.sin(np.arange(12_000) / 7.0)
    values[[3_333, 11_999]] = 5.0, -4.0
    drawn = record_series("measured", values, 0.02, LOOK, start=4.0)
    assert len(drawn.x) == len(drawn.low) == len(drawn.high) == COLUMNS
    assert (drawn.high.max(), drawn.low.min()) == (5.0, -4.0)
    assert abs(drawn.x[drawn.high.argmax()] - 4.0 - 3_333 * 0.02) <= 12_000 / COLUMNS * 0.02
    rising = record_series("measured", np.arange(5_000.0), 0.02, LOOK)
    assert np.array_equal(rising.high[:-1], rising.low[1:])


def test_missing_samples_leave_a_gap_only_where_nothing_is_known():
    values = np.ones(12_000)
    values[::3] = np.nan
    values[6_000:6_100] = np.nan
    drawn = record_series("measured", values, 0.02, LOOK)
    assert 0 < np.isnan(drawn.low).sum() <= 3
    assert np.all(drawn.low[np.isfinite(drawn.low)] == 1.0)


def test_a_short_record_is_drawn_as_it_is():
    values = np.random.default_rng(1).standard_normal(2 * COLUMNS)
    drawn = record_series("commanded", values, 0.02, LOOK, held=True)
    assert np.array_equal(drawn.y, values) and drawn.kind == "step" and drawn.low is None


def test_data_of_a_chart_are_rounded_shared_and_gaps_are_null():
    time = np.array([0.0, 1.0])
    series = (Series("a", time, np.array([1 / 3, np.nan]), LOOK), Series("b", time, time, LOOK, -time, time))
    marks = (("x", 1.0, "1 Hz"), ("x", np.nan, "no truth"))
    views = by_view(lambda n: (Panel("time / s", "y", series * n, marks=marks),), {"one": 1, "none": 0, "two": 2})
    data = Chart(views).data()
    first, second = data["views"]["one"][0]["series"]
    assert (first["y"], first["x"], second["x"], first["high"]) == ((0.3333, None), 0, 0, None)
    assert (data["x"], second["high"]) == ([[0.0, 1.0]], (0.0, 1.0))
    assert data["views"]["one"][0]["marks"] == [("x", 1.0, "1 Hz")]
    assert data["choices"] == [("Joint", ["one", "none", "two"])]
    assert json.loads(json.dumps(data, allow_nan=False))["columns"] == 1
    assert not Chart(by_view(lambda n: (), {"one": 1})).views


def test_counts_far_from_zero_keep_their_steps():
    """An encoder that moves by single counts about eight million."""
    counts = 8_000_000.0 + np.arange(5)
    (panel,) = Chart({("all",): (Panel("time / s", "counts", [Series("a", np.arange(5.0), counts, LOOK)]),)}).data()[
        "views"
    ]["all"]
    assert panel["series"][0]["y"] == tuple(counts)


def test_logarithmic_axes_of_panels_have_one_range_and_zero_stands_at_its_end():
    first = Panel("x", "y", [Series("a", [1.0, 2.0], [0.0, 1e-9], LOOK)], log="y")
    second = Panel("x", "y", [Series("a", [1.0, 2.0], [np.inf, 1e3], LOOK)], log="y")
    panels = with_log_ranges([first, second, Panel("x", "y", (), log="y")])
    low, high = panels[0].y_limits
    assert all(panel.y_limits == (low, high) and panel.x_limits is None for panel in panels)
    assert 0.01 / 2 < low < 0.01 and 1e3 < high < 2e3
    np.testing.assert_array_equal(panels[0].series[0].y, [low, low])
    np.testing.assert_array_equal(panels[1].series[0].y, [np.nan, 1e3])


def test_range_of_a_logarithmic_axis_holds_bars_along_it_and_wider_values():
    bars = Series("a", [1.0], [3.0], MARKS, [0.2], [4.0], along=True)
    (panel,) = with_log_ranges([Panel("x", "y", [bars], log="x")], at_least=(9.0,))
    assert panel.x_limits == pytest.approx((0.2 / 1.3, 9.0 * 1.3))
    (panel,) = with_log_ranges([Panel("x", "y", [Series("a", [0.0, np.nan], [1.0, 2.0], LOOK)], log="x")])
    assert panel.x_limits is None


def test_shared_axes_are_labelled_once_and_panels_without_series_say_so():
    panels = [Panel("x", f"row {n // 2}", [Series("a", [1.0, 2.0], [n, n], LOOK)]) for n in range(3)]
    figure = draw([*panels[:2], replace(panels[2], series=())], columns=2, shared=True, row_height=1.0)
    figure.draw_without_rendering()
    first, second, third, empty = figure.axes
    assert [axes.get_ylabel() for axes in figure.axes] == ["row 0", "", "row 1", ""]
    assert figure.get_supxlabel() == "x" and not any(axes.get_xlabel() for axes in figure.axes)
    below = [any(label.get_visible() for label in axes.get_xticklabels()) for axes in (first, second, third)]
    assert below == [False, True, True] and not empty.axison
    assert first.get_ylim() == second.get_ylim()
    assert [text.get_text() for text in third.texts] == ["none"]


@pytest.mark.filterwarnings("error")
def test_names_are_no_formulas_and_numbers_that_no_axis_can_hold_are_left_out():
    names = ["1 a$\\q$", "2 $b"]
    series = Series("c $\\q$", [1.0, 1e308], names, MARKS, [-1e308, 0.5], [2.0, np.inf], along=True)
    panel = Panel("$\\x$", "", [series], "t $\\q$", marks=(("y", 1.0, "$\\no$"),))
    figure = draw([panel], name_marks=True)
    assert svg(figure, "names", "m").startswith("<svg")
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == ["1 a\\$\\q\\$", "2 \\$b"]
    assert figure.axes[0].get_xlim()[1] < 10.0


@pytest.mark.parametrize(
    "label", ["OE 2/2/1", "ARMAX, block-diagonal, poles", "published OKID (5.10), zeros (2 beyond)"]
)
def test_long_labels_stay_inside_the_figure(label):
    series = [Series(f"{label} {k}", [0.0, 1.0], [0.0, 1.0], PALETTE["oe"]) for k in range(5)]
    figure = draw([Panel("x", "y", series)])
    figure.draw_without_rendering()
    assert figure.legends[0].get_window_extent().width <= figure.bbox.width


def test_stems_have_no_line_between_their_ends():
    stems = Series("stems", [0, 1, 2], [1.0, -1.0, 1.0], PALETTE["okid"], kind="stem")
    (axes,) = [axes for axes in draw([Panel("lag", "r", [stems])]).axes if axes.axison]
    assert [line.get_linestyle() for line in axes.lines] == ["None"]
