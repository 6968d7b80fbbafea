"""Figures show what they are given, with units, in the one palette."""

import io

import numpy as np
import pytest
from matplotlib.colors import to_hex

from sysid import FrequencyResponse, IOData, StateSpace
from sysid.plots import PALETTE, Curve, Roots, Trace, bode, correlations, output_comparison, pzmap, spectra

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
