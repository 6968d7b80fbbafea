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
from scenarios.truth.attainable import Floor, Horizon
from scenarios.truth.truth_summary import TruthSummary, conditions_in_words, pose_in_words
from sysid import FrequencyResponse
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
    heights = [2.9, 2.9, 2.9]
    floors_height = 0.0
    if summary.attainable:
        floors_height = 0.7 + 0.7 * len(summary.attainable)
        heights.append(floors_height)
    figure = Figure(figsize=(10.0, 9.6 + floors_height), layout="constrained")
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
    handles = _legend_handles(summary, joints)
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    figure.suptitle(_title(summary), x=0.01, ha="left", fontsize=11, color=INK)
    return figure


def _legend_handles(summary: TruthSummary, joints: list[str]) -> list[Line2D]:
    """Samples of the lines and markers of all panels."""
    handles = []
    for joint, colour, line in zip(joints, COLOURS, LINES, strict=False):
        handles.append(Line2D([], [], color=colour, ls=line, lw=1.6, label=short(joint)))
    handles.append(Line2D([], [], color=INK, marker="o", ls="", mfc="white", label="bandwidth"))
    if summary.best_linear:
        rms = next(iter(summary.best_linear.values())).experiment.multisines.rms
        handles.append(Line2D([], [], color=INK, marker=".", ls="", ms=5, label=f"best linear at {rms:g} rad rms"))
        handles.append(Line2D([], [], color=INK, marker="|", ls="-", lw=1.4, ms=7, label="its bandwidth, 95 %"))
    return handles


def _title(summary: TruthSummary) -> str:
    """Arm, payload and pose; below them what departs from the nominal conditions."""
    truth, departures = summary.truth, conditions_in_words(summary.arm, departures=True)
    arm = f"Truth: arm {truth.variant}, payload {truth.payload}, pose {short(pose_in_words(truth))}"
    if not departures:
        return f"{arm}; nominal conditions"
    return f"{arm}\n{departures[0].upper()}{departures[1:]}"


def _responses(gain: Axes, phase: Axes, summary: TruthSummary, joints: list[str]) -> None:
    """Draw gain and phase of every joint with its bandwidth, and the best linear ones where they were measured."""
    nyquist = 0.5 / summary.truth.dt
    f = np.geomspace(LOWEST, nyquist, 300)
    for row, joint in enumerate(joints):
        joint_truth, colour, line = summary.joints[joint], COLOURS[row], LINES[row]
        response = joint_truth.model.frequency_response(f)[:, 0, 0]
        angle = np.unwrap(np.angle(response))
        gain.plot(f, _decibels(response), color=colour, ls=line, lw=1.6)
        phase.plot(f, np.degrees(angle), color=colour, ls=line, lw=1.6)
        hz = joint_truth.bandwidth_hz
        if np.isfinite(hz):
            mark: dict[str, Any] = {"color": colour, "marker": "o", "ms": 6, "mfc": "white", "mew": 1.5, "zorder": 5}
            gain.plot(hz, _decibels(joint_truth.model.frequency_response([hz])[0, 0, 0]), **mark)
            phase.plot(hz, np.degrees(np.interp(hz, f, angle)), **mark)
        if joint in summary.best_linear:
            measured = summary.best_linear[joint].servo.response
            _measured_response(gain, phase, measured, np.interp(measured.frequencies, f, angle), colour)
            hz, low, high = summary.best_linear[joint].bandwidth.path()
            if np.isfinite(hz):
                height, reach = HALF_POWER_DB - APART_DB * (1 + row), ((hz - low,), (high - hz,))
                interval: dict[str, Any] = {"color": colour, "marker": "|", "ms": 7, "capsize": 4, "zorder": 6}
                gain.errorbar(hz, height, xerr=reach, elinewidth=1.6, **interval)
    gain.axhline(HALF_POWER_DB, **DASHED)
    gain.annotate("half power", (LOWEST, -3.0), (4, -10), textcoords="offset points", fontsize=8, color=BOUND.colour)
    gain.set(ylabel="gain / dB", xscale="log", xlim=(LOWEST, nyquist))
    gain.set_ylim(bottom=max(gain.get_ylim()[0], -80.0))
    gain.set_title("commanded to measured angle at 50 Hz", fontsize=9, color=INK)
    phase.set(xlabel="frequency / Hz", ylabel="phase / deg", xscale="log", xlim=(LOWEST, nyquist))
    for axes in (gain, phase):
        axes.set_xticks((0.1, 1.0, 10.0), ("0.1", "1", "10"))


def _measured_response(
    gain: Axes, phase: Axes, measured: FrequencyResponse, true_phase: np.ndarray, colour: str
) -> None:
    """Draw the lines of a best linear approximation; the truth's phase at them, rad, says which turn they are in."""
    values = measured.response[:, 0, 0]
    dots: dict[str, Any] = {"color": colour, "marker": ".", "ls": "", "ms": 4, "alpha": 0.8}
    gain.plot(measured.frequencies, _decibels(values), **dots)
    # Whole turns are those nearest to the truth's phase: unwrapping noisy lines among themselves may slip by one.
    departure = np.angle(values * np.exp(-1j * true_phase))
    phase.plot(measured.frequencies, np.degrees(true_phase + departure), **dots)


def _decibels(response: np.ndarray) -> np.ndarray:
    return np.asarray(20.0 * np.log10(np.abs(response)))


