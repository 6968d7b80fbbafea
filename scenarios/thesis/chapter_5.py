"""Report section on chapter 5: observer/Kalman identification, with its figures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator, ScalarFormatter

from scenarios.report.figure_style import MRAD, WIDTH, dress, short
from scenarios.report.figures import Gallery
from scenarios.thesis import chapter_5 as draw
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.number_text import p_value
from scenarios.thesis.observer_analysis import LIVE, JointObserver, P, hankel_share
from scenarios.thesis.response_figures import FREQUENCIES, dc_bode, line_mark, model_response
from scenarios.truth.published import PERCENT_DESCRIBED, PublishedModel
from sysid import IOData, ModelFit, StateSpace
from sysid.plots import BOUND, PALETTE, Curve, Style, Trace, output_comparison, singular_values

SHOWN = 36
"""System Markov parameters that are drawn: 0.7 s."""

SIMULATED = Style("#d55e00", "--", 1.3, "^")
"""Colour of the simulated output; the predicted output has the colour of its method."""


def markov_parameters(entry: JointObserver) -> Figure:
    """Observer Markov parameters, and the system's beside those of the truth."""
    figure = Figure(figsize=(WIDTH, 4.6), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    diagnostics = entry.estimate.diagnostics
    style = PALETTE["okid"]
    for name, label, shift, colour, marker in (
        ("u", "of the command", -0.15, style.colour, style.marker),
        ("y", "of the measurement", 0.15, "#7a5195", "P"),
    ):
        values = np.asarray(diagnostics[f"observer_markov_{name}"])[:, 0, 0]
        lags = np.arange(1, len(values) + 1) + shift
        upper.vlines(lags, 0.0, values, color=colour, lw=1.6)
        upper.plot(lags, values, marker, color=colour, ms=5, label=label)
    upper.set_ylabel("value / rad/rad")
    upper.set_title("Markov parameters of the observer", loc="left", fontsize=9)
    upper.legend(fontsize=8, frameon=False, loc="upper right")
    system = np.asarray(diagnostics["system_markov"])[:SHOWN, 0, 0]
    samples = np.arange(len(system))
    lower.vlines(samples, 0.0, system, color=style.colour, lw=1.4)
    lower.plot(samples, system, style.marker, color=style.colour, ms=4, label="from the observer")
    true = entry.true_markov[:SHOWN]
    lower.plot(samples, true, "-", color=PALETTE["truth"].colour, lw=1.2, label="truth")
    lower.set_ylabel("value / rad/rad")
    lower.set_title("Markov parameters of the system", loc="left", fontsize=9)
    lower.set_xlabel("sample of 0.02 s after the pulse")
    lower.legend(fontsize=8, frameon=False, loc="upper right")
    dress((upper, lower))
    for axes in (upper, lower):
        axes.axhline(0.0, color=BOUND.colour, lw=0.7)
    return figure


def errors(entry: JointObserver) -> Figure:
    """Prediction and smoothing errors over the number of observer Markov parameters."""
    figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
    axes = figure.subplots()
    numbers = [row.p for row in entry.errors]
    for values, label, style in (
        ([row.prediction for row in entry.errors], "prediction, from p samples before", PALETTE["okid"]),
        ([row.smoothing for row in entry.errors], "smoothing, from p before and p after", SIMULATED),
    ):
        scaled = 100 * np.array(values)
        axes.plot(numbers, scaled, color=style.colour, ls=style.line, lw=1.3, marker=style.marker, ms=5, label=label)
    axes.set_yscale("log")
    # A decade at most: plain numbers tell it better than powers of ten.
    axes.yaxis.set_major_locator(FixedLocator([0.2, 0.3, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(ScalarFormatter())
    axes.set_xticks(numbers)
    axes.axvline(5.0, color=BOUND.colour, ls=BOUND.line, lw=BOUND.width)
    line_mark(axes, "p of the thesis", (5.0, 0.5), gap=4)
    axes.set_xlabel("observer Markov parameters p")
    axes.set_ylabel("error / % of the output")
    axes.legend(fontsize=8, frameon=False, loc="upper right")
    dress([axes])
    return figure


def hankel(entry: JointObserver) -> Figure:
    """Hankel singular values and their cumulative share."""
    figure = singular_values({"PRBS": entry.estimate}, limit=8, size=(WIDTH, 3.2))
    (axes,) = figure.axes
    values = np.asarray(entry.estimate.diagnostics["hankel_singular_values"], dtype=float)
    for share in entry.shares:
        axes.annotate(
            f"{hankel_share(entry.estimate, share.order):.4f} %",
            (share.order, values[share.order - 1] / values[0]),
            xytext=(6, 5),
            textcoords="offset points",
            fontsize=8,
        )
    axes.set_xlim(0.5, len(entry.shares) + 0.9)
    axes.set_ylabel("singular value over the largest")
    axes.set_xlabel("number (filled: in the model; label: share of the squares up to it)")
    low, high = axes.get_ylim()
    axes.set_ylim(low, 3.0 * high)
    for legend in figure.legends:
        legend.remove()
    dress([axes])
    return figure


def state_space_bode(entry: JointResult) -> Figure:
    """The OKID model beside the truth and the printed OKID model."""
    model = entry.models["okid"]
    printed = next(row for row in entry.published if row.method == "okid")
    return dc_bode(
        [
            Curve("truth", model_response(entry.truth.model), PALETTE["truth"]),
            Curve(model.label, model.estimate.frequency_response(FREQUENCIES), PALETTE["okid"]),
            Curve(f"published {printed.label}", model_response(printed.model), PALETTE["published"]),
        ]
    )


def predicted(data: IOData, fit: ModelFit, what: str, *, length: float) -> Figure:
    """One-step prediction and simulation against the measurement, a piece of the record called `what`."""
    traces = [
        Trace(f"one step ahead: {fit.one_step[0]:.2f} %", fit.predicted[:, 0], PALETTE["okid"]),
        Trace(f"simulated: {fit.simulation[0]:.2f} %", fit.simulated[:, 0], SIMULATED),
    ]
    return _output_window(data, traces, what, length)


def printed_outputs(data: IOData, fits: dict[PublishedModel, ModelFit], what: str, *, length: float) -> Figure:
    """Simulations of printed models on the twin's inputs against its measurement, a piece of the record `what`."""
    traces = [
        Trace(f"{printed.label}: {fit.simulation[0]:.1f} %", fit.simulated[:, 0], PALETTE[printed.method])
        for printed, fit in fits.items()
    ]
    return _output_window(data, traces, what, length)


def _output_window(data: IOData, traces: list[Trace], what: str, length: float) -> Figure:
    start = min(20.0, max(len(data) * data.dt - length, 0.0))
    figure = output_comparison(data, traces, start=start, length=length, scale=MRAD, unit="mrad", size=(WIDTH, 4.4))
    figure.axes[0].set_title(what, loc="left", fontsize=9)
    return figure


FIRST = {"shoulder_yaw": ("", 50), "shoulder_pitch": ("A", 52), "elbow_pitch": ("A", 58)}
"""First of the thesis' six figures of each joint."""


@dataclass(frozen=True)
class Quantity:
    """A row of the table of realisations.

    Attributes:
        name: What it is.
        ours: Its value in the model of the study.
        printed: Its value in the printed model.
        coordinates: Whether it depends on the coordinates of the state, so that the two cannot be compared.
    """

    name: str
    ours: str
    printed: str
    coordinates: bool


def chapter_5(study: Comparison, gallery: Gallery) -> dict[str, object]:
    """Figures and numbers of the section.

    Args:
        study: The study.
        gallery: Takes the figures, in the order of the page.

    Returns:
        What the template shows.
    """
    observers = study.observers
    return {
        "p": P,
        "live": 100 * LIVE,
        "printed_percent": PERCENT_DESCRIBED,
        "joints": [
            {
                "result": entry,
                "observer": observers.joints[joint],
                "whiteness": p_value(observers.joints[joint].test.whiteness_p[0]),
                "realisation": realisation(entry, observers.joints[joint]),
                "figures": _figures(study, joint, gallery),
                "records": [
                    {"row": row, "white": p_value(row.whiteness_p)} for row in observers.records.get(joint, ())
                ],
            }
            for joint, entry in study.joints.items()
        ],
        "several": observers.several,
    }


def realisation(entry: JointResult, observer: JointObserver) -> tuple[Quantity, ...]:
    """The identified and the printed model: matrices and coordinate-free quantities."""
    printed = next(model for model in entry.published if model.method == "okid")
    ours = observer.estimate.model
    pairs = [
        ("A", _matrix(ours.A), _matrix(printed.model.A), True),
        ("B", _matrix(ours.B.T), _matrix(printed.model.B.T), True),
        ("C", _matrix(ours.C), _matrix(printed.model.C), True),
        ("D", _matrix(ours.D), _matrix(printed.model.D), False),
        ("G", _matrix(-ours.gain.T), _matrix(-printed.model.gain.T), True),
        ("CB, CAB", _markov(ours), _markov(printed.model), False),
        ("poles", _roots(ours.poles()), _roots(printed.model.poles()), False),
        ("zeros", _roots(ours.zeros()), _roots(printed.model.zeros()), False),
        ("eigenvalues of A + G C", _roots(observer.observer_poles), _roots(_observer_poles(printed)), False),
        ("gain at 0 Hz", f"{ours.dc_gain()[0, 0]:.4f}", f"{printed.dc_gain:.4f}", False),
        ("bandwidth, Hz", f"{float(ours.bandwidth()[0, 0]):.3f}", f"{printed.bandwidth_hz:.3f}", False),
        (
            "described by two states, %",
            f"{hankel_share(observer.estimate, ours.order):.4f}",
            f"{PERCENT_DESCRIBED[entry.joint]:.4f}",
            False,
        ),
    ]
    return tuple(Quantity(*pair) for pair in pairs)


def _figures(study: Comparison, joint: str, gallery: Gallery) -> list[object]:
    entry, observer, name, mark = (
        study.joints[joint],
        study.observers.joints[joint],
        short(joint),
        joint.replace("_", "-"),
    )
    letter, first = FIRST[joint]
    system, own = observer.live
    figures: list[object] = [
        gallery.add(
            draw.markov_parameters(observer),
            f"{name}: above the Markov parameters of the observer, {P} of the command and {P} of the measurement; the "
            f"last one above {100 * LIVE:g} % of the largest comes {own} samples after the pulse. Below those of the "
            f"system that follow from them, with the last one after {system - 1} samples, beside those of the truth.",
            name=f"markov-{mark}",
            thesis=(f"{letter}{first}",),
        )
    ]
    if observer.errors:
        figures.append(
            gallery.add(
                draw.errors(observer),
                f"{name}: what observers with p Markov parameters leave of the output, standard deviation over that of "
                "the output. The thesis does not define its smoothing error; here it is that of the best estimate from "
                "both sides.",
                name=f"observer-errors-{mark}",
                thesis=(f"{letter}{first + 1}",),
            )
        )
    figures += [
        gallery.add(
            draw.hankel(observer),
            f"{name}: Hankel singular values of the system’s Markov parameters. There are {P}, because {P} observer "
            "parameters make a recursion of that order.",
            name=f"hankel-{mark}",
            thesis=(f"{letter}{first + 2}",),
        ),
        gallery.add(
            draw.state_space_bode(entry),
            f"{name}: frequency response of the OKID model with its 95 % band, of the truth and of the printed OKID "
            "model.",
            name=f"bode-okid-{mark}",
            thesis=(f"{letter}{first + 3}",),
        ),
        gallery.add(
            draw.predicted(entry.data[study.estimation_test], observer.own, f"{name}, PRBS", length=4.0),
            f"{name}: predicted and simulated output against the PRBS record that the model was identified from, with "
            "fits over the whole record.",
            name=f"predicted-{mark}",
            thesis=(f"{letter}{first + 4}",),
        ),
    ]
    if observer.chirp is not None:
        figures.append(
            gallery.add(
                draw.predicted(entry.data[8], observer.chirp, f"{name}, chirp from 5 to 10 Hz", length=2.0),
                f"{name}: cross-validation on the 5–10 Hz chirp, one sweep.",
                name=f"chirp-{mark}",
                thesis=(f"{letter}{first + 5}",),
            )
        )
    return figures


def _observer_poles(printed: PublishedModel) -> np.ndarray:
    values = np.linalg.eigvals(printed.model.A - printed.model.gain @ printed.model.C).astype(complex)
    return values[np.argsort(-np.abs(values), kind="stable")]


def _markov(model: StateSpace) -> str:
    return ", ".join(f"{value:.5f}" for value in model.markov(3)[1:, 0, 0])


def _matrix(values: np.ndarray) -> str:
    """Matrix as text: rows separated by semicolons, five digits as in the thesis."""
    return "; ".join(" ".join(f"{value:.5g}" for value in row) for row in np.atleast_2d(values))


def _roots(roots: Sequence[complex] | np.ndarray) -> str:
    parts = []
    for value in np.asarray(roots, dtype=complex):
        if abs(value.imag) < 5e-4:
            parts.append(f"{value.real:.3f}")
        elif value.imag > 0:
            parts.append(f"{value.real:.3f} ± {value.imag:.3f}j")
    return ", ".join(parts) or "none"
