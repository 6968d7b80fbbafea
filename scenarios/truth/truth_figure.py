"""The truth in one figure: responses with their bandwidths, poles and zeros, error over amplitude."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from scenarios.experiments.preview_figure import COLOURS, LINES
from scenarios.report.figure_style import dress, short
from scenarios.truth.truth_summary import TruthSummary, conditions_in_words, pose_in_words
from sysid.plots.palette import BOUND, INK, PALETTE

LOWEST = 0.05
"""Lowest frequency of the responses, Hz: that of the experiments' excitation."""

SLOWEST, FASTEST = 0.7, 160.0
"""Ends of the axis of moduli, rad/s; a faster mode falls below a twentieth within a sample."""

APART = 0.22
"""Distance of a complex pair from its joint's line."""

APART_DB = 1.6
"""Distance between the intervals of measured bandwidths, dB: at half power they would hide one another."""

HALF_POWER_DB = -10.0 * np.log10(2.0)

DASHED: dict[str, Any] = {"color": BOUND.colour, "ls": BOUND.line, "lw": BOUND.width}

FLOORS = (
    ("any model", "D", "#000000"),
    ("best linear", "s", "#0072b2"),
    ("of the truth's order", "^", "#d55e00"),
    ("small-signal truth", "o", "#009e73"),
)
"""Attainable errors on a record: name, marker, colour; best first."""


def truth_figure(summary: TruthSummary) -> Figure:
    """Draw the truth about an arm."""
    floors = 0.7 + 0.7 * len(summary.attainable) if summary.attainable else 0.0
    figure = Figure(figsize=(10.0, 9.6 + floors), layout="constrained")
    heights = (2.9, 2.9, 2.9, *((floors,) if floors else ()))
    grid = figure.add_gridspec(len(heights), 2, width_ratios=(1.25, 1.0), height_ratios=heights)
    gain, phase, error = (figure.add_subplot(grid[row, 0]) for row in range(3))
    plane, moduli = figure.add_subplot(grid[:2, 1]), figure.add_subplot(grid[2, 1])
    joints = [name for name in summary.joints if name not in summary.locked]
    _responses(gain, phase, summary, joints)
    _error(error, summary)
    _plane(plane, summary, joints)
    _moduli(moduli, summary, joints)
    panels = [gain, phase, error, plane, moduli]
    if summary.attainable:
        panels.append(figure.add_subplot(grid[3, :]))
        _attainable(panels[-1], summary)
    dress(panels)
    handles = [
        Line2D([], [], color=COLOURS[number], ls=LINES[number], lw=1.6, label=short(name))
        for number, name in enumerate(joints)
    ]
    handles.append(Line2D([], [], color=INK, marker="o", ls="", mfc="white", label="bandwidth"))
    if summary.best_linear:
        rms = next(iter(summary.best_linear.values())).experiment.multisines.rms
        handles.append(Line2D([], [], color=INK, marker=".", ls="", ms=5, label=f"best linear at {rms:g} rad rms"))
        handles.append(Line2D([], [], color=INK, marker="|", ls="-", lw=1.4, ms=7, label="its bandwidth, 95 %"))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    truth, departures = summary.truth, conditions_in_words(summary.arm, departures=True)
    title = f"Truth: arm {truth.variant}, payload {truth.payload}, pose {short(pose_in_words(truth))}"
    title += f"\n{departures[0].upper()}{departures[1:]}" if departures else "; nominal conditions"
    figure.suptitle(title, x=0.01, ha="left", fontsize=11, color=INK)
    return figure


def _responses(gain: Axes, phase: Axes, summary: TruthSummary, joints: list[str]) -> None:
    nyquist = 0.5 / summary.truth.dt
    f = np.geomspace(LOWEST, nyquist, 300)
    for number, name in enumerate(joints):
        entry, colour = summary.joints[name], COLOURS[number]
        response = entry.model.frequency_response(f)[:, 0, 0]
        angle = np.unwrap(np.angle(response))
        gain.plot(f, 20.0 * np.log10(np.abs(response)), color=colour, ls=LINES[number], lw=1.6)
        phase.plot(f, np.degrees(angle), color=colour, ls=LINES[number], lw=1.6)
        if np.isfinite(hz := entry.bandwidth_hz):
            mark: dict[str, Any] = {"color": colour, "marker": "o", "ms": 6, "mfc": "white", "mew": 1.5, "zorder": 5}
            gain.plot(hz, 20.0 * np.log10(abs(entry.model.frequency_response([hz])[0, 0, 0])), **mark)
            phase.plot(hz, np.degrees(np.interp(hz, f, angle)), **mark)
        if name not in summary.best_linear:
            continue
        measured = summary.best_linear[name].servo.response
        values = measured.response[:, 0, 0]
        dots: dict[str, Any] = {"color": colour, "marker": ".", "ls": "", "ms": 4, "alpha": 0.8}
        gain.plot(measured.frequencies, 20.0 * np.log10(np.abs(values)), **dots)
        # Whole turns are those nearest to the truth's phase.
        near = np.interp(measured.frequencies, f, angle)
        phase.plot(measured.frequencies, np.degrees(near + np.angle(values * np.exp(-1j * near))), **dots)
        hz, low, high = summary.best_linear[name].bandwidth.path()
        if np.isfinite(hz):
            at, reach = HALF_POWER_DB - APART_DB * (1 + number), ((hz - low,), (high - hz,))
            gain.errorbar(hz, at, xerr=reach, color=colour, marker="|", ms=7, capsize=4, elinewidth=1.6, zorder=6)
    gain.axhline(HALF_POWER_DB, **DASHED)
    gain.annotate("half power", (LOWEST, -3.0), (4, -10), textcoords="offset points", fontsize=8, color=BOUND.colour)
    gain.set(ylabel="gain / dB", xscale="log", xlim=(LOWEST, nyquist))
    gain.set_ylim(bottom=max(gain.get_ylim()[0], -80.0))
    gain.set_title("commanded to measured angle at 50 Hz", fontsize=9, color=INK)
    phase.set(xlabel="frequency / Hz", ylabel="phase / deg", xscale="log", xlim=(LOWEST, nyquist))
    for axes in (gain, phase):
        axes.set_xticks((0.1, 1.0, 10.0), ("0.1", "1", "10"))


