"""Figures of chapter IV: models beside truth, data and each other."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

import sysid
from scenarios.report.figure_style import (
    FREQUENCIES,
    MRAD,
    WIDTH,
    ZOOM,
    dc_bode,
    dress,
    mark_excited,
    method_style,
    model_response,
    well_known,
)
from scenarios.thesis.comparison import JointResult, ModelResult
from scenarios.thesis.envelope import envelope
from scenarios.truth.published import PublishedModel
from sysid import Estimate, StateSpace
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

SPARSE = FREQUENCIES[::2]
"""Frequencies of curves with a band, Hz: a band takes three lines."""

PRINTED = (PALETTE["published"], Style("#b8860b", ":", 1.6), Style("#6b4e00", "--", 1.4), Style("#6b4e00", "-", 1.0))
"""Line styles of the printed models of one joint."""


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
        Curve(model.label, model.estimate.frequency_response(SPARSE), method_style(model.method))
        for model in entry.models.values()
    ]
    return curves


def published_bode(entry: JointResult) -> Figure:
    """Truth beside the models that the thesis prints."""
    curves = [Curve("truth of the twin", model_response(entry.truth.model), PALETTE["truth"])]
    curves += [
        Curve(f"published {printed.label}", model_response(printed.model), look)
        for printed, look in zip(entry.published, PRINTED, strict=False)
    ]
    return dc_bode(curves)


def kinds_bode(entry: JointResult, arx: StateSpace | None) -> Figure:
    """ARMAX, ARX and OE together, beside the truth and the printed models of these kinds [Morris1996, fig. 49]."""
    curves = [Curve("truth", model_response(entry.truth.model), PALETTE["truth"])]
    curves += [
        Curve(entry.models[method].label, model_response(entry.models[method].estimate.model), PALETTE[method])
        for method in ("armax", "oe")
    ]
    if arx is not None:
        curves.append(Curve("ARX", model_response(arx), PALETTE["arx"]))
    for model, look in zip([m for m in entry.published if m.method in ("armax", "oe")], PRINTED, strict=False):
        curves.append(Curve(f"published {model.label}", model_response(model.model), look))
    return dc_bode(curves)


def roots(entry: JointResult, method: str) -> Figure:
    """Poles and zeros of one model with their 95 % regions, beside the truth and the printed model of the kind."""
    model = entry.models[method]
    systems: dict[str, Roots | Estimate] = {
        "truth": Roots("truth", entry.truth.model, PALETTE["truth"]),
        model.label: model.estimate,
    }
    for printed, look in zip(of_kind(entry.published, method), PRINTED, strict=False):
        systems[f"published {printed.label}"] = Roots(printed.label, printed.model.input_path(), look)
    return pzmap(systems, size=(WIDTH, 5.7))


def of_kind(published: Sequence[PublishedModel], method: str) -> tuple[PublishedModel, ...]:
    """Printed models of one kind, the one with most digits where a model is printed twice."""
    return tuple(model for model in published if model.method == method)[:1]


def outputs(entry: JointResult, number: int, *, length: float) -> Figure:
    """Simulated outputs of the prediction-error models against the measurement of one test."""
    data = entry.data[number]
    chosen = [model for model in entry.models.values() if model.method != "okid"]
    fits = sysid.compare({model.label: model.estimate for model in chosen}, data)
    traces = [
        Trace(f"{model.label}: {fit.simulation[0]:.1f} %", fit.simulated[:, 0], method_style(model.method))
        for model, fit in zip(chosen, fits, strict=True)
    ]
    start = min(20.0, max(len(data) * data.dt - length, 0.0))
    return output_comparison(data, traces, start=start, length=length, scale=MRAD, unit="mrad", size=(WIDTH, 4.4))


def residual_sequences(entry: JointResult, methods: Sequence[str]) -> Figure:
    """Residuals of models on their own data over the whole record, on one scale [Morris1996, fig. 39 and 44]."""
    figure = Figure(figsize=(WIDTH, 1.2 + 1.5 * len(methods)), layout="constrained")
    grid = figure.subplots(len(methods), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, method in zip(grid, methods, strict=True):
        model = entry.models[method]
        left = model.residual_test.residuals[:, 0]
        envelope(axes, left, model.estimate.model.dt, PALETTE[method], scale=MRAD)
        spread = MRAD * float(np.std(left))
        axes.set_title(f"{model.label}: standard deviation {spread:.3g} mrad", loc="left", fontsize=8)
    figure.supylabel("residual / mrad", fontsize=9)
    grid[-1].set_xlabel("time / s", fontsize=8)
    dress(grid)
    return figure


def residuals(model: ModelResult) -> Figure:
    """Whiteness and independence of a model's residuals on its own data."""
    return correlations(model.residual_test, method_style(model.method), size=(WIDTH, 4.0))
