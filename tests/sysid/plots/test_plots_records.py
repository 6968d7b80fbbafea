from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex

import sysid
from sysid import IOData, StateSpace
from sysid.plots import PALETTE, Trace, correlations, output_comparison, record, recursion, singular_values, structures
from tests.refusals import refused
from tests.sysid.plots.figures import DATA, MODEL, drawn, labels


def test_a_record_shows_outputs_above_inputs():
    upper, lower = record(DATA).axes
    np.testing.assert_array_equal(upper.get_lines()[0].get_ydata(), DATA.y[:, 0])
    np.testing.assert_array_equal(lower.get_lines()[0].get_ydata(), DATA.u[:, 0])
    assert lower.get_lines()[0].get_drawstyle() == "steps-post"  # the input is held
    assert upper.get_lines()[0].get_drawstyle() == "default"
    assert (upper.get_ylabel(), lower.get_ylabel(), lower.get_xlabel()) == ("y1 / rad", "u1 / V", "time / s")
    piece = record(DATA, start=2.0, length=4.0).axes[0].get_lines()[0]
    np.testing.assert_allclose(piece.get_xdata(), DATA.time[100:300])


def test_several_experiments_in_one_figure():
    figure = record([DATA, drawn(1), drawn(2, 300)])
    assert labels(figure) == ["run 0", "run 1", "run 2"]
    assert len({to_hex(line.get_color()) for line in figure.axes[0].get_lines()[::2]}) == 3
    assert labels(record({"a": DATA, "b": DATA})) == ["a", "b"]
    assert labels(record([DATA[:300], DATA[300:]])) == ["1: run 0", "2: run 0"]
    refused("experiment 1 has 2 input", lambda: record([DATA, IOData(np.ones((9, 2)), np.ones(9), 0.02)]))


def test_a_sample_between_gaps_is_seen():
    y = np.arange(20.0)
    y[[4, 5, 7, 8]] = np.nan
    axes = record(IOData(np.ones(20), y, 0.1, missing=True)).axes[0]
    np.testing.assert_allclose(axes.get_lines()[1].get_xdata(), [0.6])


def test_output_comparison_shows_the_piece_and_the_error():
    y = np.arange(500.0)
    data = IOData(np.ones(500), y, 0.02, output_units=("rad",))
    trace = Trace("model", y - 1.0, PALETTE["oe"])
    upper, lower = output_comparison(data, [trace], start=2.0, length=4.0, scale=1000.0, unit="mrad").axes
    measured = upper.get_lines()[0]
    np.testing.assert_allclose(measured.get_xdata(), data.time[100:300])
    np.testing.assert_allclose(measured.get_ydata(), 1000 * y[100:300])
    np.testing.assert_allclose(lower.get_lines()[0].get_ydata(), np.full(200, 1000.0))
    assert (upper.get_ylabel(), lower.get_xlabel()) == ("output / mrad", "time / s")


def test_axes_name_their_channel_and_the_operating_point():
    data = IOData(DATA.u, DATA.y + 20.0, 0.02, output_names=("T",), output_units=("K",), input_units=("V",))
    moved = data.subtract(y=20.0)
    expected = "T, deviation from 20 / K"
    assert [axes.get_ylabel().replace("\n", " ") for axes in record(moved).axes] == [expected, "u1 / V"]
    trace = Trace("model", moved.y, PALETTE["oe"])
    assert output_comparison(moved, trace).axes[0].get_ylabel() == expected
    assert output_comparison(data, trace).axes[0].get_ylabel() == "T / K"
    both = record([moved, data.subtract(y=21.0)])
    assert both.axes[0].get_ylabel().split("\n")[0].startswith("T, deviation from the")


def test_fits_are_compared_over_the_whole_record_and_over_the_chosen_horizon():
    estimate = sysid.armax(DATA, 1, 1, 1)
    fits = sysid.compare({"mine": estimate}, DATA, steps=3)
    simulation, ahead = (output_comparison(DATA, fits, ahead=horizon) for horizon in (False, True))
    upper, lower = simulation.axes
    assert labels(simulation) == ["measured", f"mine: {fits[0].simulation[0]:.1f} %"]
    assert len(upper.get_lines()[0].get_xdata()) == len(DATA)
    np.testing.assert_allclose(lower.get_lines()[0].get_ydata(), DATA.y[:, 0] - fits[0].simulated[:, 0])
    np.testing.assert_allclose(ahead.axes[0].get_lines()[1].get_ydata(), sysid.predict(estimate, DATA, steps=3)[:, 0])
    assert labels(ahead)[1] == f"mine: {fits[0].ahead[0]:.1f} %, 3 ahead"


def test_every_output_has_its_panels():
    rng = np.random.default_rng(0)
    u = rng.standard_normal((300, 1))
    y = np.hstack([sysid.simulate(MODEL, u), 2 * sysid.simulate(MODEL, u)]) + 0.01 * rng.standard_normal((300, 2))
    two = IOData(u, y, 0.02, output_names=("wrist", "elbow"))
    fits = sysid.compare(sysid.okid(two, 1, p=2), two)
    figure = output_comparison(two, fits)
    assert [axes.get_ylabel() for axes in figure.axes] == ["wrist", "error", "elbow", "error"]
    np.testing.assert_allclose(figure.axes[2].get_lines()[1].get_ydata(), fits[0].simulated[:, 1])
    assert len(output_comparison(two, fits, output="elbow").axes) == 2
    for values, message in ((np.ones(5), "5 samples, the record has 300"), (np.ones((300, 3)), "3 outputs, .* has 2")):
        refused(f"model: {message}", output_comparison, two, Trace("model", values, PALETTE["oe"]))


