"""The report's figures, drawn from a study's result."""

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import sysid
from hmtb_twin import JOINTS
from scenarios.comparison import Comparison, JointResult, ModelResult
from scenarios.crossing import half_power_hz
from scenarios.findings_models import ABOUT_1_HZ
from scenarios.period_spectra import period_spectra
from scenarios.registry import load
from scenarios.waveform import POINTS, RATE
from sysid import FrequencyResponse, StateSpace
from sysid.plots import (
    BOUND,
    GRID,
    INK,
    PALETTE,
    Curve,
    Roots,
    Style,
    Trace,
    bode,
    correlations,
    output_comparison,
    pzmap,
    spectra,
)

WIDTH = 5.2
"""Width of a figure, inch: narrow enough to be read on a phone."""

FREQUENCIES = np.geomspace(0.05, 25.0, 300)
ZOOM = (0.1, 3.0)
"""Where the joints' bandwidths lie, and below them what is extrapolated, Hz."""

NOT_EXCITED = "#eef0f2"
MRAD = 1000.0

HIGH = Style("#7a5195", (0, (1, 1.2)), 1.6, "P")  # type: ignore[arg-type]
"""The output-error model of higher order, told apart from the thesis' own."""

EXCITED_FROM = RATE / POINTS
"""Lowest frequency with power in the input of a 100-point file played at 50 Hz, Hz."""


def style_of(model: ModelResult) -> Style:
    """How a model is drawn, everywhere."""
    return HIGH if model.method == "oe_high" else PALETTE[model.method]


def short(name: str) -> str:
    """A joint's name for people."""
    return name.replace("_", " ")


def bandwidths(study: Comparison) -> Figure:
    """Recovered bandwidths with their intervals, the truth as a line, the published models as stars."""
    figure = Figure(figsize=(WIDTH, 6.2), layout="constrained")
    panels = figure.subplots(len(study.joints), 1, sharex=True)
    for axes, (name, entry) in zip(panels, study.joints.items(), strict=True):
        labels: list[str] = []
        for model in entry.models.values():
            style, hz = style_of(model), model.bandwidth_hz
            reach = [[hz - model.ci95[0]], [model.ci95[1] - hz]]
            axes.errorbar(hz, len(labels), xerr=reach, fmt=style.marker, color=style.colour, ms=6, capsize=4, lw=1.8)
            axes.plot(model.half_power_hz, len(labels), "|", color=style.colour, ms=13, mew=2.0)
            labels.append(model.label.replace(", sufficient", ",\nsufficient"))
        for printed in entry.published:
            axes.plot(
                printed.bandwidth_hz, len(labels), PALETTE["published"].marker, color=PALETTE["published"].colour, ms=9
            )
            level = half_power_hz(printed.model)
            axes.plot(level, len(labels), "|", color=PALETTE["published"].colour, ms=13, mew=2.0)
            labels.append(f"published {printed.label}")
        axes.axvspan(*ABOUT_1_HZ, color=NOT_EXCITED, lw=0, zorder=0)
        axes.axvline(entry.truth.bandwidth_hz, color=PALETTE["truth"].colour, lw=1.8)
        axes.axvline(1.0, color=BOUND.colour, ls=":", lw=1.2)
        axes.set_yticks(range(len(labels)), labels, fontsize=8)
        axes.set_ylim(len(labels) - 0.4, -0.6)
        axes.set_title(f"{short(name)}: truth {entry.truth.bandwidth_hz:.3f} Hz (black line)", loc="left", fontsize=9)
        _dress([axes])
    panels[-1].set_xlim(0.0, 1.55)
    panels[-1].set_xlabel("frequency / Hz")
    return figure


def tests(study: Comparison, entry: JointResult) -> Figure:
    """Two seconds of each test: commanded and measured angle about the operating point."""
    figure = Figure(figsize=(WIDTH, 7.4), layout="constrained")
    grid = figure.subplots(4, 2, sharex=True).ravel()
    for axes, (number, data) in zip(grid, entry.data.items(), strict=False):
        count = min(len(data), round(2 * RATE))
        time = np.arange(count) / RATE
        axes.step(
            time, MRAD * data.u[:count, 0], where="post", color=PALETTE["measured"].colour, lw=1.1, label="commanded"
        )
        axes.plot(time, MRAD * data.y[:count, 0], color=PALETTE["armax"].colour, lw=1.4, label="measured")
        said = load(f"siso-{number}-{entry.joint}").description.split(": ", 1)[1]
        axes.set_title(f"{number}: {said}", loc="left", fontsize=7.5)
    _dress(grid)
    for axes in grid[-2:]:
        axes.set_xlabel("time / s", fontsize=8)
    figure.supylabel("angle / mrad", fontsize=9)
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper left", ncols=2, frameon=False, fontsize=8)
    return figure


