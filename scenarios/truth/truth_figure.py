"""The truth in one figure: responses with their bandwidths, poles and zeros, error against amplitude."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from scenarios.experiments.preview_figure import COLOURS, LINES
from scenarios.truth.truth_summary import TruthSummary, departures_in_words, pose_in_words
from sysid.plots.palette import BOUND, GRID, INK, PALETTE

LOWEST = 0.05
"""Lowest frequency shown, Hz: that of the experiments' excitation."""

SLOWEST, FASTEST = 0.7, 160.0
"""Ends of the strip of roots, rad/s; what falls below a twentieth within a sample is faster."""

APART = 0.22
"""How far a complex pair stands off its joint's line in the strip."""

APART_DB = 1.6
"""How far apart the intervals of measured bandwidths stand, dB: at half power they would hide one another."""


def truth_figure(summary: TruthSummary) -> Figure:
    """Draw the truth about an arm.

    Args:
        summary: The truth; best linear approximations and what is attainable on a record are drawn where there are
            some.

    Returns:
        The figure.
    """
    floors = 0.7 + 0.7 * len(summary.attainable) if summary.attainable else 0.0
    figure = Figure(figsize=(10.0, 9.6 + floors), layout="constrained")
    heights = (2.9, 2.9, 2.9, *((floors,) if floors else ()))
    grid = figure.add_gridspec(len(heights), 2, width_ratios=(1.25, 1.0), height_ratios=heights)
    gain, phase, error = (figure.add_subplot(grid[row, 0]) for row in range(3))
    plane, strip = figure.add_subplot(grid[:2, 1]), figure.add_subplot(grid[2, 1])
    joints = [name for name in summary.joints if name not in summary.locked]
    for number, name in enumerate(joints):
        _response(gain, phase, summary, name, number)
        _roots(plane, summary, name, number)
        _strip(strip, summary, name, number)
    _error(error, summary)
    _finish_responses(gain, phase, summary)
    _finish_plane(plane, summary)
    _finish_strip(strip, joints)
    panels = [gain, phase, error, plane, strip]
    if summary.attainable:
        panels.append(figure.add_subplot(grid[3, :]))
        _attainable(panels[-1], summary)
    for axes in panels:
        axes.grid(True, color=GRID, lw=0.6)
        axes.set_axisbelow(True)
        axes.tick_params(labelsize=8, colors=INK)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    handles = [
        Line2D([], [], color=COLOURS[number], ls=LINES[number], lw=1.6, label=name.replace("_", " "))
        for number, name in enumerate(joints)
    ]
    handles.append(Line2D([], [], color=INK, marker="o", ls="", mfc="white", label="bandwidth"))
    if summary.best_linear:
        label = f"best linear at {_amplitude(summary):g} rad rms"
        handles.append(Line2D([], [], color=INK, marker=".", ls="", ms=5, label=label))
        handles.append(Line2D([], [], color=INK, marker="|", ls="-", lw=1.4, ms=7, label="its bandwidth, 95 %"))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    figure.suptitle(_title(summary), x=0.01, ha="left", fontsize=11, color=INK)
    return figure


def _title(summary: TruthSummary) -> str:
    truth, departures = summary.truth, departures_in_words(summary.arm)
    arm = f"Truth: arm {truth.variant}, payload {truth.payload}, pose {pose_in_words(truth).replace('_', ' ')}"
    return arm + (f"\n{departures[0].upper()}{departures[1:]}" if departures else "; nominal conditions")


