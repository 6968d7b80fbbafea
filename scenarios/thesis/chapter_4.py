"""Report section on chapter 4: prediction-error models, with its figures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

import sysid
from scenarios.experiments.campaign import single_joint_test
from scenarios.report.figure_style import MRAD, WIDTH, dress, method_style, short
from scenarios.report.figures import Gallery, Picture
from scenarios.thesis import chapter_4 as draw
from scenarios.thesis import figures_data_sets as draw_sets
from scenarios.thesis.campaign import tests_of_same_sequence
from scenarios.thesis.comparison import Comparison, JointResult, ModelResult
from scenarios.thesis.envelope import envelope
from scenarios.thesis.every_data_set import AUDIBLE, DataSets, distances
from scenarios.thesis.number_text import p_value
from scenarios.thesis.order_search import IMPROVES, Searches
from scenarios.thesis.response_figures import FREQUENCIES, ZOOM, dc_bode, mark_excited, model_response, well_known
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
    """Gain from 0.1 to 3 Hz, and below it the ratio to the true gain, which shows how the models differ."""
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
        residuals = model.residual_test.residuals[:, 0]
        envelope(axes, residuals, model.estimate.model.dt, PALETTE[method], scale=MRAD)
        spread = MRAD * float(np.std(residuals))
        axes.set_title(f"{model.label}: standard deviation {spread:.3g} mrad", loc="left", fontsize=8)
    figure.supylabel("residual / mrad", fontsize=9)
    grid[-1].set_xlabel("time / s", fontsize=8)
    dress(grid)
    return figure


def residuals(model: ModelResult) -> Figure:
    """Whiteness and independence of a model's residuals on its own data."""
    return correlations(model.residual_test, method_style(model.method), size=(WIDTH, 4.0))


FIGURES = {"shoulder_yaw": ("", 39), "shoulder_pitch": ("A", 30), "elbow_pitch": ("A", 41)}
"""First of the thesis' eleven figures of each joint: five of ARMAX, five of OE, one Bode plot."""

PIECES = {5: 4.0, 4: 1.6, 7: 3.0, 8: 2.0}
"""Tests whose outputs are drawn, and how much of each, s."""

SAID = {
    5: "the PRBS that they were identified from",
    4: "the two sines at 2.5 and 10 Hz",
    7: "the bipolar ramping pulse",
    8: "the 5-10 Hz chirp",
}


@dataclass(frozen=True)
class Coefficients:
    """A model in the form in which the thesis prints its models.

    Attributes:
        label: Its name.
        rows: Power of 1/z, then its coefficient in the denominator, in the numerator, and K.
        printed: Whether the thesis prints it.
    """

    label: str
    rows: tuple[tuple[int, float, float, float], ...]
    printed: bool


def chapter_4(study: Comparison, gallery: Gallery) -> dict[str, object]:
    """Figures and numbers of the chapter.

    Args:
        study: The study.
        gallery: Takes the figures, in the order of the page.

    Returns:
        What the template shows.
    """
    return {
        "joints": [_joint(study, joint, gallery) for joint in study.joints],
        "seen": tests_of_same_sequence(study.estimation_test),
        "audible": 100 * AUDIBLE,
        "improves": IMPROVES,
        "p_value": p_value,
        "thorough": bool(study.searches),
    }