def data_spectra(study: Comparison, entry: JointResult) -> Figure:
    """Input, output and disturbance spectrum of the estimation data [Morris1996, fig. 27 to 29]."""
    found = period_spectra(entry.data[study.estimation_test])
    traces = [
        Trace("input", found.input, PALETTE["measured"]),
        Trace("output", found.output, PALETTE["armax"]),
        Trace("disturbance", found.disturbance, PALETTE["oe"]),
    ]
    return spectra(found.frequencies, traces, unit="rad", limits_hz=(0.4, 25.0), size=(WIDTH, 3.6))


def model_bode(entry: JointResult) -> Figure:
    """Truth, nonparametric estimates on the excited lines, and the identified models, with their bands."""
    return _bode(_identified(entry))


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
    return _mark_excited(figure)


def _identified(entry: JointResult) -> list[Curve]:
    curves = [
        Curve("truth", _response(entry.truth.model), PALETTE["truth"]),
        Curve("spectral estimate", _well_known(entry.spa)),
        Curve("empirical estimate", _well_known(entry.etfe)),
    ]
    curves += [
        Curve(model.label, model.estimate.frequency_response(FREQUENCIES), style_of(model))
        for model in entry.models.values()
    ]
    return curves


def published_bode(entry: JointResult) -> Figure:
    """Truth beside the models that the thesis prints."""
    looks = (PALETTE["published"], Style("#b8860b", ":", 1.6), Style("#6b4e00", "--", 1.4), Style("#6b4e00", "-", 1.0))
    curves = [Curve("truth of the twin", _response(entry.truth.model), PALETTE["truth"])]
    curves += [
        Curve(f"published {printed.label}", _response(printed.model), look)
        for printed, look in zip(entry.published, looks, strict=False)
    ]
    return _bode(curves)


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


def coupled(study: Comparison) -> Figure:
    """Gain of the true three-joint response, channel by channel, beside the block-diagonal models."""
    names = list(study.joints)
    chosen = [JOINTS.index(name) for name in names]
    true = np.abs(study.truth.model.frequency_response(FREQUENCIES)[:, chosen][:, :, chosen])
    figure = Figure(figsize=(WIDTH, 5.2), layout="constrained")
    grid = figure.subplots(len(names), len(names), sharex=True, sharey=True)
    looks = {"SysID model": PALETTE["armax"], "OKID model": PALETTE["okid"]}
    for i, j in np.ndindex(grid.shape):
        axes = grid[i, j]
        axes.loglog(FREQUENCIES, np.maximum(true[:, i, j], 1e-9), color=PALETTE["truth"].colour, lw=2.0, label="truth")
        for entry in study.three_joint:
            if i == j and entry.name in looks:
                gain = np.abs(entry.model.frequency_response(FREQUENCIES)[:, i, j])
                style = looks[entry.name]
                axes.loglog(FREQUENCIES, gain, color=style.colour, ls=style.line, lw=1.3, label=entry.name)
        axes.set_ylim(1e-4, 3.0)
        if i == 0:
            axes.set_title(f"from {short(names[j])}", fontsize=8)
        if j == 0:
            axes.set_ylabel(f"to {short(names[i])}", fontsize=8)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    _dress(grid.ravel())
    figure.supxlabel("frequency / Hz", fontsize=9)
    figure.supylabel("gain / (rad/rad)", fontsize=9)
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=3, frameon=False, fontsize=8)
    return figure


def _bode(curves: Sequence[Curve]) -> Figure:
    return _mark_excited(bode(curves, relative_to_dc=True, mark_hz=1.0, limits_hz=(0.05, 25.0), size=(WIDTH, 6.0)))


def _mark_excited(figure: Figure) -> Figure:
    """Shade the frequencies at which the PRBS file has no power: there a model says what it extrapolates."""
    for number, axes in enumerate(figure.axes):
        left = axes.get_xlim()[0]
        axes.axvspan(left, EXCITED_FROM, color=NOT_EXCITED, lw=0, zorder=0)
        axes.set_xlim(left=left)
        if number == 0:
            at = (float(np.sqrt(left * EXCITED_FROM)), 0.03)
            axes.annotate(
                "not excited", at, xycoords=("data", "axes fraction"), ha="center", fontsize=8, color=BOUND.colour
            )
    return figure


def _well_known(response: FrequencyResponse) -> FrequencyResponse:
    """The lines up to half of Nyquist whose gain is known to a fifth; the others show noise and distortion."""
    covariance = response.covariance
    if covariance is None:
        return response
    spread = np.sqrt(np.trace(covariance[:, 0, 0], axis1=1, axis2=2))
    kept = (spread < 0.2 * response.magnitude[:, 0, 0]) & (response.frequencies <= RATE / 4)
    return FrequencyResponse(
        response.frequencies[kept], response.response[kept], response.dt, response.method, covariance[kept]
    )


def _response(model: StateSpace) -> FrequencyResponse:
    return FrequencyResponse(FREQUENCIES, model.frequency_response(FREQUENCIES), model.dt, "model")


def _dress(panels: Iterable[Axes]) -> None:
    for axes in panels:
        axes.grid(True, color=GRID, lw=0.6)
        axes.set_axisbelow(True)
        axes.tick_params(labelsize=8, colors=INK)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