def _response(gain: Axes, phase: Axes, summary: TruthSummary, name: str, number: int) -> None:
    entry = summary.joints[name]
    style: dict[str, Any] = {"color": COLOURS[number], "ls": LINES[number], "lw": 1.6}
    frequencies = np.geomspace(LOWEST, 0.5 / summary.truth.dt, 300)
    response = entry.model.frequency_response(frequencies)[:, 0, 0]
    gain.plot(frequencies, 20.0 * np.log10(np.abs(response)), **style)
    phase.plot(frequencies, np.degrees(np.unwrap(np.angle(response))), **style)
    if np.isfinite(entry.bandwidth_hz):
        at = entry.model.frequency_response([entry.bandwidth_hz])[0, 0, 0]
        mark: dict[str, Any] = {
            "color": COLOURS[number],
            "marker": "o",
            "ms": 6,
            "mfc": "white",
            "mew": 1.5,
            "ls": "",
            "zorder": 5,
        }
        gain.plot(entry.bandwidth_hz, 20.0 * np.log10(abs(at)), **mark)
        turned = np.interp(entry.bandwidth_hz, frequencies, np.unwrap(np.angle(response)))
        phase.plot(entry.bandwidth_hz, np.degrees(turned), **mark)
    if name in summary.best_linear:
        measured = summary.best_linear[name].servo.response
        values = measured.response[:, 0, 0]
        dots: dict[str, Any] = {"color": COLOURS[number], "marker": ".", "ls": "", "ms": 4, "alpha": 0.8}
        gain.plot(measured.frequencies, 20.0 * np.log10(np.abs(values)), **dots)
        expected = np.unwrap(np.angle(response))
        near = np.interp(measured.frequencies, frequencies, expected)
        # The turn that is nearest to the truth's.
        turned = near + np.angle(values * np.exp(-1j * near))
        phase.plot(measured.frequencies, np.degrees(turned), **dots)
        _measured_bandwidth(gain, summary, name, number)


def _measured_bandwidth(gain: Axes, summary: TruthSummary, name: str, number: int) -> None:
    """The bandwidth of the best linear approximation with its interval, below half power, joint under joint."""
    found = summary.best_linear[name]
    hz, low, high = (float(part[0, 0]) for part in (found.bandwidth.hz, *found.bandwidth.ci95))
    if not np.isfinite(hz):
        return
    at = -10.0 * np.log10(2.0) - APART_DB * (1 + number)
    reach = ((hz - low,), (high - hz,))
    gain.errorbar(
        hz, at, xerr=reach, color=COLOURS[number], marker="|", ms=7, capsize=4, elinewidth=1.6, ls="", zorder=6
    )


def _roots(axes: Axes, summary: TruthSummary, name: str, number: int) -> None:
    entry = summary.joints[name]
    axes.plot(entry.poles.real, entry.poles.imag, "x", color=COLOURS[number], ms=7, mew=1.5)
    axes.plot(entry.zeros.real, entry.zeros.imag, "o", color=COLOURS[number], ms=7, mfc="none", mew=1.2)


def _strip(axes: Axes, summary: TruthSummary, name: str, number: int) -> None:
    """Every joint on a line of its own: where many roots meet, the plane cannot tell them apart."""
    entry, colour = summary.joints[name], COLOURS[number]
    styles: tuple[tuple[np.ndarray, dict[str, Any]], ...] = (
        (entry.poles, {"marker": "x", "ms": 7, "mew": 1.6}),
        (entry.zeros, {"marker": "o", "ms": 8, "mfc": "none", "mew": 1.2}),
    )
    for roots, style in styles:
        inside = (np.abs(roots) > 1e-6) & ((np.abs(roots.imag) > 1e-9) | (roots.real > 0.0))
        s = np.log(roots[inside].astype(complex)) / summary.truth.dt
        s = s[(s.real < 0.0) & (np.abs(s) < FASTEST / 1.05)]
        off = APART * np.sign(np.where(np.abs(s.imag) > 1e-6 * np.abs(s), s.imag, 0.0))
        axes.plot(np.abs(s), -number + off, ls="", color=colour, **style)


def _error(axes: Axes, summary: TruthSummary) -> None:
    errors = sorted(summary.truth.small_signal_error.items())
    amplitude, error = np.array(errors).T
    style = PALETTE["truth"]
    axes.loglog(amplitude, error, color=style.colour, ls=style.line, marker=style.marker, lw=1.6, ms=5)
    guide = error[-1] * amplitude / amplitude[-1]
    axes.loglog(amplitude, guide, color=BOUND.colour, ls=BOUND.line, lw=BOUND.width)
    axes.annotate(
        "in proportion", (amplitude[1], guide[1]), (6, -10), textcoords="offset points", fontsize=8, color=BOUND.colour
    )
    axes.set(xlabel="amplitude of the command / rad", ylabel="error of the linear model, relative")
    axes.set_title("small-signal truth against simulation, dry friction off", fontsize=9, color=INK)