def _joint(study: Comparison, joint: str, gallery: Gallery) -> dict[str, object]:
    entry, sets, searches = study.joints[joint], study.data_sets[joint], study.searches.get(joint)
    arx = sets.find(single_joint_test(study.estimation_test, joint), "arx")
    name, mark = short(joint), joint.replace("_", "-")
    armax, oe = ([_figure(joint, number) for number in range(first, first + 5)] for first in (0, 5))
    return {
        "result": entry,
        "bode": gallery.add(
            draw.model_bode(entry),
            f"{name}: frequency response of the truth, of spectral and empirical estimate on the excited lines "
            "and of the identified models, with 95 % bands. Dashed: −3 dB below one; dotted: 1 Hz; grey: "
            "nothing is excited there, models extrapolate.",
            name=f"bode-{mark}",
        ),
        "zoom": gallery.add(
            draw.zoomed_bode(entry),
            f"{name}: the gain from 0.1 to 3 Hz; below, by how much it departs from the true gain.",
            name=f"bode-zoom-{mark}",
        ),
        "published": gallery.add(
            draw.published_bode(entry),
            f"{name}: the models that the thesis prints, beside the truth of the twin. Grey: below 0.5 Hz, "
            "where the PRBS file of the twin excites nothing; that of the thesis is not known.",
            name=f"bode-published-{mark}",
        ),
        "kinds": gallery.add(
            draw.kinds_bode(entry, arx.model if arx else None),
            f"{name}: ARMAX, ARX and OE from the PRBS, beside the truth and what the thesis prints of these kinds.",
            name=f"bode-kinds-{mark}",
            thesis=(_figure(joint, 10),),
        ),
        "sequences": gallery.add(
            draw.residual_sequences(entry, ("armax", "oe")),
            f"{name}: residuals of ARMAX and OE on the PRBS over the whole record, one step ahead, on one scale.",
            name=f"residual-sequences-{mark}",
            thesis=(armax[0], oe[0]),
        ),
        "residuals": [
            gallery.add(
                draw.residuals(model),
                f"{name}, {model.label}: correlations of the residuals on the PRBS test with 99 % bounds "
                f"(whiteness {p_value(model.residual_test.whiteness_p[0])}, independence "
                f"{p_value(model.residual_test.independence_p[0, 0])}).",
                name=f"residuals-{method.replace('_', '-')}-{mark}",
                thesis=thesis,
            )
            for method, thesis in (("armax", (armax[1],)), ("oe", (oe[1],)), ("oe_high", ()))
            if (model := entry.models[method])
        ],
        "roots": [
            gallery.add(
                draw.roots(entry, method),
                f"{name}, {entry.models[method].label}: poles and zeros in the z plane with their 95 % regions and the "
                "unit circle, beside those of the truth and of the printed model of this kind where there is one.",
                name=f"roots-{method}-{mark}",
                thesis=(thesis[2],),
            )
            for method, thesis in (("armax", armax), ("oe", oe))
        ],
        "outputs": [
            gallery.add(
                draw.outputs(entry, number, length=length),
                f"{name}: simulated outputs of the models against the measurement of test {number}, "
                f"{SAID[number]}, with their fits over the whole record; below, what is left.",
                name=f"outputs-{number}-{mark}",
                thesis={5: (armax[3], oe[3]), 4: (armax[4], oe[4])}.get(number, ()),
            )
            for number, length in PIECES.items()
            if number in entry.data
        ],
        "coefficients": coefficients(entry),
        "sets": sets,
        "shown": {record: draw_sets.shown(record, sets) for record in sets.excited},
        "apart": {method: _distances(sets, method) for method in draw_sets.METHODS},
        "bandwidths": gallery.add(
            draw_sets.bandwidths(entry, sets),
            f"{name}: bandwidth from every data set by every structure, with 95 % intervals; arrows: beyond the axis. "
            "Intervals know of noise alone, not of friction and the velocity limit, which differ from test to test.",
            name=f"data-sets-bandwidth-{mark}",
        ),
        "responses": gallery.add(
            draw_sets.responses(entry, sets),
            f"{name}: gain of the models from every single-joint data set that excites enough, over that of the "
            "small-signal truth: how far the data sets agree, structure by structure.",
            name=f"data-sets-gain-{mark}",
        ),
        "search": searches,
        "searches": _searches(searches, name, mark, gallery) if searches else (),
        "criteria": {name: searches.arx.best(name) for name in ("aic", "bic", "mdl", "validation")} if searches else {},
        "more_poles": study.prediction_errors[joint].more_poles,
    }


def _searches(searches: Searches, name: str, mark: str, gallery: Gallery) -> tuple[Picture, ...]:
    return (
        gallery.add(
            draw_sets.searches(searches),
            f"{name}: the search for orders, upwards from one pole. Above, how the models follow the tests of other "
            "waveforms in simulation (what lies far below is left out); below, how many of 25 lags of the residuals' "
            "autocorrelation lie outside the 99 % bounds (white: none or one). Ring: chosen; star: the thesis' orders.",
            name=f"order-search-{mark}",
        ),
        gallery.add(
            draw_sets.arx_orders(searches),
            f"{name}: criteria of every ARX structure over its number of parameters; validation on the tests of "
            "other waveforms.",
            name=f"order-criteria-{mark}",
        ),
    )


def _figure(joint: str, number: int) -> str:
    letter, first = FIGURES[joint]
    return f"{letter}{first + number}"


def _distances(sets: DataSets, method: str) -> dict[str, float]:
    models = sets.singles(method, enough=True)
    pairs = distances(models)
    return {
        "models": len(models),
        "unstable": sum(not model.stable for model in models),
        "median": float(np.median(pairs)) if len(pairs) else np.nan,
        "largest": float(pairs.max()) if len(pairs) else np.nan,
    }


def coefficients(entry: JointResult) -> tuple[Coefficients, ...]:
    """ARMAX and OE of the study and the printed ones of these kinds, coefficient by coefficient."""
    ours = [
        Coefficients(entry.models[method].label, _observer_form(entry.models[method].estimate.model), False)
        for method in ("armax", "oe")
    ]
    printed = [
        Coefficients(f"published {model.label}", _observer_form(model.model), True)
        for model in entry.published
        if model.method in ("armax", "oe")
    ]
    return (*ours, *printed)


def _observer_form(model: StateSpace) -> tuple[tuple[int, float, float, float], ...]:
    """Coefficients of a model in observer companion form, as our estimates and the prints are [Morris1996, eq. 4.9]."""
    return tuple(
        (k + 1, -float(model.A[k, 0]), float(model.B[k, 0]), float(model.gain[k, 0])) for k in range(model.order)
    )
