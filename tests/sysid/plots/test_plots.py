"""Figures show what they are given, with units, in the one palette."""

import io

import numpy as np
import pytest
from matplotlib.colors import to_hex

import sysid
import sysid.plots
from sysid import FrequencyResponse, IOData, StateSpace, SysidError
from sysid.plots import PALETTE, Curve, Roots, Trace, bode, correlations, output_comparison, pzmap, spectra
from tests.sysid.refusals import refused

MODEL = StateSpace([[0.9]], [[0.1]], [[1.0]], [[0.0]], None, 0.02)
F = np.geomspace(0.05, 25, 40)


def response(method: str, *, covariance: bool = False) -> FrequencyResponse:
    value = MODEL.frequency_response(F)
    spread = np.broadcast_to(1e-4 * np.eye(2), (len(F), 1, 1, 2, 2)).copy() if covariance else None
    return FrequencyResponse(F, value, 0.02, method, covariance=spread)


def render(figure: object) -> int:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg")  # type: ignore[attr-defined]
    return len(buffer.getvalue())


def test_palette_tells_everything_apart() -> None:
    colours = [style.colour for style in PALETTE.values()]
    assert len(set(colours)) == len(colours)


def test_bode_draws_decibels_and_degrees_over_hertz() -> None:
    curves = [Curve("truth", response("truth")), Curve("found", response("oe", covariance=True))]
    figure = bode(curves, relative_to_dc=True, mark_hz=1.0, limits_hz=(0.1, 25))
    upper, lower = figure.axes
    truth, found = upper.get_lines()[:2]
    np.testing.assert_allclose(truth.get_ydata(), 20 * np.log10(np.abs(MODEL.frequency_response(F)[:, 0, 0])))
    np.testing.assert_allclose(
        lower.get_lines()[0].get_ydata(), np.degrees(np.unwrap(np.angle(MODEL.frequency_response(F)[:, 0, 0])))
    )
    assert (to_hex(truth.get_color()), to_hex(found.get_color())) == (PALETTE["truth"].colour, PALETTE["oe"].colour)
    assert len(upper.collections) == len(lower.collections) == 1  # the band of the one that has a covariance
    assert upper.get_xscale() == "log"
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("magnitude / dB", "phase / degrees")
    assert lower.get_xlabel() == "frequency / Hz"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["truth", "found"]
    assert render(figure) > 1000


def test_pole_zero_map_counts_what_lies_outside() -> None:
    far = StateSpace([[0.9, 1.0], [-0.2, 0.0]], [[0.1], [0.3]], [[1.0, 0.0]], [[0.0]], None, 0.02)
    np.testing.assert_allclose(far.zeros(), [-3.0])
    figure = pzmap([Roots("near", MODEL, PALETTE["truth"]), Roots("far", far, PALETTE["oe"])])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["near", "far (1 outside)"]
    crosses = [line for line in figure.axes[0].get_lines() if line.get_marker() == "x"]
    np.testing.assert_allclose(crosses[0].get_xdata(), [0.9])
    assert render(figure) > 1000


def test_output_comparison_shows_the_piece_and_the_error() -> None:
    y = np.arange(500.0)
    data = IOData(np.ones(500), y, 0.02, output_units=("rad",))
    trace = Trace("model", y - 1.0, PALETTE["oe"])
    figure = output_comparison(data, [trace], start=2.0, length=4.0, scale=1000.0, unit="mrad")
    upper, lower = figure.axes
    measured = upper.get_lines()[0]
    np.testing.assert_allclose(measured.get_xdata(), data.time[100:300])
    np.testing.assert_allclose(measured.get_ydata(), 1000 * y[100:300])
    np.testing.assert_allclose(lower.get_lines()[0].get_ydata(), np.full(200, 1000.0))
    assert upper.get_ylabel() == "output / mrad"
    assert lower.get_xlabel() == "time / s"


def test_correlations_show_bounds_and_leave_the_zero_lag_out_of_the_scale() -> None:
    lags = np.arange(26)
    values = np.where(lags == 0, 1.0, 0.02)
    figure = correlations(
        [("autocorrelation", lags, values, 0.05), ("cross-correlation", lags, values, 0.05)], PALETTE["oe"]
    )
    whiteness, independence = figure.axes
    assert whiteness.get_ylim()[1] == pytest.approx(1.25 * 0.05)
    assert independence.get_ylim()[1] == pytest.approx(1.25)
    assert figure.axes[-1].get_xlabel() == "lag / samples"
    assert render(figure) > 1000


