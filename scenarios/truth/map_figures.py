"""Figures and page of the maps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from jinja2 import Environment, PackageLoader
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from hmtb_twin import JOINTS, STUDIED_JOINTS
from scenarios.experiments.preview_figure import COLOURS, LINES
from scenarios.files.atomic_write import write_whole
from scenarios.report.figure_style import dress
from scenarios.report.figures import SETTINGS, save_figure, svg
from scenarios.truth.map_findings import STUDIED, TOLERANCE, findings, words
from scenarios.truth.map_table import MOVING, UNITS, MapTable
from scenarios.truth.maps import PLANE, Maps
from scenarios.truth.truth_summary import conditions_in_words, departures_in_words
from sysid.plots.palette import BOUND, INK, PALETTE

MARKERS = ("o", "s", "^", "D", "v", "P")
"""One for each joint: points stay apart in grey."""

CAPTIONS = {
    "workspace": f"""Change of each studied joint's bandwidth over shoulder and elbow pitch, the others at the operating
        pose (circle); lines where it is {100 * TOLERANCE:.0f} %. Below: smallest damping ratio of the studied joints'
        poles, largest gain up to 5 Hz from one studied joint's command to another's angle, and largest distance of a
        relative gain from one at the joint's bandwidth.""",
    "cuts": f"""Change of the studied joints' bandwidths while one joint turns through its range, from those at the
        operating pose (dotted); dashed: {100 * TOLERANCE:.0f} %.""",
    "locality": """Left: change of the studied joints' bandwidths at random poses, against the largest turn of any joint
        from the operating pose. Right: part of random poses of the whole joint space with a bandwidth below the value
        on the axis (dotted: at the operating pose).""",
    "coupling": """Largest gain up to 5 Hz from a joint's command (column) to another joint's angle (row), in percent of
        that joint's own gain at 0 Hz: at the operating pose, and not exceeded at 95 % of random poses.""",
    "conditions": """Bandwidth of every joint over payload, supply pressure and oil temperature; gaps where the arm
        cannot hold the pose.""",
    "amplitude": """Best linear approximation of the studied joints, each excited alone by random-phase multisines, over
        amplitude (left) and over dry friction (right). Bandwidth with 95 % interval (dotted: small-signal truth);
        bandwidth from the angle asked for at the stick, before the velocity limit; gain at low frequency over that of
        the truth; nonlinear distortion. Where the gain is far below one the arm sticks, and a bandwidth, which is
        relative to that gain, says little.""",
}
"""What each figure shows."""


@dataclass(frozen=True, eq=False)
class Panel:
    """One panel of a figure: curves by joint, or an image.

    Attributes:
        axes: Labels, limits and scales, as `Axes.set` takes them.
        curves: By joint x (n,) and y (n,), and where known the ends of intervals of y (n, 2).
        style: Style of the curves, beside the joint's colour, line and marker.
        levels: Heights of dashed lines; of an image, values of its contours.
        marks: Positions of dotted lines by joint; "" for a line of no joint.
        upright: Whether the dotted lines are vertical.
        image: Values (a, b) over x and y, its colour map and the label of its colour bar.
        over: x (a,) and y (b,) of the image.
        circle: Point of the image that is marked; without one, every value is printed.
    """

    axes: Mapping[str, Any]
    curves: Mapping[str, Sequence[np.ndarray]] = field(default_factory=dict)
    style: Mapping[str, Any] = field(default_factory=dict)
    levels: tuple[float, ...] = ()
    marks: Mapping[str, float] = field(default_factory=dict)
    upright: bool = False
    image: np.ndarray | None = None
    over: tuple[np.ndarray, np.ndarray] = (np.empty(0), np.empty(0))
    colours: str = "cividis"
    label: str = ""
    circle: tuple[float, ...] = ()


def map_figure(title: str, panels: Sequence[Sequence[Panel]], size: tuple[float, float]) -> Figure:
    """Draw rows of panels with one legend of joints.

    Args:
        title: Above all panels.
        panels: The panels, row by row; rows are of one length.
        size: Width and height, inch.
    """
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(len(panels), len(panels[0]), squeeze=False)
    for axes, panel in zip(grid.flat, (panel for row in panels for panel in row), strict=True):
        for joint, (x, y, *interval) in panel.curves.items():
            number = MOVING.index(joint)
            style = {"color": COLOURS[number], "ls": LINES[number], "marker": MARKERS[number], "ms": 4, "lw": 1.4}
            reach = np.abs(np.transpose(interval[0]) - y) if interval else None
            axes.errorbar(x, y, reach, label=words(joint), capsize=2, elinewidth=0.9, **{**style, **panel.style})
        for joint, at in panel.marks.items():
            colour = COLOURS[MOVING.index(joint)] if joint else BOUND.colour
            (axes.axvline if panel.upright else axes.axhline)(at, color=colour, ls=":", lw=1.0)
        if panel.image is None:
            for level in panel.levels:
                axes.axhline(level, color=BOUND.colour, ls=BOUND.line, lw=BOUND.width)
            dress([axes])
        else:
            _image(figure, axes, panel, panel.image)
        axes.set(**panel.axes)
        axes.title.set_fontsize(9)
        axes.tick_params(labelsize=8, colors=INK)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=6, fontsize=8, frameon=False)
    figure.suptitle(title, x=0.01, ha="left", fontsize=11, color=INK)
    return figure