def _plane(axes: Axes, summary: TruthSummary, joints: list[str]) -> None:
    """Draw poles and zeros of all joints in the z plane."""
    reach, outside = 1.1, 0
    for joint, colour in zip(joints, COLOURS, strict=False):
        poles, zeros = summary.joints[joint].poles, summary.joints[joint].zeros
        axes.plot(poles.real, poles.imag, "x", color=colour, ms=7, mew=1.5)
        axes.plot(zeros.real, zeros.imag, "o", color=colour, ms=7, mfc="none", mew=1.2)
        # A zero far outside would shrink the unit circle: it is counted in the title instead.
        outside += int(np.sum(np.maximum(np.abs(zeros.real), np.abs(zeros.imag)) > reach))
    axes.add_patch(Circle((0.0, 0.0), 1.0, fill=False, ec=BOUND.colour, ls=BOUND.line, lw=BOUND.width))
    axes.set(xlabel="real part", ylabel="imaginary part", xlim=(-reach, reach), ylim=(-reach, reach))
    axes.set_box_aspect(1.0)
    left_out = f"; {outside} zeros further out" if outside else ""
    axes.set_title(f"z plane: poles ×, zeros ○{left_out}", fontsize=9, color=INK)


def _moduli(axes: Axes, summary: TruthSummary, joints: list[str]) -> None:
    """Draw every joint on a line of its own: where many roots meet, the plane cannot show which is whose."""
    cross, circle = {"marker": "x", "mew": 1.6}, {"marker": "o", "mfc": "none"}
    for row, joint in enumerate(joints):
        joint_truth = summary.joints[joint]
        for roots, style in ((joint_truth.poles, cross), (joint_truth.zeros, circle)):
            # z = 0 is a delay and a negative real z alternates: neither has an image in the strip of the s plane.
            inside = (np.abs(roots) > 1e-6) & ((np.abs(roots.imag) > 1e-9) | (roots.real > 0.0))
            s = np.log(roots[inside].astype(complex)) / summary.truth.dt
            s = s[(s.real < 0.0) & (np.abs(s) < FASTEST / 1.05)]
            # The imaginary part of a real root is rounding.
            imaginary = np.where(np.abs(s.imag) > 1e-6 * np.abs(s), s.imag, 0.0)
            axes.plot(np.abs(s), -row + APART * np.sign(imaginary), ls="", ms=7, color=COLOURS[row], **style)
    axes.set(xscale="log", xlim=(SLOWEST, FASTEST), ylim=(0.6 - len(joints), 0.6))
    axes.set_xlabel("modulus in the s plane / (rad/s)")
    axes.set_xticks((1, 2, 5, 10, 20, 50, 100), ("1", "2", "5", "10", "20", "50", "100"))
    axes.minorticks_off()
    axes.set_yticks(range(0, -len(joints), -1), [short(name) for name in joints])
    axes.set_title(f"by joint, up to {FASTEST:g} rad/s; complex pairs off their line", fontsize=9, color=INK)


def _error(axes: Axes, summary: TruthSummary) -> None:
    """Draw the error of the linear model over amplitude, beside a line in proportion to amplitude."""
    amplitude, error = np.array(sorted(summary.truth.small_signal_error.items())).T
    style = PALETTE["truth"]
    axes.loglog(amplitude, error, color=style.colour, ls=style.line, marker=style.marker, lw=1.6, ms=5)
    # The first nonlinear term of a smooth arm departs in proportion to the amplitude.
    guide = error[-1] * amplitude / amplitude[-1]
    axes.loglog(amplitude, guide, **DASHED)
    at = (amplitude[1], guide[1])
    axes.annotate("in proportion", at, (6, -10), textcoords="offset points", fontsize=8, color=BOUND.colour)
    axes.set(xlabel="amplitude of the command / rad", ylabel="error of the linear model, relative")
    axes.set_title("small-signal truth against simulation, dry friction off", fontsize=9, color=INK)


def _attainable(axes: Axes, summary: TruthSummary) -> None:
    """Draw attainable errors on the record, with their fits in words."""
    rows: list[tuple[str, Horizon, Floor | None]] = []
    for joint, limits in summary.attainable.items():
        rows.append((f"{short(joint)}, simulation", limits.simulation, limits.right_order))
        rows.append((f"{short(joint)}, one step ahead", limits.one_step, None))
    for row, (label, horizon, right_order) in enumerate(rows):
        floors = (horizon.any_model, horizon.best_linear, right_order, horizon.small_signal)
        for (model_class, marker, colour), floor in zip(FLOORS, floors, strict=True):
            if floor:
                style: dict[str, Any] = {"marker": marker, "color": colour, "ms": 7, "mfc": "none", "mew": 1.5}
                # The first row, a simulation, has every class: it alone feeds the legend.
                legend_label = None if row else model_class
                axes.plot(1e3 * floor.rmse, -row, ls="", label=legend_label, **style)
        fits = " / ".join(f"{floor.fit:.2f}" for floor in floors if floor)
        position = (0.01, 0.2 - row)
        axes.annotate(f"{label}: fit {fits} %", position, xycoords=axes.get_yaxis_transform(), fontsize=8, color=INK)
    axes.set_yticks(range(0, -len(rows), -1), [""] * len(rows))
    axes.set(xscale="log", ylim=(0.5 - len(rows), 0.6), xlabel="attainable root mean square error / mrad")
    axes.margins(x=0.1)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    record = next(iter(summary.attainable.values())).provenance["record"]
    axes.set_title(f"attainable on {record}; fits in the sequence of the markers", fontsize=9, color=INK, pad=24)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, fontsize=8, frameon=False)
