"""Figures of the maps: over the workspace, joint by joint, near and anywhere, over conditions, over amplitude."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from hmtb_twin import JOINTS, STUDIED_JOINTS
from scenarios.experiments.preview_figure import COLOURS, LINES
from scenarios.truth.amplitude_maps import LargeSignal
from scenarios.truth.local_dynamics import MOVING
from scenarios.truth.map_findings import words
from scenarios.truth.maps import Maps
from scenarios.truth.pose_maps import STUDIED, TOLERANCE, change
from scenarios.truth.truth_summary import departures_in_words
from sysid.plots.palette import BOUND, GRID, INK, PALETTE

MARKERS = ("o", "s", "^", "D", "v", "P")
"""So that points of several joints stay apart in grey."""


def map_figures(maps: Maps) -> dict[str, tuple[Figure, str]]:
    """Draw the maps.

    Args:
        maps: The maps.

    Returns:
        By name, a figure and what it shows.
    """
    drawn = {
        "workspace": (
            workspace(maps),
            "Change of each studied joint's bandwidth over shoulder and elbow pitch, the others at the operating pose "
            f"(circle); lines where it is {100 * TOLERANCE:.0f} %. Below: smallest damping ratio of the studied "
            "joints' poles, largest gain up to 5 Hz from one studied joint's command to another's angle, and largest "
            "distance of a relative gain from one at the joint's bandwidth.",
        ),
        "cuts": (
            joint_by_joint(maps),
            "Change of the studied joints' bandwidths while one joint turns through its range, from those at the "
            f"operating pose (dotted); dashed: {100 * TOLERANCE:.0f} %.",
        ),
        "locality": (
            locality(maps),
            "Left: change of the studied joints' bandwidths at random poses, against the largest turn of any joint "
            "from the operating pose. Right: part of random poses of the whole joint space with a bandwidth below the "
            "value on the axis.",
        ),
        "coupling": (
            coupling(maps),
            "Largest gain up to 5 Hz from a joint's command (column) to another joint's angle (row), in percent of "
            "that joint's own gain at 0 Hz: at the operating pose, and not exceeded at 95 % of random poses.",
        ),
        "conditions": (
            over_conditions(maps),
            "Bandwidth of every joint over payload, supply pressure and oil temperature; gaps where the arm cannot "
            "hold the pose.",
        ),
    }
    if maps.large:
        drawn["amplitude"] = (
            over_amplitude(maps, maps.large.over_amplitude, maps.large.over_level),
            "Best linear approximation of the studied joints, each excited alone by random-phase multisines, over "
            "amplitude (left) and over dry friction (right). Bandwidth with 95 % interval, thin line: small-signal "
            "truth, hollow: from the angle asked for at the stick, before the velocity limit; gain at low frequency "
            "over that of the truth; nonlinear distortion. Where the gain is far below one the arm sticks, and a "
            "bandwidth, which is relative to that gain, says little.",
        )
    return drawn


def workspace(maps: Maps) -> Figure:
    """Six maps over shoulder and elbow pitch."""
    figure = Figure(figsize=(9.6, 6.4), layout="constrained")
    panels = figure.subplots(2, 3, sharex=True, sharey=True)
    surface = maps.plane
    shift = 100.0 * surface.grid(change(surface.dynamics, maps.here))[..., STUDIED]
    widest = float(np.nanmax(np.abs(shift)))
    for number, joint in enumerate(STUDIED_JOINTS):
        axes = panels[0, number]
        image = _heat(axes, maps, shift[..., number], "PuOr_r", TwoSlopeNorm(0.0, -widest, widest))
        _levels(axes, maps, shift[..., number])
        axes.set_title(f"{words(joint)}: {maps.here.of(joint)[0]:.3f} Hz here", fontsize=9, color=INK)
    figure.colorbar(image, ax=panels[0, :], label="change of bandwidth / %", pad=0.01)
    cross = surface.grid(surface.dynamics.cross[:, STUDIED][:, :, STUDIED].max(axis=(1, 2)))
    apart = surface.grid(surface.dynamics.interaction[:, STUDIED].max(axis=1))
    damping = surface.grid(surface.dynamics.damping[:, STUDIED].min(axis=1))
    for axes, values, title, label in (
        (panels[1, 0], damping, "smallest damping ratio", "damping ratio"),
        (panels[1, 1], 100.0 * cross, "largest cross gain up to 5 Hz", "gain / %"),
        (panels[1, 2], apart, "relative gain at the bandwidth", "distance from one"),
    ):
        figure.colorbar(_heat(axes, maps, values, "cividis", None), ax=axes, label=label, pad=0.02)
        axes.set_title(title, fontsize=9, color=INK)
    for axes in panels[1]:
        axes.set_xlabel("shoulder pitch / deg")
    for axes in panels[:, 0]:
        axes.set_ylabel("elbow pitch / deg")
    _title(figure, f"Over the workspace: {_arm(maps)}")
    return figure


def joint_by_joint(maps: Maps) -> Figure:
    """One panel for each joint that turns."""
    figure = Figure(figsize=(9.6, 5.6), layout="constrained")
    panels = figure.subplots(2, 3, sharey=True)
    for axes, cut in zip(panels.flat, maps.cuts, strict=True):
        shift = 100.0 * change(cut.dynamics, maps.here)
        for number, joint in enumerate(STUDIED_JOINTS):
            style = {"color": COLOURS[number], "ls": LINES[number], "lw": 1.5}
            axes.plot(np.degrees(cut.angles), shift[:, STUDIED[number]], label=words(joint), **style)
        _bounds(axes)
        axes.axvline(np.degrees(maps.truth.angles[JOINTS.index(cut.joint)]), color=BOUND.colour, ls=":", lw=1.0)
        axes.set_xlabel(f"{words(cut.joint)} / deg")
        _plain(axes)
    for axes in panels[:, 0]:
        axes.set_ylabel("change of bandwidth / %")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    _title(figure, f"One joint turns, the others stay: {_arm(maps)}")
    return figure


def locality(maps: Maps) -> Figure:
    """How far the bandwidths hold, and how they spread."""
    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    shift = 100.0 * change(maps.near.dynamics, maps.here)
    for number, joint in enumerate(STUDIED_JOINTS):
        style = {"color": COLOURS[number], "marker": MARKERS[number]}
        turns = np.degrees(maps.near.distance)
        left.plot(turns, shift[:, STUDIED[number]], ls="", ms=3, alpha=0.7, rasterized=True, **style)
        hz = np.sort(maps.anywhere.dynamics.of(joint))
        hz = hz[np.isfinite(hz)]
        part = 100.0 * np.arange(1, len(hz) + 1) / len(hz)
        right.plot(hz, part, color=COLOURS[number], ls=LINES[number], lw=1.6, label=words(joint))
        here = float(maps.here.of(joint)[0])
        right.plot(here, np.interp(here, hz, part), color=COLOURS[number], marker=MARKERS[number], ms=6)
    _bounds(left)
    left.set(xlabel="largest turn of a joint / deg", ylabel="change of bandwidth / %", xlim=(0, None))
    right.set(xlabel="bandwidth / Hz", ylabel="poses below it / %", ylim=(0, 100))
    right.legend(fontsize=8, frameon=False, loc="upper left", title="marks: operating pose", title_fontsize=8)
    left.set_title("near the operating pose", fontsize=9, color=INK)
    right.set_title("anywhere", fontsize=9, color=INK)
    for axes in (left, right):
        _plain(axes)
    _title(figure, f"How local: {_arm(maps)}")
    return figure


def coupling(maps: Maps) -> Figure:
    """What joints do to each other."""
    figure = Figure(figsize=(9.6, 5.0), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    often = np.nanquantile(maps.anywhere.dynamics.cross, 0.95, axis=0)
    here = maps.here.cross[0]
    top = 100.0 * max(float(np.nanmax(often)), float(here.max()))
    for axes, values, title in (
        (panels[0], here, "at the operating pose"),
        (panels[1], often, "not exceeded at 95 % of random poses"),
    ):
        percent = 100.0 * np.ma.masked_where(np.eye(len(MOVING), dtype=bool), values)
        image = axes.imshow(percent, cmap="cividis", vmin=0.0, vmax=top)
        for i, j in np.argwhere(~np.eye(len(MOVING), dtype=bool)):
            ink = "white" if percent[i, j] < 0.55 * top else "black"
            axes.text(j, i, f"{percent[i, j]:.1f}", ha="center", va="center", fontsize=8, color=ink)
        names = [words(joint) for joint in MOVING]
        axes.set_xticks(range(len(MOVING)), names, rotation=30, ha="right", fontsize=8)
        axes.set_yticks(range(len(MOVING)), names, fontsize=8)
        axes.set_title(title, fontsize=9, color=INK)
        axes.set_xlabel("commanded")
    panels[0].set_ylabel("moved")
    figure.colorbar(image, ax=panels, label="largest gain up to 5 Hz / %", pad=0.01)
    _title(figure, f"Coupling: {_arm(maps)}")
    return figure


def over_conditions(maps: Maps) -> Figure:
    """Bandwidth of every joint over each condition."""
    figure = Figure(figsize=(9.6, 4.4), layout="constrained")
    (panels,) = figure.subplots(1, len(maps.conditions), sharey=True, squeeze=False)
    for axes, varied in zip(panels, maps.conditions, strict=True):
        names = all(isinstance(value, str) for value in varied.values)
        places = np.arange(len(varied.values)) if names else np.array(varied.values, dtype=float)
        for number, joint in enumerate(MOVING):
            style = {"color": COLOURS[number], "ls": LINES[number], "marker": MARKERS[number]}
            axes.plot(places, varied.dynamics.of(joint), lw=1.3, ms=4, label=words(joint), **style)
        if names:
            axes.set_xticks(places, [str(value) for value in varied.values], fontsize=8, rotation=30, ha="right")
            axes.margins(x=0.15)
        axes.set_xlabel(f"{varied.name} / {varied.unit}" if varied.unit else varied.name)
        _plain(axes)
    panels[0].set_ylabel("bandwidth / Hz")
    panels[0].set_ylim(bottom=0.0)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6, fontsize=8, frameon=False)
    _title(figure, f"At the operating pose: {_arm(maps)}")
    return figure


def over_amplitude(maps: Maps, amplitudes: Sequence[LargeSignal], levels: Sequence[LargeSignal]) -> Figure:
    """Bandwidth, gain and distortion over amplitude and over friction."""
    columns = [(amplitudes, "amplitude", "amplitude at the stick / rad rms")]
    if levels:
        columns.append((levels, "level", "dry friction / multiple of the arm's"))
    figure = Figure(figsize=(4.8 * len(columns), 8.4), layout="constrained")
    panels = figure.subplots(3, len(columns), sharex="col", sharey="row", squeeze=False)
    for column, (points, attribute, label) in enumerate(columns):
        for number, joint in enumerate(STUDIED_JOINTS):
            own = [point for point in points if point.joint == joint]
            at = np.array([getattr(point, attribute) for point in own])
            hz, low, high = np.array([(point.hz, *point.ci95) for point in own]).T
            style = {"color": COLOURS[number], "ls": LINES[number], "marker": MARKERS[number], "lw": 1.4, "ms": 5}
            top = panels[0, column]
            top.errorbar(at, hz, (hz - low, high - hz), capsize=2, elinewidth=0.9, label=words(joint), **style)
            top.axhline(float(maps.here.of(joint)[0]), color=COLOURS[number], ls=LINES[number], lw=0.7)
            if attribute == "amplitude":
                hollow = {**style, "mfc": "white", "lw": 0.8}
                top.plot(at, [point.asked_hz for point in own], **hollow)
            panels[1, column].plot(at, [point.gain for point in own], **style)
            panels[2, column].plot(at, [point.distortion_percent or np.nan for point in own], **style)
        if attribute == "amplitude":
            panels[0, column].set_xscale("log")
        panels[2, column].set_xlabel(label)
    panels[0, 0].set(ylabel="bandwidth / Hz", yscale="log")
    panels[1, 0].set(ylabel="gain up to 0.3 Hz / truth's", ylim=(0, 1.1))
    panels[2, 0].set(ylabel="distortion / %", yscale="log", ylim=(0.01, 200.0))
    panels[0, 0].set_yticks((0.1, 0.2, 0.5, 1.0, 2.0), ("0.1", "0.2", "0.5", "1", "2"))
    panels[0, 0].minorticks_off()
    for axes in panels.flat:
        _plain(axes)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    _title(figure, f"Where linear ends: {_arm(maps)}")
    return figure


def _arm(maps: Maps) -> str:
    departures = departures_in_words(maps.arm)
    return f"arm {maps.truth.variant}, payload {maps.truth.payload}" + (f", {departures}" if departures else "")


def _heat(axes: Axes, maps: Maps, values: np.ndarray, colours: str, norm: TwoSlopeNorm | None) -> QuadMesh:
    first, second = (np.degrees(axis) for axis in maps.plane.axes)
    image = axes.pcolormesh(first, second, values.T, cmap=colours, norm=norm, shading="nearest", rasterized=True)
    place = [np.degrees(maps.truth.angles[JOINTS.index(joint)]) for joint in maps.plane.joints]
    axes.plot(*place, "o", ms=8, mfc="none", mec="black", mew=2.6)
    axes.plot(*place, "o", ms=8, mfc="none", mec="white", mew=1.2)
    axes.tick_params(labelsize=8, colors=INK)
    return image


def _levels(axes: Axes, maps: Maps, values: np.ndarray) -> None:
    first, second = (np.degrees(axis) for axis in maps.plane.axes)
    bounds = [
        bound for bound in (-100.0 * TOLERANCE, 100.0 * TOLERANCE) if np.nanmin(values) < bound < np.nanmax(values)
    ]
    if bounds:
        lines = axes.contour(first, second, values.T, bounds, colors=PALETTE["truth"].colour, linewidths=1.0)
        axes.clabel(lines, fmt="%+.0f %%", fontsize=8)


def _bounds(axes: Axes) -> None:
    for bound in (-100.0 * TOLERANCE, 100.0 * TOLERANCE):
        axes.axhline(bound, color=BOUND.colour, ls=BOUND.line, lw=BOUND.width)


def _plain(axes: Axes) -> None:
    axes.grid(True, color=GRID, lw=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8, colors=INK)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _title(figure: Figure, text: str) -> None:
    figure.suptitle(text, x=0.01, ha="left", fontsize=11, color=INK)