def test_several_experiments_are_compared_one_by_one():
    both = [DATA, drawn(1, 400)]
    (fit,) = sysid.compare(sysid.oe(both, 1, 1, 1), both)
    figure = output_comparison(both[1], fit.by_experiment[1])
    assert len(figure.axes[0].get_lines()[1].get_ydata()) == 400
    refused("expected one IOData record, got list", output_comparison, both, fit)


def test_correlations_show_bounds_and_leave_the_zero_lag_out_of_the_scale():
    lags = np.arange(26)
    values = np.where(lags == 0, 1.0, 0.02)
    panels = [(name, lags, values, 0.05) for name in ("autocorrelation", "cross-correlation")]
    whiteness, independence = correlations(panels, PALETTE["oe"]).axes
    assert (whiteness.get_ylim()[1], independence.get_ylim()[1]) == pytest.approx((1.25 * 0.05, 1.25))
    assert independence.get_xlabel() == "lag / samples"
    covariance = sysid.covf(DATA, lags=10)
    figure = correlations(covariance)
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["y1", "y1 after u1", "u1 after y1", "u1"]
    np.testing.assert_allclose(figure.axes[1].get_lines()[0].get_ydata(), covariance.normalised[:, 0, 1])


def test_residual_tests_of_one_output_and_of_several():
    test = sysid.resid(sysid.oe(DATA, 1, 1, 1), DATA, level=0.95)
    figure = correlations(test)
    whiteness, independence = figure.axes
    assert labels(figure) == ["95 % bounds"]
    np.testing.assert_allclose(whiteness.get_lines()[0].get_ydata(), test.autocorrelation[:, 0, 0])
    np.testing.assert_allclose(independence.get_lines()[0].get_xdata(), test.cross_lags)
    assert independence.get_ylabel() == "correlation with input"
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles == ["", "residuals as they are; the test whitens them"]
    rng = np.random.default_rng(0)
    noise = IOData(rng.standard_normal((300, 3)), rng.standard_normal((300, 2)), 0.1)
    model = StateSpace(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((2, 0)), np.zeros((2, 3)), None, 0.1)
    test = sysid.resid(model, noise)
    figure = correlations(test)
    assert len(figure.axes) == 8
    assert figure.axes[3].get_ylabel() == "y2 with\nu1"
    np.testing.assert_allclose(figure.axes[3].get_lines()[0].get_ydata(), test.cross_correlation[:, 1, 0])
    assert len(correlations(test, output=1, input="u2").axes) == 2
    for thing in (model, "test", [1.0]):
        refused("expected a ResidualTest, a CovarianceFunction, or panels", correlations, thing)
    refused("nothing to draw", correlations, [])


def test_singular_values_tell_the_order():
    okid, n4sid, oe = sysid.okid(DATA, 1, p=6), sysid.n4sid(DATA, 1), sysid.oe(DATA, 1, 1, 1)
    exact = sysid.era(MODEL.markov(30), 1)
    figure = singular_values({"okid": okid, "n4sid": n4sid, "era": exact, "oe": oe, "true": MODEL})
    sources = ["okid: Hankel", "n4sid: canonical correlations", "era: Hankel"]
    assert labels(figure) == [*sources, "oe: Hankel, of the model", "true: Hankel, of the model"]
    lines = figure.axes[0].get_lines()
    expected = okid.diagnostics["hankel_singular_values"]
    np.testing.assert_allclose(lines[0].get_ydata()[:6], expected[:6] / expected[0])
    assert len(lines[1].get_xdata()) == 1  # the order of the model: filled; beyond it: open
    assert lines[2].get_markerfacecolor() == "white"
    np.testing.assert_allclose(lines[3].get_ydata(), n4sid.diagnostics["canonical_correlations"])
    assert np.isfinite(lines[6].get_ydata()).sum() == 1  # the rest is rounding
    refused("cannot draw a int", singular_values, 3)


def test_criteria_over_the_number_of_parameters():
    table = sysid.selstruc(DATA[:400], (1, 2), (1, 2), (1,), validation=DATA[400:])
    figure = structures(table)
    best = ", ".join(f"{name} {value}" for name, value in table.best("bic").items())
    assert f"exp(BIC): {best}" in labels(figure)
    assert any(text.startswith("validation: ") for text in labels(figure))
    rings = [line for line in figure.axes[0].get_lines() if line.get_markerfacecolor() == "none"]
    assert min(rings[1].get_ydata()) == pytest.approx(np.exp(table.bic.min()))
    two = structures(replace(table, outputs=2))
    rings = [line for line in two.axes[0].get_lines() if line.get_markerfacecolor() == "none"]
    assert f"exp(BIC/2): {best}" in labels(two)
    assert min(rings[1].get_ydata()) == pytest.approx(np.exp(table.bic.min() / 2))
    refused("expected a StructureTable", structures, DATA)


def test_parameters_over_time():
    estimate, whole = sysid.rarx(DATA, 1, 1, 1), sysid.arx(DATA, 1, 1, 1)
    a, b = recursion(estimate, reference=whole).axes
    np.testing.assert_allclose(a.get_lines()[0].get_ydata(), estimate.parameters[:, 0])
    np.testing.assert_allclose(a.get_lines()[0].get_xdata(), DATA.time, atol=1e-9)
    dotted = [line for line in b.get_lines() if line.get_linestyle() == ":"]
    np.testing.assert_allclose(dotted[0].get_ydata()[0], whole.parameters[1])
    low, high = b.get_ylim()
    assert low < estimate.final.parameters[1] < high
    later = sysid.rarx(drawn(3), 1, 1, 1, start=estimate)
    assert recursion(later).axes[0].get_lines()[0].get_xdata()[0] == pytest.approx(600 * 0.02)
    refused("expected a RecursiveEstimate", recursion, whole)