def _image(figure: Figure, axes: Axes, panel: Panel, values: np.ndarray) -> None:
    x, y = panel.over
    widest = float(np.nanmax(np.abs(values)))
    norm = None if panel.colours == "cividis" else TwoSlopeNorm(0.0, -widest, widest)
    mesh = axes.pcolormesh(x, y, values.T, cmap=panel.colours, norm=norm, shading="nearest", rasterized=True)
    figure.colorbar(mesh, ax=axes, label=panel.label, pad=0.02)
    bounds = [level for level in panel.levels if np.nanmin(values) < level < np.nanmax(values)]
    if bounds and norm is not None:
        lines = axes.contour(x, y, values.T, bounds, colors=PALETTE["truth"].colour, linewidths=1.0)
        axes.clabel(lines, fmt="%+.0f %%", fontsize=8)
    if panel.circle:
        axes.plot(*panel.circle, "o", ms=8, mfc="none", mec="black", mew=2.6)
        axes.plot(*panel.circle, "o", ms=8, mfc="none", mec="white", mew=1.2)
    else:
        for i, j in np.argwhere(np.isfinite(values)):
            ink = "white" if values[i, j] < 0.55 * widest else "black"
            axes.text(x[i], y[j], f"{values[i, j]:.1f}", ha="center", va="center", fontsize=8, color=ink)


def map_figures(maps: Maps) -> dict[str, Figure]:
    """Draw the maps.

    Args:
        maps: The maps.

    Returns:
        Figures by name; `CAPTIONS` says what each shows.
    """
    departures = departures_in_words(maps.arm)
    arm = f"arm {maps.truth.variant}, payload {maps.truth.payload}" + (f", {departures}" if departures else "")
    figures = {
        "workspace": map_figure(f"Over the workspace: {arm}", _workspace(maps), (9.6, 6.4)),
        "cuts": map_figure(f"One joint turns, the others stay: {arm}", _cuts(maps), (9.6, 5.6)),
        "locality": map_figure(f"How local: {arm}", _locality(maps), (9.6, 4.2)),
        "coupling": map_figure(f"Coupling: {arm}", _coupling(maps), (9.6, 5.0)),
        "conditions": map_figure(f"At the operating pose: {arm}", _conditions(maps), (9.6, 4.4)),
    }
    if "amplitude" in maps.table.varied:
        panels = _amplitude(maps)
        figures["amplitude"] = map_figure(f"Where linear ends: {arm}", panels, (4.8 * len(panels[0]), 9.6))
    return figures


LEVELS = (-100.0 * TOLERANCE, 100.0 * TOLERANCE)


def _workspace(maps: Maps) -> list[list[Panel]]:
    rows = maps.table.rows("workspace")
    over = tuple(np.unique(np.degrees(rows.angles[:, JOINTS.index(joint)])) for joint in PLANE)
    circle = tuple(np.degrees(maps.truth.angles[JOINTS.index(joint)]) for joint in PLANE)

    def panel(
        title: str, values: np.ndarray, label: str, colours: str = "cividis", levels: tuple[float, ...] = ()
    ) -> Panel:
        axes = {"title": title, "xlabel": f"{words(PLANE[0])} / deg", "ylabel": f"{words(PLANE[1])} / deg"}
        image = values.reshape(len(over[0]), len(over[1]))
        return Panel(axes, image=image, over=over, circle=circle, label=label, colours=colours, levels=levels)  # type: ignore[arg-type]

    change = 100.0 * maps.change(rows)
    cross = 100.0 * rows.cross[:, STUDIED][:, :, STUDIED].max(axis=(1, 2))
    return [
        [
            panel(
                f"{words(joint)}: {maps.here.of(joint)[0]:.3f} Hz here",
                change[:, k],
                "change of bandwidth / %",
                colours="PuOr_r",
                levels=LEVELS,
            )
            for joint, k in zip(STUDIED_JOINTS, STUDIED, strict=True)
        ],
        [
            panel("smallest damping ratio", rows.damping[:, STUDIED].min(axis=1), "damping ratio"),
            panel("largest cross gain up to 5 Hz", cross, "gain / %"),
            panel("relative gain at the bandwidth", rows.interaction[:, STUDIED].max(axis=1), "distance from one"),
        ],
    ]


def _changes(maps: Maps, rows: MapTable) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    change = 100.0 * maps.change(rows)
    return {joint: (rows.value.astype(float), change[:, MOVING.index(joint)]) for joint in STUDIED_JOINTS}


def _cuts(maps: Maps) -> list[list[Panel]]:
    panels = [
        Panel(
            {"xlabel": f"{words(joint)} / deg", "ylabel": "change of bandwidth / %"},
            _changes(maps, maps.table.rows(joint)),
            {"marker": ""},
            levels=LEVELS,
            marks={"": float(np.degrees(maps.truth.angles[JOINTS.index(joint)]))},
            upright=True,
        )
        for joint in MOVING
    ]
    return [panels[:3], panels[3:]]


