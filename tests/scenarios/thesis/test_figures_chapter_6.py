"""Figures of chapter VI say what the numbers say."""

import numpy as np

from scenarios.thesis import figures_chapter_6 as draw
from scenarios.thesis import figures_records as records
from scenarios.thesis.figures_chapter_6 import block_diagrams


def test_block_diagrams_hold_the_polynomials():
    armax, oe = ({text.get_text() for text in axes.texts} for axes in block_diagrams().axes)
    assert {"B(q)", "C(q)", "1 / A(q)", "u", "e", "y"} <= armax
    assert {"B(q) / F(q)", "u", "e", "y"} <= oe


def test_roots_outside_the_map_are_listed(study):
    own, okid = draw.root_maps(study).axes
    assert "1.3 ± 3.7j, 1.6 ± 3.2j, −0.5 ± 2.6j" in okid.get_xlabel()
    assert "−3.4, −2.2, −1.6" in own.get_xlabel()


def test_correlations_say_how_many_lags_are_outside(study):
    figure = records.correlations(study, "mimo-12", inputs=("shoulder_yaw", "elbow_pitch"))
    grid = np.array(figure.axes).reshape(5, 2)
    for column, entry in enumerate(study.multivariable.pair()):
        test = entry.residual_test("mimo-12")
        assert grid[0, column].get_title(loc="left") == f"shoulder yaw: {test.outside_whiteness[0]} of 25 lags outside"
        # the axis is the same up and down
        low, high = grid[3, column].get_ylim()
        assert -low == high >= np.abs(test.cross_correlation[:, 0, 0]).max()


def test_both_columns_of_the_chirp_have_their_own_fit(study):
    figure = records.part_outputs(study, "mimo-12", start=20.0, length=2.0)
    grid = np.array(figure.axes).reshape(3, 2)
    own, okid = (entry.fit("mimo-12") for entry in study.multivariable.pair())
    for axes, way in zip(grid[0], ("simulation", "one_step"), strict=True):
        a, b = (fit.of(way)["shoulder_yaw"] for fit in (own, okid))
        assert axes.get_title(loc="left") == f"SysID {a:.1f} %, OKID {b:.1f} %"
    # a record shorter than what is asked for is shown to its end
    time = grid[0, 0].get_lines()[0].get_xdata()
    assert time[-1] <= 24.0


def test_a_column_of_the_fits_has_a_mark_for_every_record(study):
    figure = draw.every_fit(study)
    for axes, joint in zip(figure.axes, study.joints, strict=True):
        drawn = [np.asarray(line.get_xdata()) for line in axes.get_lines() if line.get_label() == "OKID model"]
        fits = study.multivariable.model("OKID").fits
        assert drawn[0].tolist() == [fit.simulation[joint] for fit in fits.values()]
