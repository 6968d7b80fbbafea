"""Figures of a control study: a run over time, errors by joint, robustness, and responses that the operator sees."""

from collections.abc import Sequence
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import sysid
from hmtb_twin import JointLog
from scenarios.control.campaign import IdentifiedPair
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


def run_figure(results: Sequence[ControlResult], pair: IdentifiedPair) -> Figure:
    """Draw one run of one scenario over time: request and angles of the joint that moves most, and the errors."""
    logs, joint = _styled_logs(results)
    figure = Figure(figsize=(WIDTH, 4.8), layout="constrained")
    angles, errors = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    arm = results[0].runs.logs.get("reference")
    for label, (log, style) in logs.items():
        request, answer = request_of(log), answer_of(log)[:, joint]
        reference_answer = np.asarray(sysid.simulate(pair.reference, request))[:, joint]
        if arm is None or label == WITHOUT_LABEL:
            # At the worksite the operator answers to the arm: every run has requests of its own.
            request_label, colour = ("request", INK) if arm is not None else (f"request, {label}", style.colour)
            angles.plot(log.time, MRAD * request[:, joint], color=colour, ls=":", lw=1.0, label=request_label)
        angles.plot(log.time, MRAD * answer, color=style.colour, lw=style.width, label=label)
        errors.plot(log.time, MRAD * (answer - reference_answer), color=style.colour, lw=1.0)
    if arm is not None:
        label = f"{arm.provenance['variant']} arm"
        angles.plot(arm.time, MRAD * answer_of(arm)[:, joint], color=INK, ls="--", lw=1.2, label=label)
    angles.set(ylabel=f"{short(results[0].joints[joint])} / mrad", title=results[0].runs.scenario.name)
    errors.set(xlabel="time / s", ylabel="angle less reference\nmodel / mrad")
    figure.legend(fontsize=8, frameon=False, ncols=4, loc="outside upper center")
    dress([angles, errors])
    return figure


def error_figure(results: Sequence[ControlResult]) -> Figure:
    """Draw the root mean square error of every joint, a panel for each scenario."""
    names, styles = list(dict.fromkeys(result.runs.scenario.name for result in results)), _styles(results)
    joints = results[0].joints
    figure = Figure(figsize=(WIDTH, 2.1 * len(names)), layout="constrained")
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(panels, names, strict=True):
        of_scenario = [result for result in results if result.runs.scenario.name == name]
        errors_by_label = {WITHOUT_LABEL: [result.without.rmse for result in of_scenario]}
        for result in of_scenario:
            if result.controlled:
                errors_by_label.setdefault(result.method, []).append(result.controlled.rmse)
        bars = len(errors_by_label)
        for index, (label, errors) in enumerate(errors_by_label.items()):
            # The bars of a joint share four fifths of its place, side by side about its mark.
            positions = np.arange(len(joints)) + 0.8 * (index + 0.5) / bars - 0.4
            axes.bar(positions, MRAD * np.mean(errors, axis=0), 0.75 / bars, color=styles[label].colour, label=label)
        axes.set(yscale="log", ylabel="rms error / mrad", title=name)
        axes.set_xticks(range(len(joints)), [short(joint) for joint in joints], fontsize=8)
        plain_marks(axes.yaxis, axes.get_ylim())
    figure.legend(*panels[0].get_legend_handles_labels(), fontsize=8, frameon=False, ncols=4, loc="outside upper right")
    dress(panels)
    return figure


