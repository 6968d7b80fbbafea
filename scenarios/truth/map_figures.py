"""Figures and page of the maps."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import matplotlib
import numpy as np
from jinja2 import Environment, PackageLoader
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from hmtb_twin import JOINTS, STUDIED_JOINTS
from hmtb_twin.files.atomic_write import write_whole
from scenarios.experiments.preview_figure import COLOURS, LINES
from scenarios.report.figure_style import dress, short
from scenarios.report.figures import SETTINGS, save_figure, svg
from scenarios.truth.map_findings import CONDITIONS, STUDIED, TOLERANCE, findings
from scenarios.truth.map_table import MOVING, UNITS, MapTable
from scenarios.truth.maps import PLANE, Maps
from scenarios.truth.truth_summary import conditions_in_words
from sysid.plots.palette import BOUND, INK, PALETTE

MARKERS = ("o", "s", "^", "D", "v", "P")
"""One for each joint: points stay apart in grey."""

WIDTH = 9.6
"""Width of the figures, inch."""

CHANGE = "change of bandwidth / %"

LEVELS = (-100.0 * TOLERANCE, 100.0 * TOLERANCE)
"""Changes up to which a bandwidth counts as unchanged, percent."""


def map_figures(maps: Maps) -> dict[str, Figure]:
    """Draw the maps.

    Returns:
        Figures by name; the template of the page says what each shows.
    """
    departures = conditions_in_words(maps.arm, departures=True)
    arm = f"arm {maps.truth.variant}, payload {maps.truth.payload}"
    if departures:
        arm += f", {departures}"
    figures = {
        "workspace": _workspace(maps, f"Over the workspace: {arm}"),
        "cuts": _cuts(maps, f"One joint turns, the others stay: {arm}"),
        "locality": _locality(maps, f"How local: {arm}"),
        "coupling": _coupling(maps, f"Coupling: {arm}"),
        "conditions": _conditions(maps, f"At the operating pose: {arm}"),
    }
    if "amplitude" in maps.table.varied:
        figures["amplitude"] = _amplitude(maps, f"Where linear ends: {arm}")
    return figures


def _panels(title: str, rows: int, columns: int, height: float, width: float = WIDTH) -> tuple[Figure, np.ndarray]:
    """Begin a figure of several panels, inch."""
    figure = Figure(figsize=(width, height), layout="constrained")
    figure.suptitle(title, x=0.01, ha="left", fontsize=11, color=INK)
    return figure, figure.subplots(rows, columns, squeeze=False)


def _curves(
    axes: Axes,
    joint: str,
    x: np.ndarray,
    y: np.ndarray,
    ends: np.ndarray | None = None,
    style: Mapping[str, Any] = MappingProxyType({}),
) -> None:
    """Draw a curve in the style of its joint; `ends` are those of its intervals (n, 2)."""
    k = MOVING.index(joint)
    of_joint = {"color": COLOURS[k], "ls": LINES[k], "marker": MARKERS[k], "ms": 4, "lw": 1.4}
    reach = None if ends is None else np.abs(np.transpose(ends) - y)
    axes.errorbar(x, y, reach, label=short(joint), capsize=2, elinewidth=0.9, **{**of_joint, **style})


def _changes(axes: Axes, maps: Maps, rows: MapTable, style: Mapping[str, Any]) -> None:
    """Draw the changes of the studied bandwidths between lines at the tolerance."""
    change = 100.0 * maps.change(rows)
    for joint, k in zip(STUDIED_JOINTS, STUDIED, strict=True):
        _curves(axes, joint, rows.value.astype(float), change[:, k], style=style)
    for level in LEVELS:
        axes.axhline(level, color=BOUND.colour, ls=BOUND.line, lw=BOUND.width)
    axes.set_ylabel(CHANGE)


def _dressed(figure: Figure) -> Figure:
    """Dress panels with curves, under which one legend names the joints."""
    dress(figure.axes)
    for axes in figure.axes:
        axes.title.set_fontsize(9)
    # All panels of a figure show the same joints.
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6, fontsize=8, frameon=False)
    return figure


def _image(axes: Axes, over: tuple[np.ndarray, np.ndarray], values: np.ndarray, label: str, title: str) -> None:
    """Draw values (a, b) over x (a,) and y (b,); changes with colours about zero and contours at the tolerance."""
    colours, norm = "cividis", None
    if label == CHANGE:
        # White is no change, and equal changes up and down are equally dark.
        largest = float(np.nanmax(np.abs(values)))
        colours, norm = "PuOr_r", TwoSlopeNorm(0.0, -largest, largest)
    # Rasterized: each cell as a path of its own would make the file many times larger.
    mesh = axes.pcolormesh(*over, values.T, cmap=colours, norm=norm, shading="nearest", rasterized=True)
    axes.figure.colorbar(mesh, ax=axes, label=label, pad=0.02)
    # Contours outside the values would draw nothing but a warning.
    bounds = [level for level in LEVELS if np.nanmin(values) < level < np.nanmax(values)]
    if bounds and norm is not None:
        lines = axes.contour(*over, values.T, bounds, colors=PALETTE["truth"].colour, linewidths=1.0)
        axes.clabel(lines, fmt="%+.0f %%", fontsize=8)
    axes.set_title(title, fontsize=9)
    axes.tick_params(labelsize=8, colors=INK)


def _workspace(maps: Maps, title: str) -> Figure:
    """Draw bandwidths, damping and coupling of the studied joints over shoulder and elbow pitch."""
    rows, columns = maps.table.rows("workspace"), [JOINTS.index(joint) for joint in PLANE]
    x, y = (np.unique(np.degrees(rows.angles[:, column])) for column in columns)
    figure, grid = _panels(title, 2, 3, 6.4)
    change = 100.0 * maps.change(rows)
    cross = 100.0 * rows.cross[:, STUDIED][:, :, STUDIED].max(axis=(1, 2))
    panels = []
    for joint, k in zip(STUDIED_JOINTS, STUDIED, strict=True):
        panels.append((f"{short(joint)}: {maps.here.of(joint)[0]:.3f} Hz here", change[:, k], CHANGE))
    panels.append(("smallest damping ratio", rows.damping[:, STUDIED].min(axis=1), "damping ratio"))
    panels.append(("largest cross gain up to 5 Hz", cross, "gain / %"))
    interaction = rows.interaction[:, STUDIED].max(axis=1)
    panels.append(("relative gain at the bandwidth", interaction, "distance from one"))
    for axes, (heading, values, label) in zip(grid.flat, panels, strict=True):
        _image(axes, (x, y), values.reshape(len(x), len(y)), label, heading)
        # A white ring on a black one shows on every colour of the map.
        for colour, width in (("black", 2.6), ("white", 1.2)):
            axes.plot(*np.degrees(maps.truth.angles[columns]), "o", ms=8, mfc="none", mec=colour, mew=width)
        axes.set(xlabel=f"{short(PLANE[0])} / deg", ylabel=f"{short(PLANE[1])} / deg")
    return figure


def _cuts(maps: Maps, title: str) -> Figure:
    """Draw the changes of the studied bandwidths while one joint turns, a panel for each joint."""
    figure, grid = _panels(title, 2, 3, 5.6)
    for axes, joint in zip(grid.flat, MOVING, strict=True):
        # Poses are so close that markers would hide the line styles.
        _changes(axes, maps, maps.table.rows(joint), {"marker": ""})
        operating_angle = float(np.degrees(maps.truth.angles[JOINTS.index(joint)]))
        axes.axvline(operating_angle, color=BOUND.colour, ls=":", lw=1.0)
        axes.set_xlabel(f"{short(joint)} / deg")
    return _dressed(figure)


def _locality(maps: Maps, title: str) -> Figure:
    """Draw the changes near the operating pose over distance, and the distribution of bandwidths over all poses."""
    figure, ((left, right),) = _panels(title, 1, 2, 4.2)
    _changes(left, maps, maps.table.rows("near"), {"ls": "", "ms": 3, "alpha": 0.7, "rasterized": True})
    for joint in STUDIED_JOINTS:
        hz = np.sort(maps.table.rows("anywhere").of(joint))
        _curves(right, joint, hz, 100.0 * np.arange(1, len(hz) + 1) / len(hz), style={"marker": ""})
        right.axvline(maps.here.of(joint)[0], color=COLOURS[MOVING.index(joint)], ls=":", lw=1.0)
    left.set(title="near the operating pose", xlabel="largest turn of a joint / deg", xlim=(0, None))
    right.set(title="anywhere", xlabel="bandwidth / Hz", ylabel="poses below it / %", ylim=(0, 100))
    return _dressed(figure)


def _coupling(maps: Maps, title: str) -> Figure:
    """Draw the cross gains of all pairs of joints, at the operating pose and over random poses."""
    figure, grid = _panels(title, 1, 2, 5.0)
    positions, names = np.arange(len(MOVING)), [short(joint) for joint in MOVING]
    often = np.nanquantile(maps.table.rows("anywhere").cross, 0.95, axis=0)
    headings = ("at the operating pose", "at 95 % of random poses")
    for axes, cross, heading in zip(grid.flat, (maps.here.cross[0], often), headings, strict=True):
        values = 100.0 * np.where(np.eye(len(MOVING), dtype=bool), np.nan, cross).T
        _image(axes, (positions, positions), values, "largest gain up to 5 Hz / %", heading)
        for i, j in np.argwhere(np.isfinite(values)):
            # The lower half of the scale of colours is dark.
            ink = "white" if values[i, j] < 0.55 * np.nanmax(values) else "black"
            axes.text(i, j, f"{values[i, j]:.1f}", ha="center", va="center", fontsize=8, color=ink)
        # The first joint on top, as in a matrix.
        axes.set(xlabel="commanded", ylabel="moved", ylim=(len(MOVING) - 0.5, -0.5))
        axes.set_xticks(positions, [name.replace(" ", "\n") for name in names])
        axes.set_yticks(positions, names)
    return figure


def _conditions(maps: Maps, title: str) -> Figure:
    """Draw the bandwidths over payload, supply pressure and oil temperature."""
    conditions = [condition for condition in CONDITIONS if condition in maps.table.varied]
    figure, grid = _panels(title, 1, len(conditions), 4.4)
    for axes, condition in zip(grid.flat, conditions, strict=True):
        rows = maps.table.rows(condition)
        # Payloads have names: they stand side by side, lightest first.
        x = np.arange(len(rows), dtype=float) if condition == "payload" else rows.value.astype(float)
        for joint in MOVING:
            _curves(axes, joint, x, rows.of(joint))
        label = f"{condition} / {UNITS[condition]}" if condition in UNITS else condition
        axes.set(xlabel=label, ylabel="bandwidth / Hz", ylim=(0.0, None))
        if condition == "payload":
            axes.set_xticks(x, rows.value)
    return _dressed(figure)


def _amplitude(maps: Maps, title: str) -> Figure:
    """Draw the best linear approximations over amplitude and, where it was varied, over the level of friction."""
    quantities: dict[str, dict[str, Any]] = {
        "bandwidth": {"ylabel": "bandwidth / Hz", "ylim": (0, None)},
        "stick_bandwidth": {"ylabel": "bandwidth from the stick / Hz", "ylim": (0, None)},
        "gain": {"ylabel": "gain up to 0.3 Hz / truth's", "ylim": (0, 1.1)},
        "distortion": {"ylabel": "distortion / %", "yscale": "log", "ylim": (0.01, 200.0)},
    }
    columns: dict[str, dict[str, Any]] = {"amplitude": {"xlabel": "amplitude at the stick / rad rms", "xscale": "log"}}
    if "friction" in maps.table.varied:
        columns["friction"] = {"xlabel": "dry friction / multiple of the arm's"}
    figure, grid = _panels(title, len(quantities), len(columns), 9.6, 4.8 * len(columns))
    for line, (name, vertical) in zip(grid, quantities.items(), strict=True):
        for axes, (varied, horizontal) in zip(line, columns.items(), strict=True):
            rows = maps.table.rows(varied)
            for joint in STUDIED_JOINTS:
                # A distortion of zero has no place on a logarithmic axis.
                values = rows.of(joint, name)
                values = np.where(values == 0.0, np.nan, values)
                ends = rows.of(joint, "interval") if name == "bandwidth" else None
                _curves(axes, joint, rows.value.astype(float), values, ends)
                if name.endswith("bandwidth"):
                    axes.axhline(maps.here.of(joint)[0], color=COLOURS[MOVING.index(joint)], ls=":", lw=1.0)
            axes.set(**vertical, **horizontal)
    return _dressed(figure)


def write_maps(maps: Maps, folder: Path) -> tuple[Path, ...]:
    """Write a page that needs no other file, its figures as SVG and the table as CSV.

    Args:
        maps: The maps.
        folder: Where; files of the same names are replaced.

    Returns:
        The files, the page first.

    Raises:
        OSError: A file cannot be written.
    """
    figures = map_figures(maps)
    with matplotlib.rc_context(SETTINGS):
        for name, figure in figures.items():
            save_figure(figure, folder / f"{name}.svg")

    def drawing(name: str, caption: Markup) -> Markup:
        """Draw a figure into the page; the caption, one line of plain characters, describes it to who cannot see it."""
        return Markup(svg(figures[name], " ".join(caption.unescape().split()), name))

    template = Environment(loader=PackageLoader("scenarios"), autoescape=True).get_template("maps.html.j2")
    page = template.render(
        title=f"Maps of the arm {maps.truth.variant} with payload {maps.truth.payload}",
        truth=maps.truth,
        conditions=conditions_in_words(maps.arm),
        findings=findings(maps),
        tolerance=f"{100 * TOLERANCE:.0f} %",
        figures=figures,
        svg=drawing,
    )
    write_whole(folder / "maps.csv", maps.table.text())
    write_whole(folder / "maps.html", page)
    drawings = [folder / f"{name}.svg" for name in figures]
    return (folder / "maps.html", *drawings, folder / "maps.csv")
