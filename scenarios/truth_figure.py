"""The truth in one figure: responses with their bandwidths, poles and zeros, error against amplitude."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from scenarios.preview_figure import COLOURS, LINES
from scenarios.truth_summary import TruthSummary
from sysid.palette import BOUND, GRID, INK, PALETTE

LOWEST = 0.05
"""Lowest frequency shown, Hz: that of the experiments' excitation."""

SLOWEST, FASTEST = 3.0, 400.0
"""Roots that the strip shows, rad/s."""

APART = 0.22
"""How far a complex pair stands off its joint's line in the strip."""


def truth_figure(summary: TruthSummary) -> Figure:
    """Draw the truth about an arm.

    Args:
        summary: The truth; best linear approximations are drawn where there are some.

    Returns:
        The figure.
    """
    figure = Figure(figsize=(10.0, 9.6), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.25, 1.0))
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
    for axes in (gain, phase, error, plane, strip):
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
        handles.append(
            Line2D([], [], color=INK, marker=".", ls="", ms=5, label=f"best linear at {_amplitude(summary):g} rad rms")
        )
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    truth = summary.truth
    figure.suptitle(
        f"Truth: arm {truth.variant}, payload {truth.payload}, pose {truth.pose.replace('_', ' ')}, "
        f"{truth.plant.actuator} actuators",
        x=0.01,
        ha="left",
        fontsize=11,
        color=INK,
    )
    return figure


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
        s = s[s.real < 0.0]
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
    axes.set_xticks((5, 10, 20, 50, 100, 200), ("5", "10", "20", "50", "100", "200"))
    axes.minorticks_off()
    axes.set_yticks(range(0, -len(joints), -1), [name.replace("_", " ") for name in joints])
    axes.set_title("joint by joint; complex pairs stand off their line", fontsize=9, color=INK)


def _amplitude(summary: TruthSummary) -> float:
    return next(iter(summary.best_linear.values())).multisines.rms