def _locality(maps: Maps) -> list[list[Panel]]:
    anywhere = {joint: np.sort(maps.table.rows("anywhere").of(joint)) for joint in STUDIED_JOINTS}
    shares = {joint: (hz, 100.0 * np.arange(1, len(hz) + 1) / len(hz)) for joint, hz in anywhere.items()}
    left = {"title": "near the operating pose", "xlabel": "largest turn of a joint / deg", "xlim": (0, None)}
    right = {"title": "anywhere", "xlabel": "bandwidth / Hz", "ylabel": "poses below it / %", "ylim": (0, 100)}
    near = _changes(maps, maps.table.rows("near"))
    here = {joint: float(maps.here.of(joint)[0]) for joint in STUDIED_JOINTS}
    style = {"ls": "", "ms": 3, "alpha": 0.7, "rasterized": True}
    return [
        [
            Panel({**left, "ylabel": "change of bandwidth / %"}, near, style, levels=LEVELS),
            Panel(right, shares, {"marker": ""}, marks=here, upright=True),
        ]
    ]


def _coupling(maps: Maps) -> list[list[Panel]]:
    places = np.arange(len(MOVING))
    names = [words(joint) for joint in MOVING]
    axes = {"xlabel": "commanded", "ylabel": "moved", "xticks": places, "yticks": places, "yticklabels": names}
    axes |= {"xticklabels": [name.replace(" ", "\n") for name in names], "ylim": (len(MOVING) - 0.5, -0.5)}
    often = np.nanquantile(maps.table.rows("anywhere").cross, 0.95, axis=0)
    return [
        [
            Panel(
                {**axes, "title": title},
                image=100.0 * np.where(np.eye(len(MOVING), dtype=bool), np.nan, cross).T,
                over=(places, places),
                label="largest gain up to 5 Hz / %",
            )
            for cross, title in ((maps.here.cross[0], "at the operating pose"), (often, "at 95 % of random poses"))
        ]
    ]


def _conditions(maps: Maps) -> list[list[Panel]]:
    panels = []
    for name in ("payload", "supply pressure", "oil temperature"):
        rows = maps.table.rows(name)
        if not len(rows):
            continue
        axes: dict[str, Any] = {"ylabel": "bandwidth / Hz", "ylim": (0.0, None)}
        if name == "payload":
            x = np.arange(len(rows), dtype=float)
            axes |= {"xlabel": name, "xticks": x, "xticklabels": rows.value}
        else:
            x = rows.value.astype(float)
            axes["xlabel"] = f"{name} / {UNITS[name]}"
        panels.append(Panel(axes, {joint: (x, rows.of(joint)) for joint in MOVING}))
    return [panels]


def _amplitude(maps: Maps) -> list[list[Panel]]:
    quantities: tuple[tuple[str, dict[str, Any]], ...] = (
        ("bandwidth", {"ylabel": "bandwidth / Hz", "ylim": (0, None)}),
        ("stick_bandwidth", {"ylabel": "bandwidth from the stick / Hz", "ylim": (0, None)}),
        ("gain", {"ylabel": "gain up to 0.3 Hz / truth's", "ylim": (0, 1.1)}),
        ("distortion", {"ylabel": "distortion / %", "yscale": "log", "ylim": (0.01, 200.0)}),
    )
    here = {joint: float(maps.here.of(joint)[0]) for joint in STUDIED_JOINTS}
    columns = (
        ("amplitude", {"xlabel": "amplitude at the stick / rad rms", "xscale": "log"}),
        ("friction", {"xlabel": "dry friction / multiple of the arm's"}),
    )
    panels = []
    for name, axes in quantities:
        row = []
        for varied, horizontal in columns:
            rows = maps.table.rows(varied)
            if not len(rows):
                continue
            curves = {}
            for joint in STUDIED_JOINTS:
                # A distortion of zero has no place on a logarithmic axis.
                values = np.where(rows.of(joint, name) == 0.0, np.nan, rows.of(joint, name))
                interval = [rows.of(joint, "interval")] if name == "bandwidth" else []
                curves[joint] = (rows.value.astype(float), values, *interval)
            row.append(Panel({**axes, **horizontal}, curves, marks=here if name.endswith("bandwidth") else {}))
        panels.append(row)
    return panels


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
    page = Environment(loader=PackageLoader("scenarios"), autoescape=True).get_template("maps.html.j2")
    text = page.render(
        title=f"Maps of the arm {maps.truth.variant} with payload {maps.truth.payload}",
        truth=maps.truth,
        conditions=conditions_in_words(maps.arm),
        findings=findings(maps),
        drawings={
            name: Markup(svg(figure, " ".join(CAPTIONS[name].split()), name)) for name, figure in figures.items()
        },
        captions=CAPTIONS,
    )
    write_whole(folder / "maps.csv", maps.table.text())
    write_whole(folder / "maps.html", text)
    return (folder / "maps.html", *(folder / f"{name}.svg" for name in figures), folder / "maps.csv")