def robustness_figure(results: Sequence[ControlResult]) -> Figure:
    """Draw the error for every condition: a row for a changed arm or a wrong model, hollow where a run is unstable."""
    conditions, styles = list(dict.fromkeys(result.condition for result in results)), _styles(results)
    figure = Figure(figsize=(WIDTH, 0.32 * len(conditions) + 1.2), layout="constrained")
    axes = figure.subplots()
    for result in results:
        for label, score, marker in ((WITHOUT_LABEL, result.without, "o"), (result.method, result.controlled, "s")):
            if score is None:
                continue
            row, colour = conditions.index(result.condition), styles[label].colour
            fill = colour if score.stable else "none"
            axes.plot(MRAD * score.total, row, marker, color=colour, mfc=fill, label=label)
    axes.set_yticks(range(len(conditions)), [condition or "as identified" for condition in conditions], fontsize=8)
    # Turned round: the first condition is on top.
    axes.set(xscale="log", xlabel="rms error over all joints / mrad", ylim=(len(conditions) - 0.5, -0.5))
    axes.set_title(results[0].runs.scenario.name)
    plain_marks(axes.xaxis, axes.get_xlim())
    handles, labels = axes.get_legend_handles_labels()
    # Every row has drawn the same labels: each stands in the legend once.
    handle_by_label = dict(zip(labels, handles, strict=True))
    figure.legend(
        handle_by_label.values(), handle_by_label, fontsize=8, frameon=False, ncols=4, loc="outside upper right"
    )
    dress([axes])
    return figure


def response_figure(results: Sequence[ControlResult], pair: IdentifiedPair) -> Figure:
    """Draw the response of the joint that moves most from request to angle: reference model, and what runs show."""
    logs, joint = _styled_logs(results)
    figure = Figure(figsize=(WIDTH, 4.4), layout="constrained")
    gain, phase = figure.subplots(2, 1, sharex=True)
    # The reference by the same estimate: where requests are poor, all curves are wrong alike.
    request = request_of(logs[WITHOUT_LABEL][0])
    drawn = [("reference model", REFERENCE, request, np.asarray(sysid.simulate(pair.reference, request)))]
    for label, (log, style) in logs.items():
        drawn.append((label, style, request_of(log), answer_of(log)))
    for label, style, request, answer in drawn:
        seen = seen_responses(request, answer, logs[WITHOUT_LABEL][0].dt)[:, joint]
        if np.isfinite(seen).any():
            _draw_response(gain, phase, seen, style, label)
    gain.set(ylabel="gain", xscale="log", title=f"{short(results[0].joints[joint])}, {results[0].runs.scenario.name}")
    phase.set(ylabel="phase / °", xlabel="frequency / Hz")
    plain_marks(phase.xaxis, (GRID[0], GRID[-1]))
    if gain.lines:
        gain.legend(fontsize=8, frameon=False)
    else:
        gain.text(0.5, 0.5, "the requests are too poor for a response", transform=gain.transAxes, ha="center")
    dress([gain, phase])
    return figure


def _styled_logs(results: Sequence[ControlResult]) -> tuple[dict[str, tuple[JointLog, Style]], int]:
    """Return the logs of a scenario with their styles by label, and the joint that moves most."""
    logs = {WITHOUT_LABEL: results[0].runs.logs["without"], **results[0].runs.logs}
    drawn: dict[str, tuple[JointLog, Style]] = {}
    for label, style in _styles(results).items():
        # The run of a law may have failed.
        if label in logs:
            drawn[label] = (logs[label], style)
    return drawn, int(np.argmax(np.ptp(request_of(logs[WITHOUT_LABEL]), axis=0)))


def _draw_response(gain: Axes, phase: Axes, response: np.ndarray, style: Style, label: str) -> None:
    """Draw gain and phase of one response at `GRID`; gaps where it is NaN."""
    gain.plot(GRID, np.abs(response), color=style.colour, lw=style.width, label=label)
    # Unwrapped within the stretch that is known.
    angle = np.full(len(GRID), np.nan)
    finite = np.isfinite(response)
    angle[finite] = np.degrees(np.unwrap(np.angle(response[finite])))
    phase.plot(GRID, angle, color=style.colour, lw=style.width)


def _styles(results: Sequence[ControlResult]) -> dict[str, Style]:
    """Return the style without control and of each method by label."""
    methods = dict.fromkeys(result.method for result in results)
    return {WITHOUT_LABEL: WITHOUT, **dict(zip(methods, cycle(LAWS), strict=False))}