FLOORS = (
    ("any model", "D", "#000000"),
    ("best linear", "s", "#0072b2"),
    ("of the truth's order", "^", "#d55e00"),
    ("small-signal truth", "o", "#009e73"),
)
"""Floors of a record: name, marker, colour; best first."""


def _attainable(axes: Axes, summary: TruthSummary) -> None:
    """What models could attain on the record: errors on the axis, fits beside them in words."""
    labels: list[str] = []
    for name, found in summary.attainable.items():
        for label, horizon in (("simulation", found.simulation), ("one step ahead", found.one_step)):
            of_order = found.right_order if label == "simulation" else None
            floors = (horizon.any_model, horizon.best_linear, of_order, horizon.small_signal)
            row = -len(labels)
            for (kind, marker, colour), floor in zip(FLOORS, floors, strict=True):
                if floor:
                    style: dict[str, Any] = {"marker": marker, "color": colour, "ms": 7, "mfc": "none", "mew": 1.5}
                    axes.plot(1e3 * floor.rmse, row, ls="", label=kind if not row else None, **style)
            fits = " / ".join(f"{floor.fit:.2f}" for floor in floors if floor)
            axes.annotate(
                f"{name.replace('_', ' ')}, {label}: fit {fits} %",
                (0.01, row + 0.2),
                xycoords=axes.get_yaxis_transform(),
                fontsize=8,
                color=INK,
            )
            labels.append(label)
    axes.set_yticks(range(0, -len(labels), -1), [""] * len(labels))
    axes.set(xscale="log", ylim=(0.5 - len(labels), 0.6), xlabel="attainable root mean square error / mrad")
    axes.margins(x=0.1)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    record = next(iter(summary.attainable.values())).provenance["record"]
    axes.set_title(f"attainable on {record}; fits in the sequence of the markers", fontsize=9, color=INK, pad=24)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, fontsize=8, frameon=False)


def _finish_responses(gain: Axes, phase: Axes, summary: TruthSummary) -> None:
    nyquist = 0.5 / summary.truth.dt
    gain.axhline(-10.0 * np.log10(2.0), color=BOUND.colour, ls=BOUND.line, lw=BOUND.width)
    gain.annotate("half power", (LOWEST, -3.0), (4, -10), textcoords="offset points", fontsize=8, color=BOUND.colour)
    gain.set(ylabel="gain / dB", xscale="log", xlim=(LOWEST, nyquist))
    gain.set_ylim(bottom=max(gain.get_ylim()[0], -80.0))
    phase.set(xlabel="frequency / Hz", ylabel="phase / deg", xscale="log", xlim=(LOWEST, nyquist))
    for axes in (gain, phase):
        axes.set_xticks((0.1, 1.0, 10.0), ("0.1", "1", "10"))
    gain.set_title("commanded to measured angle at 50 Hz", fontsize=9, color=INK)


def _finish_plane(axes: Axes, summary: TruthSummary) -> None:
    axes.add_patch(Circle((0.0, 0.0), 1.0, fill=False, ec=BOUND.colour, ls=BOUND.line, lw=BOUND.width))
    reach = 1.1
    roots = [root for name in summary.joints if name not in summary.locked for root in summary.joints[name].zeros]
    outside = sum(max(abs(root.real), abs(root.imag)) > reach for root in roots)
    left_out = f"; {outside} zeros further out" if outside else ""
    axes.set(xlabel="real part", ylabel="imaginary part", xlim=(-reach, reach), ylim=(-reach, reach))
    axes.set_box_aspect(1.0)
    axes.set_title(f"z plane: poles ×, zeros ○{left_out}", fontsize=9, color=INK)


def _finish_strip(axes: Axes, joints: list[str]) -> None:
    axes.set(
        xscale="log", xlim=(SLOWEST, FASTEST), ylim=(0.6 - len(joints), 0.6), xlabel="modulus in the s plane / (rad/s)"
    )
    axes.set_xticks((1, 2, 5, 10, 20, 50, 100), ("1", "2", "5", "10", "20", "50", "100"))
    axes.minorticks_off()
    axes.set_yticks(range(0, -len(joints), -1), [name.replace("_", " ") for name in joints])
    axes.set_title(f"by joint, up to {FASTEST:g} rad/s; complex pairs off their line", fontsize=9, color=INK)


def _amplitude(summary: TruthSummary) -> float:
    return next(iter(summary.best_linear.values())).multisines.rms
