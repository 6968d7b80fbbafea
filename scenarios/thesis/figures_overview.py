"""Figures of the report's overview: the answer, the true response and pictures of the arm."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from hmtb_twin import JointLog, TwinError, load_arm, render
from hmtb_twin.arm.rendering import Stage
from hmtb_twin.run.playback import pictured_arm
from scenarios.experiments.campaign import RPCM
from scenarios.experiments.rpcm import rpcm_outcome
from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ
from scenarios.report.figure_style import NOT_EXCITED, WIDTH, dress, method_style, short
from scenarios.report.figures import photograph
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.response_figures import FREQUENCIES, line_mark
from sysid.models.bandwidth import half_power_hz
from sysid.plots import BOUND, INK, PALETTE

ANY = "#555555"
"""Colour of marks in the legend that stand for every colour."""


def bandwidths(study: Comparison) -> Figure:
    """Recovered bandwidths with their intervals, the truth as a line, the published models as stars."""
    figure = Figure(figsize=(WIDTH, 6.8), layout="constrained")
    rows = [len(entry.models) + len(entry.published) for entry in study.joints.values()]
    panels = figure.subplots(len(rows), 1, sharex=True, height_ratios=rows)
    for axes, (name, entry) in zip(panels, study.joints.items(), strict=True):
        labels: list[str] = []
        for model in entry.models.values():
            style, hz = method_style(model.method), model.bandwidth_hz
            reach = [[hz - model.ci95[0]], [model.ci95[1] - hz]]
            axes.errorbar(hz, len(labels), xerr=reach, fmt=style.marker, color=style.colour, ms=6, capsize=4, lw=1.8)
            axes.plot(model.half_power_hz, len(labels), "|", color=style.colour, ms=13, mew=2.0)
            labels.append(model.label.replace(", sufficient without friction", " †"))
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
        axes.set_title(f"{short(name)}: truth {entry.truth.bandwidth_hz:.3f} Hz", loc="left", fontsize=9)
        dress([axes])
    panels[-1].set_xlim(0.0, 1.55)
    panels[-1].set_xlabel("frequency / Hz")
    figure.legend(handles=_legend(), loc="outside upper left", ncols=2, fontsize=8, frameon=False)
    return figure


def _legend() -> list[Line2D | Patch]:
    star = PALETTE["published"]
    return [
        Line2D([], [], color=PALETTE["truth"].colour, lw=1.8, label="small-signal truth"),
        Line2D([], [], color=ANY, marker="o", ms=6, lw=1.8, label="bandwidth with 95 % interval"),
        Line2D([], [], color=star.colour, marker=star.marker, ms=9, ls="none", label="published model"),
        Line2D([], [], color=ANY, marker="|", ms=13, mew=2.0, ls="none", label="where the gain is 0.707"),
        Patch(color=NOT_EXCITED, label=f"about 1 Hz: {ABOUT_1_HZ[0]:g} to {ABOUT_1_HZ[1]:g} Hz"),
        Line2D([], [], color=BOUND.colour, ls=":", lw=1.2, label="1 Hz"),
    ]


LINES = ("solid", (0, (6, 2)), (0, (1.5, 1.5)))
"""Line style of each joint: colours are reserved for methods in this report."""


def true_responses(study: Comparison) -> Figure:
    """Gain and phase of the true joints, with the bandwidth of each marked."""
    figure = Figure(figsize=(WIDTH, 4.6), layout="constrained")
    gain, phase = figure.subplots(2, 1, sharex=True, height_ratios=(1.3, 1.0))
    for line, (name, entry) in zip(LINES, study.joints.items(), strict=True):
        response = entry.truth.model.frequency_response(FREQUENCIES)[:, 0, 0]
        level = 20.0 * np.log10(np.abs(response))
        label = f"{short(name)}: {entry.truth.bandwidth_hz:.3f} Hz"
        gain.plot(FREQUENCIES, level, color=INK, ls=line, lw=1.5, label=label)
        phase.plot(FREQUENCIES, np.degrees(np.unwrap(np.angle(response))), color=INK, ls=line, lw=1.5)
        at_dc = 20.0 * np.log10(abs(entry.truth.dc_gain))
        gain.plot(entry.truth.bandwidth_hz, at_dc + 20.0 * np.log10(np.sqrt(0.5)), "o", color=INK, ms=4)
    gain.axvline(1.0, color=BOUND.colour, ls=":", lw=1.2)
    line_mark(gain, "1 Hz", (1.0, 0.03), gap=3)
    gain.legend(title="bandwidth (dots)", fontsize=8, title_fontsize=8, loc="lower left", frameon=False)
    gain.set_ylabel("gain / dB")
    phase.set_ylabel("phase / degrees")
    phase.set_xlabel("frequency / Hz")
    phase.set_xscale("log")
    phase.set_xlim(FREQUENCIES[0], FREQUENCIES[-1])
    dress((gain, phase))
    return figure


PHASES = ("approach", "draw out", "transfer", "insert")
"""Phases of the exchange that are shown; the picture is of the middle of each."""

SIZE = (640, 480)
"""Width and height of a moment, pixels."""


@dataclass(frozen=True)
class Moment:
    """A picture of the exchange.

    Attributes:
        phase: What is being done.
        time: When, s.
        picture: The picture as the address of an image, or nothing where none could be drawn.
    """

    phase: str
    time: float
    picture: str


def arm_picture() -> tuple[str, str]:
    """Picture of the arm as a data URL; without one, an empty string and the reason."""
    try:
        return photograph(render(load_arm(), width=1200, height=750)), ""
    except TwinError as error:
        message = str(error)
        return "", message[:1].upper() + message[1:]


def exchange(study: Comparison, phases: Sequence[str] = PHASES) -> tuple[tuple[Moment, ...], str]:
    """Moments of the exchange and how it ended.

    Args:
        study: The study.
        phases: Which phases to show, of those that the exchange reached.

    Returns:
        The moments, and the outcome in words; none and nothing where there is no record or nothing to draw with.
    """
    log = study.logs.get(RPCM)
    if log is None or log.unit_pose is None:
        return (), ""
    outcome = rpcm_outcome(log)
    times = {name: sum(outcome.phases[name]) / 2 for name in phases if name in outcome.phases}
    try:
        return _moments(log, times), str(outcome)
    except TwinError:
        return (), str(outcome)


def _moments(log: JointLog, times: dict[str, float]) -> tuple[Moment, ...]:
    if log.unit_pose is None:
        return ()
    moments = []
    with Stage(pictured_arm(log), *SIZE) as stage:
        for phase, time in times.items():
            tick = min(round(time / log.dt), len(log) - 1)
            picture = stage.picture("seats", log.true_angles[tick], log.unit_pose[tick])
            moments.append(Moment(phase, time, photograph(picture)))
    return tuple(moments)
