"""Figures of chapter IV: models beside truth, data and each other."""

import numpy as np
from matplotlib.figure import Figure

import sysid
from scenarios.thesis.comparison import JointResult, ModelResult
from scenarios.thesis.figure_style import (
    FREQUENCIES,
    MRAD,
    WIDTH,
    ZOOM,
    dc_bode,
    mark_excited,
    model_response,
    style_of,
    well_known,
)
from sysid.plots import (
    PALETTE,
    Curve,
    Roots,
    Style,
    Trace,
    bode,
    correlations,
    output_comparison,
    pzmap,
)


def model_bode(entry: JointResult) -> Figure:
    """Truth, nonparametric estimates on the excited lines, and the identified models, with their bands."""
    return dc_bode(_identified(entry))


def zoomed_bode(entry: JointResult) -> Figure:
    """The gain from 0.1 to 3 Hz, and below it the gain over that of the truth, where the models part."""
    figure = bode(_identified(entry), relative_to_dc=True, mark_hz=1.0, limits_hz=ZOOM, size=(WIDTH, 6.0))
    upper, lower = figure.axes
    for line in (*lower.get_lines()[: len(upper.get_lines()) - 2], *lower.collections):
        line.remove()
    for curve in _identified(entry):
        f = curve.response.frequencies
        true = np.abs(entry.truth.model.frequency_response(f)[:, 0, 0])
        style = curve.style or PALETTE[curve.response.method]
        ratio = 100 * (curve.response.magnitude[:, 0, 0] / true - 1)
        marker = "" if style.line else style.marker
        lower.plot(f, ratio, color=style.colour, ls=style.line, lw=style.width, marker=marker, ms=5)
    lower.set_ylabel("gain over truth − 1 / %")
    upper.set_ylim(-8.0, 1.5)
    lower.set_ylim(-15.0, 10.0)
    for axes in (upper, lower):
        axes.set_xticks([0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 3.0])
        axes.minorticks_off()
    return mark_excited(figure)


def _identified(entry: JointResult) -> list[Curve]:
    curves = [
        Curve("truth", model_response(entry.truth.model), PALETTE["truth"]),
        Curve("spectral estimate", well_known(entry.spa)),
        Curve("empirical estimate", well_known(entry.etfe)),
    ]
    curves += [
        Curve(model.label, model.estimate.frequency_response(FREQUENCIES), style_of(model))
        for model in entry.models.values()
    ]
    return curves


def published_bode(entry: JointResult) -> Figure:
    """Truth beside the models that the thesis prints."""
    looks = (PALETTE["published"], Style("#b8860b", ":", 1.6), Style("#6b4e00", "--", 1.4), Style("#6b4e00", "-", 1.0))
    curves = [Curve("truth of the twin", model_response(entry.truth.model), PALETTE["truth"])]
    curves += [
        Curve(f"published {printed.label}", model_response(printed.model), look)
        for printed, look in zip(entry.published, looks, strict=False)
    ]
    return dc_bode(curves)


def roots(entry: JointResult) -> Figure:
    """Poles and zeros of the truth and of the models."""
    systems = [Roots("truth", entry.truth.model, PALETTE["truth"])]
    systems += [Roots(model.label, model.estimate.model, style_of(model)) for model in entry.models.values()]
    figure = pzmap(systems, size=(WIDTH, 6.8))
    reach = figure.axes[0].get_xlim()[1]
    for text, system in zip(figure.legends[0].get_texts(), systems, strict=True):
        outside = [zero.real for zero in system.model.zeros() if abs(zero) > reach]
        if outside and np.abs(system.model.poles()).max(initial=0.0) <= reach:
            shown = ", zero ".join(f"{value:.1f}" for value in outside)
            text.set_text(f"{system.label}; outside: zero {shown}")
    return figure


def outputs(entry: JointResult, number: int, *, length: float) -> Figure:
    """Simulated outputs of the models against the measurement of one test."""
    data = entry.data[number]
    chosen = list(entry.models.values())
    fits = sysid.compare({model.label: model.estimate for model in chosen}, data)
    traces = [
        Trace(f"{model.label}: {fit.simulation[0]:.1f} %", fit.simulated[:, 0], style_of(model))
        for model, fit in zip(chosen, fits, strict=True)
    ]
    start = min(20.0, max(len(data) * data.dt - length, 0.0))
    return output_comparison(data, traces, start=start, length=length, scale=MRAD, unit="mrad", size=(WIDTH, 4.4))


def residuals(model: ModelResult) -> Figure:
    """Whiteness and independence of a model's residuals on its own data."""
    test = model.residual_test
    return correlations(
        [
            ("autocorrelation", test.lags, test.autocorrelation[:, 0, 0], test.whiteness_bound),
            (
                "cross-correlation\nwith the input",
                test.cross_lags,
                test.cross_correlation[:, 0, 0],
                float(test.independence_bound[0, 0]),
            ),
        ],
        style_of(model),
        size=(WIDTH, 4.0),
    )