def test_spectra_leave_out_zero_frequency() -> None:
    f = np.linspace(0, 25, 26)
    figure = spectra(f, [Trace("noise", np.ones(26), PALETTE["spa"])], unit="rad")
    (line,) = figure.axes[0].get_lines()
    assert line.get_xdata()[0] == 1.0
    assert figure.axes[0].get_ylabel() == "spectral density / (rad²/Hz)"


@pytest.fixture(scope="module")
def data() -> IOData:
    rng = np.random.default_rng(0)
    u = rng.standard_normal(600)
    y = np.zeros(600)
    for k in range(1, 600):
        y[k] = 0.9 * y[k - 1] + 0.1 * u[k - 1]
    return IOData(u, y + 0.01 * rng.standard_normal(600), 0.02)


def labels(figure: object) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]  # type: ignore[attr-defined]


def test_every_name_is_there() -> None:
    assert all(hasattr(sysid.plots, name) for name in sysid.plots.__all__)


def test_bode_takes_records_as_they_come(data: IOData) -> None:
    oe, arx = sysid.oe(data, 1, 1, 1), sysid.arx(data, 1, 1, 1)
    figure = bode([sysid.spa(data), oe, arx, MODEL])
    upper, _ = figure.axes
    assert labels(figure) == ["SPA", "OE 1 1 1", "ARX 1 1 1", "model"]
    colours = [to_hex(line.get_color()) for line in upper.get_lines()]
    assert colours[:3] == [PALETTE[method].colour for method in ("spa", "oe", "arx")]
    assert len(set(colours)) == 4
    nyquist = 25.0
    np.testing.assert_allclose(upper.get_lines()[1].get_xdata()[[0, -1]], [1e-3 * nyquist, nyquist])
    assert render(figure) > 1000
    assert labels(bode(oe)) == ["OE 1 1 1"]
    assert labels(bode({"mine": oe, "true": MODEL})) == ["mine", "true"]
    twice = bode([oe, oe], frequencies=F)
    assert labels(twice) == ["OE 1 1 1", "OE 1 1 1 (2)"]
    first, second = twice.axes[0].get_lines()
    assert to_hex(first.get_color()) != to_hex(second.get_color())
    np.testing.assert_allclose(first.get_xdata(), F)


def test_pole_zero_map_takes_estimates_and_models(data: IOData) -> None:
    oe = sysid.oe(data, 1, 1, 1)
    figure = pzmap([oe, MODEL, Roots("styled", MODEL, PALETTE["truth"])])
    assert labels(figure) == ["OE 1 1 1", "model", "styled"]
    crosses = [line for line in figure.axes[0].get_lines() if line.get_marker() == "x"]
    np.testing.assert_allclose(crosses[0].get_xdata(), oe.model.poles().real)
    assert labels(pzmap({"mine": oe})) == ["mine"]


def test_correlations_take_a_residual_test(data: IOData) -> None:
    test = sysid.resid(sysid.oe(data, 1, 1, 1), data, level=0.95)
    figure = correlations(test)
    whiteness, independence = figure.axes
    assert labels(figure) == ["95 % bounds"]
    np.testing.assert_allclose(whiteness.get_lines()[0].get_ydata(), test.autocorrelation[:, 0, 0])
    np.testing.assert_allclose(independence.get_lines()[0].get_xdata(), test.cross_lags)
    assert independence.get_ylabel() == "correlation with input"


def test_output_comparison_takes_fits(data: IOData) -> None:
    (fit,) = sysid.compare({"mine": sysid.oe(data, 1, 1, 1)}, data)
    figure = output_comparison(data, fit)
    assert labels(figure) == ["measured", f"mine: {fit.simulation[0]:.1f} %"]


def test_what_cannot_be_drawn_is_said() -> None:
    with pytest.raises(SysidError, match="cannot draw a str; expected Curve, FrequencyResponse, Estimate, StateSpace"):
        bode("model")  # type: ignore[arg-type]
    refused("nothing to draw", lambda: bode([]))
    with pytest.raises(SysidError, match="cannot draw a ndarray; expected Roots, Estimate, StateSpace"):
        pzmap([np.ones(3)])  # type: ignore[list-item]