def _plane(axes: Axes, summary: TruthSummary, joints: list[str]) -> None:
    reach, outside = 1.1, 0
    for number, name in enumerate(joints):
        poles, zeros = summary.joints[name].poles, summary.joints[name].zeros
        axes.plot(poles.real, poles.imag, "x", color=COLOURS[number], ms=7, mew=1.5)
        axes.plot(zeros.real, zeros.imag, "o", color=COLOURS[number], ms=7, mfc="none", mew=1.2)
        outside += int(np.sum(np.maximum(np.abs(zeros.real), np.abs(zeros.imag)) > reach))
    axes.add_patch(Circle((0.0, 0.0), 1.0, fill=False, ec=BOUND.colour, ls=BOUND.line, lw=BOUND.width))
    axes.set(xlabel="real part", ylabel="imaginary part", xlim=(-reach, reach), ylim=(-reach, reach))
    axes.set_box_aspect(1.0)
    left_out = f"; {outside} zeros further out" if outside else ""
    axes.set_title(f"z plane: poles ×, zeros ○{left_out}", fontsize=9, color=INK)


def _moduli(axes: Axes, summary: TruthSummary, joints: list[str]) -> None:
    """Draw every joint on a line of its own: where many roots meet, the plane cannot show which is whose."""
    for number, name in enumerate(joints):
        entry, cross, circle = summary.joints[name], {"marker": "x", "mew": 1.6}, {"marker": "o", "mfc": "none"}
        for roots, style in ((entry.poles, cross), (entry.zeros, circle)):
            inside = (np.abs(roots) > 1e-6) & ((np.abs(roots.imag) > 1e-9) | (roots.real > 0.0))
            s = np.log(roots[inside].astype(complex)) / summary.truth.dt
            s = s[(s.real < 0.0) & (np.abs(s) < FASTEST / 1.05)]
            off = APART * np.sign(np.where(np.abs(s.imag) > 1e-6 * np.abs(s), s.imag, 0.0))
            axes.plot(np.abs(s), -number + off, ls="", ms=7, color=COLOURS[number], **style)
    axes.set(xscale="log", xlim=(SLOWEST, FASTEST), ylim=(0.6 - len(joints), 0.6))
    axes.set_xlabel("modulus in the s plane / (rad/s)")
    axes.set_xticks((1, 2, 5, 10, 20, 50, 100), ("1", "2", "5", "10", "20", "50", "100"))
    axes.minorticks_off()
    axes.set_yticks(range(0, -len(joints), -1), [short(name) for name in joints])
    axes.set_title(f"by joint, up to {FASTEST:g} rad/s; complex pairs off their line", fontsize=9, color=INK)


def _error(axes: Axes, summary: TruthSummary) -> None:
    amplitude, error = np.array(sorted(summary.truth.small_signal_error.items())).T
    style = PALETTE["truth"]
    axes.loglog(amplitude, error, color=style.colour, ls=style.line, marker=style.marker, lw=1.6, ms=5)
    guide = error[-1] * amplitude / amplitude[-1]
    axes.loglog(amplitude, guide, **DASHED)
    at = (amplitude[1], guide[1])
    axes.annotate("in proportion", at, (6, -10), textcoords="offset points", fontsize=8, color=BOUND.colour)
    axes.set(xlabel="amplitude of the command / rad", ylabel="error of the linear model, relative")
    axes.set_title("small-signal truth against simulation, dry friction off", fontsize=9, color=INK)


def _attainable(axes: Axes, summary: TruthSummary) -> None:
    """Draw attainable errors on the record, with their fits in words."""
    rows = [
        (f"{short(name)}, {label}", horizon, entry.right_order if label == "simulation" else None)
        for name, entry in summary.attainable.items()
        for label, horizon in (("simulation", entry.simulation), ("one step ahead", entry.one_step))
    ]
    for number, (label, horizon, right_order) in enumerate(rows):
        floors = (horizon.any_model, horizon.best_linear, right_order, horizon.small_signal)
        for (kind, marker, colour), floor in zip(FLOORS, floors, strict=True):
            if floor:
                style: dict[str, Any] = {"marker": marker, "color": colour, "ms": 7, "mfc": "none", "mew": 1.5}
                axes.plot(1e3 * floor.rmse, -number, ls="", label=None if number else kind, **style)
        fits = " / ".join(f"{floor.fit:.2f}" for floor in floors if floor)
        at = (0.01, 0.2 - number)
        axes.annotate(f"{label}: fit {fits} %", at, xycoords=axes.get_yaxis_transform(), fontsize=8, color=INK)
    axes.set_yticks(range(0, -len(rows), -1), [""] * len(rows))
    axes.set(xscale="log", ylim=(0.5 - len(rows), 0.6), xlabel="attainable root mean square error / mrad")
    axes.margins(x=0.1)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    record = next(iter(summary.attainable.values())).provenance["record"]
    axes.set_title(f"attainable on {record}; fits in the sequence of the markers", fontsize=9, color=INK, pad=24)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, fontsize=8, frameon=False)
