"""Figures of a control study: a run over time, errors by joint, robustness, and responses that the operator sees."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import sysid
from hmtb_twin import JointLog
from scenarios.control.campaign import CONTROLLED, IdentifiedPair
from scenarios.control.score import GRID, answer_of, request_of, seen_responses
from scenarios.control.study import ControlResult
from scenarios.report.figure_style import MRAD, dress, plain_marks, short
from sysid.plots import INK, PALETTE, Style

WIDTH = 7.0
"""Width, inch."""

WITHOUT_LABEL = "without control"

WITHOUT = Style("#8a8a8a", "-", 1.6, "o")
"""The ground arm without control."""

REFERENCE = Style("#000000", "-", 1.8, "")
"""The reference."""

LAWS = (PALETTE["oe"], PALETTE["armax"], PALETTE["okid"])
"""The arm with each law, in the order of the methods."""


def law_styles(results: Sequence[ControlResult]) -> dict[str, Style]:
    """Return the style of each method."""
    methods = dict.fromkeys(one.method for one in results)
    return {method: LAWS[k % len(LAWS)] for k, method in enumerate(methods)}


def run_figure(results: Sequence[ControlResult], pair: IdentifiedPair) -> Figure:
    """Draw one run of one scenario over time: request and angles of the joint that moves most, and the errors."""
    logs, joint = _drawn(results)
    figure = Figure(figsize=(WIDTH, 4.8), layout="constrained")
    angles, errors = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    arm = results[0].runs.reference
    for label, (log, style) in logs.items():
        request, answer = request_of(log), answer_of(log)[:, joint]
        wanted = np.asarray(sysid.simulate(pair.reference, request))[:, joint]
        if arm is None or label == WITHOUT_LABEL:
            # At the worksite the operator answers to the arm: every run has requests of its own.
            text = "request" if arm is not None else f"request, {label}"
            angles.plot(
                log.time, MRAD * request[:, joint], color=INK if arm else style.colour, ls=":", lw=1.0, label=text
            )
        angles.plot(log.time, MRAD * answer, color=style.colour, lw=style.width, label=label)
        errors.plot(log.time, MRAD * (answer - wanted), color=style.colour, lw=1.0)
    if arm is not None:
        angles.plot(arm.time, MRAD * answer_of(arm)[:, joint], color=INK, ls="--", lw=1.2, label="flight arm")
    angles.set(ylabel=f"{short(CONTROLLED[joint])} / mrad", title=results[0].runs.scenario.name)
    errors.set(xlabel="time / s", ylabel="angle less reference\nmodel / mrad")
    figure.legend(fontsize=8, frameon=False, ncols=4, loc="outside upper center")
    dress([angles, errors])
    return figure


def error_figure(results: Sequence[ControlResult]) -> Figure:
    """Draw the root mean square error of every joint, a panel for each scenario."""
    names = list(dict.fromkeys(one.runs.scenario.name for one in results))
    figure = Figure(figsize=(WIDTH, 2.1 * len(names)), layout="constrained")
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(panels, names, strict=True):
        own = [one for one in results if one.runs.scenario.name == name]
        bars = {WITHOUT_LABEL: (np.mean([one.without.rmse for one in own], axis=0), WITHOUT)}
        for method, style in law_styles(results).items():
            errors = [one.controlled.rmse for one in own if one.method == method and one.controlled]
            if errors:
                bars[method] = (np.mean(errors, axis=0), style)
        for k, (label, (rmse, style)) in enumerate(bars.items()):
            at = np.arange(len(CONTROLLED)) + 0.8 * (k + 0.5) / len(bars) - 0.4
            axes.bar(at, MRAD * rmse, 0.75 / len(bars), color=style.colour, label=label)
        axes.set(yscale="log", ylabel="rms error / mrad", title=name)
        axes.set_xticks(range(len(CONTROLLED)), [short(joint) for joint in CONTROLLED], fontsize=8)
        plain_marks(axes.yaxis, axes.get_ylim())
    figure.legend(*panels[0].get_legend_handles_labels(), fontsize=8, frameon=False, ncols=4, loc="outside upper right")
    dress(panels)
    return figure


def robustness_figure(results: Sequence[ControlResult]) -> Figure:
    """Draw the error for every condition: a row for a changed arm or a wrong model, hollow where a run is unstable."""
    conditions = list(dict.fromkeys(one.condition for one in results))
    figure = Figure(figsize=(WIDTH, 0.32 * len(conditions) + 1.2), layout="constrained")
    axes = figure.subplots()
    for y, condition in enumerate(conditions):
        own = [one for one in results if one.condition == condition]
        axes.plot(MRAD * own[0].without.total, y, WITHOUT.marker, color=WITHOUT.colour, label=_once(WITHOUT_LABEL, y))
        for one, style in _styled(own):
            if one.controlled:
                face = style.colour if one.controlled.stable else "none"
                axes.plot(MRAD * one.controlled.total, y, "s", color=style.colour, mfc=face, label=_once(one.method, y))
    axes.set_yticks(range(len(conditions)), [text or "as identified" for text in conditions], fontsize=8)
    axes.set(xscale="log", xlabel="rms error over all joints / mrad", ylim=(len(conditions) - 0.5, -0.5))
    axes.set_title(results[0].runs.scenario.name)
    plain_marks(axes.xaxis, axes.get_xlim())
    figure.legend(fontsize=8, frameon=False, ncols=4, loc="outside upper right")
    dress([axes])
    return figure


def response_figure(results: Sequence[ControlResult], pair: IdentifiedPair) -> Figure:
    """Draw the response of the joint that moves most from request to angle: reference model, and what runs show."""
    logs, joint = _drawn(results)
    figure = Figure(figsize=(WIDTH, 4.4), layout="constrained")
    gain, phase = figure.subplots(2, 1, sharex=True)
    _draw_response(gain, phase, pair.reference.frequency_response(GRID)[:, joint, joint], REFERENCE, "reference model")
    for label, (log, style) in logs.items():
        seen = seen_responses(request_of(log), answer_of(log), log.dt)
        if joint in seen:
            _draw_response(gain, phase, seen[joint], style, label)
    gain.set(ylabel="gain", xscale="log", title=f"{short(CONTROLLED[joint])}, {results[0].runs.scenario.name}")
    phase.set(ylabel="phase / °", xlabel="frequency / Hz")
    plain_marks(phase.xaxis, (GRID[0], GRID[-1]))
    gain.legend(fontsize=8, frameon=False)
    dress([gain, phase])
    return figure


def _drawn(results: Sequence[ControlResult]) -> tuple[dict[str, tuple[JointLog, Style]], int]:
    """Return the logs of a scenario with their styles by label, and the joint that moves most."""
    logs = {WITHOUT_LABEL: (results[0].runs.without, WITHOUT)}
    logs |= {one.method: (one.runs.controlled.get(one.method), style) for one, style in _styled(results)}
    known = {label: (log, style) for label, (log, style) in logs.items() if log is not None}
    return known, int(np.argmax(np.ptp(request_of(next(iter(known.values()))[0]), axis=0)))


def _draw_response(gain: Axes, phase: Axes, response: np.ndarray, style: Style, label: str) -> None:
    gain.plot(GRID, np.abs(response), color=style.colour, lw=style.width, label=label)
    # Unwrapped within the stretch that is known.
    angle = np.full(len(GRID), np.nan)
    known = np.isfinite(response)
    angle[known] = np.degrees(np.unwrap(np.angle(response[known])))
    phase.plot(GRID, angle, color=style.colour, lw=style.width)


def _styled(results: Sequence[ControlResult]) -> list[tuple[ControlResult, Style]]:
    styles = law_styles(results)
    return [(one, styles[one.method]) for one in results if one.controlled is not None]


def _once(label: str, row: int) -> str:
    return label if row == 0 else "_" + label
