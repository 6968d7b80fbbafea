"""Figures of records, of their covariances, and of what models make of them."""

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import sysid
from sysid import IOData, StateSpace, SysidError
from sysid.plots import PALETTE, Trace, correlations, output_comparison, record, recursion, singular_values, structures
from tests.sysid.refusals import refused

MODEL = StateSpace([[0.9]], [[0.1]], [[1.0]], [[0.0]], None, 0.02, [[1e-4]])


def drawn(seed: int, samples: int = 600) -> IOData:
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(samples)
    return IOData(u, sysid.simulate(MODEL, u, rng=rng), 0.02, output_units=("rad",), name=f"run {seed}")


@pytest.fixture(scope="module")
def data() -> IOData:
    return drawn(0)


def labels(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_a_record_shows_outputs_above_inputs(data: IOData) -> None:
    upper, lower = record(data).axes
    np.testing.assert_array_equal(upper.get_lines()[0].get_ydata(), data.y[:, 0])
    np.testing.assert_array_equal(lower.get_lines()[0].get_ydata(), data.u[:, 0])
    assert lower.get_lines()[0].get_drawstyle() == "steps-post"  # the input is held
    assert upper.get_lines()[0].get_drawstyle() == "default"
    assert (upper.get_ylabel(), lower.get_ylabel(), lower.get_xlabel()) == ("y1 / rad", "u1", "time / s")


def test_a_piece_of_a_record(data: IOData) -> None:
    upper = record(data, start=2.0, length=4.0).axes[0]
    np.testing.assert_allclose(upper.get_lines()[0].get_xdata(), data.time[100:300])


def test_several_experiments_in_one_figure(data: IOData) -> None:
    figure = record([data, drawn(1), drawn(2, 300)])
    assert labels(figure) == ["run 0", "run 1", "run 2"]
    colours = [to_hex(line.get_color()) for line in figure.axes[0].get_lines()[::2]]
    assert len(set(colours)) == 3
    assert labels(record({"a": data, "b": data})) == ["a", "b"]
    assert labels(record([data[:300], data[300:]])) == ["1: run 0", "2: run 0"]
    refused("experiment 1 has 2 input", lambda: record([data, IOData(np.ones((9, 2)), np.ones(9), 0.02)]))


def test_a_sample_between_gaps_is_seen() -> None:
    y = np.arange(20.0)
    y[[4, 5, 7, 8]] = np.nan
    axes = record(IOData(np.ones(20), y, 0.1, missing=True)).axes[0]
    np.testing.assert_allclose(axes.get_lines()[1].get_xdata(), [0.6])


def test_the_whole_record_is_compared(data: IOData) -> None:
    found = sysid.oe(data, 1, 1, 1)
    (fit,) = sysid.compare(found, data)
    upper, lower = output_comparison(data, fit).axes
    assert len(upper.get_lines()[0].get_xdata()) == len(data)
    np.testing.assert_allclose(lower.get_lines()[0].get_ydata(), data.y[:, 0] - fit.simulated[:, 0])


def test_the_prediction_over_the_horizon_asked_for(data: IOData) -> None:
    found = sysid.armax(data, 1, 1, 1)
    fits = sysid.compare({"mine": found}, data, steps=3)
    figure = output_comparison(data, fits, ahead=True)
    np.testing.assert_allclose(figure.axes[0].get_lines()[1].get_ydata(), sysid.predict(found, data, steps=3)[:, 0])
    assert labels(figure)[1] == f"mine: {fits[0].ahead[0]:.1f} %, 3 ahead"


def test_every_output_has_its_panels() -> None:
    rng = np.random.default_rng(0)
    u = rng.standard_normal((300, 1))
    y = np.hstack([sysid.simulate(MODEL, u), 2 * sysid.simulate(MODEL, u)]) + 0.01 * rng.standard_normal((300, 2))
    two = IOData(u, y, 0.02, output_names=("wrist", "elbow"))
    fits = sysid.compare(sysid.okid(two, 1, p=2), two)
    figure = output_comparison(two, fits)
    assert [axes.get_ylabel() for axes in figure.axes] == ["wrist", "error", "elbow", "error"]
    np.testing.assert_allclose(figure.axes[2].get_lines()[1].get_ydata(), fits[0].simulated[:, 1])
    assert len(output_comparison(two, fits, output="elbow").axes) == 2
    with pytest.raises(SysidError, match="model: 5 samples, the record has 300"):
        output_comparison(two, Trace("model", np.ones(5), PALETTE["oe"]))
    with pytest.raises(SysidError, match="model: 3 outputs, the record has 2"):
        output_comparison(two, Trace("model", np.ones((300, 3)), PALETTE["oe"]))


def test_several_experiments_are_compared_one_by_one(data: IOData) -> None:
    both = [data, drawn(1, 400)]
    (fit,) = sysid.compare(sysid.oe(both, 1, 1, 1), both)
    figure = output_comparison(both[1], fit.by_experiment[1])
    assert len(figure.axes[0].get_lines()[1].get_ydata()) == 400
    refused("expected one IOData record, got list", lambda: output_comparison(both, fit))  # type: ignore[arg-type]


def test_covariance_functions_are_drawn_channel_by_channel(data: IOData) -> None:
    found = sysid.covf(data, lags=10)
    figure = correlations(found)
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["y1", "y1 after u1", "u1 after y1", "u1"]
    np.testing.assert_allclose(figure.axes[1].get_lines()[0].get_ydata(), found.normalised[:, 0, 1])


def test_residuals_of_several_outputs_have_a_column_each() -> None:
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
        with pytest.raises(SysidError, match="expected a ResidualTest, a CovarianceFunction, or panels"):
            correlations(thing)  # type: ignore[arg-type]
    refused("nothing to draw", lambda: correlations([]))


def test_singular_values_tell_the_order(data: IOData) -> None:
    okid, n4sid, oe = sysid.okid(data, 1, p=6), sysid.n4sid(data, 1), sysid.oe(data, 1, 1, 1)
    exact = sysid.era(MODEL.markov(30), 1)
    figure = singular_values({"okid": okid, "n4sid": n4sid, "era": exact, "oe": oe, "true": MODEL})
    axes = figure.axes[0]
    assert labels(figure) == [
        "okid: Hankel",
        "n4sid: canonical correlations",
        "era: Hankel",
        "oe: Hankel, of the model",
        "true: Hankel, of the model",
    ]
    first = axes.get_lines()[0].get_ydata()
    expected = okid.diagnostics["hankel_singular_values"]
    np.testing.assert_allclose(first[:6], expected[:6] / expected[0])
    inside, outside = axes.get_lines()[1:3]
    assert len(inside.get_xdata()) == 1
    assert outside.get_markerfacecolor() == "white"
    np.testing.assert_allclose(axes.get_lines()[3].get_ydata(), n4sid.diagnostics["canonical_correlations"])
    assert np.isfinite(axes.get_lines()[6].get_ydata()).sum() == 1  # the rest is rounding
    refused("cannot draw a int", lambda: singular_values(3))  # type: ignore[arg-type]


def test_criteria_over_the_number_of_parameters(data: IOData) -> None:
    table = sysid.selstruc(data[:400], (1, 2), (1, 2), (1,), validation=data[400:])
    figure = structures(table)
    best = ", ".join(f"{name} {value}" for name, value in table.best("bic").items())
    assert f"exp(BIC): {best}" in labels(figure)
    assert any(text.startswith("validation: ") for text in labels(figure))
    rings = [line for line in figure.axes[0].get_lines() if line.get_markerfacecolor() == "none"]
    assert min(rings[1].get_ydata()) == pytest.approx(np.exp(table.bic.min()))
    refused("expected a StructureTable", lambda: structures(data))  # type: ignore[arg-type]


def test_parameters_over_time(data: IOData) -> None:
    found, whole = sysid.rarx(data, 1, 1, 1), sysid.arx(data, 1, 1, 1)
    figure = recursion(found, reference=whole)
    a, b = figure.axes
    np.testing.assert_allclose(a.get_lines()[0].get_ydata(), found.parameters[:, 0])
    np.testing.assert_allclose(a.get_lines()[0].get_xdata(), data.time, atol=1e-9)
    dotted = [line for line in b.get_lines() if line.get_linestyle() == ":"]
    np.testing.assert_allclose(dotted[0].get_ydata()[0], whole.parameters[1])
    low, high = b.get_ylim()
    assert low < found.final.parameters[1] < high
    later = sysid.rarx(drawn(3), 1, 1, 1, start=found)
    assert recursion(later).axes[0].get_lines()[0].get_xdata()[0] == pytest.approx(600 * 0.02)
    refused("expected a RecursiveEstimate", lambda: recursion(whole))  # type: ignore[arg-type]
