"""Report section on how far the arm moved: the record of a campaign of `hmtb motion`, read and checked, and its map."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import TemplateError
from matplotlib.figure import Figure

from scenarios.files.errors import DAMAGE, ScenarioError
from scenarios.report.figure_style import MRAD, short
from scenarios.report.page import Page
from scenarios.thesis.answer import drawn_models
from scenarios.thesis.chart import Chart, Panel, Series, by_view, draw
from scenarios.thesis.motion import METHODS
from scenarios.thesis.motion_answer import motion_texts
from sysid.plots import PALETTE, Style

MOST = 10_000_000
"""Largest record, bytes: that of the whole campaign has a hundredth."""

BANDWIDTHS = (0.1, 6.0)
"""Ends of the axis of the map, Hz."""


def read_motion(path: Path | None = None) -> Mapping[str, Any]:
    """Read a `motion.json` of `hmtb motion`, and try that words, table and map can be made of it.

    Without a path it is that of the whole campaign, which comes with the package.

    Raises:
        ScenarioError: It is none, is larger than `MOST`, or cannot be read.
    """
    try:
        if path is not None and path.stat().st_size > MOST:
            raise ValueError(f"it has {path.stat().st_size} bytes")
        source = path or files("scenarios") / "data" / "motion.json"
        record = json.loads(source.read_text(encoding="utf-8"), parse_constant=_refuse)
        motion_texts(record)
        Page({"words": str}).render("motion.html.j2", {"motion": record, "moved": (), "figures": {}})
        for cell in record["map"]:
            if not (drawn_models(cell["joint"]) and min(cell[name] for name in ("gain", "friction", "volts")) > 0.0):
                raise ValueError(f"a cell of the map has no studied joint, motion or friction: {str(cell)[:60]}")
        motion_chart(record["map"])
    except (*DAMAGE, TemplateError) as error:
        why = f"{type(error).__name__}: {error}"[:200]
        raise ScenarioError(f"cannot read {str(path)!r}, expected a motion.json of hmtb motion: {why}") from error
    return dict(record)


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is no number")


def motion_chart(cells: Sequence[Mapping[str, Any]]) -> Chart:
    """Bandwidth that the methods recover over friction and motion, from the cells of the map of `motion.json`."""
    joints = {short(joint): joint for joint in dict.fromkeys(cell["joint"] for cell in cells)}

    def panels(joint: str) -> tuple[Panel, ...]:
        own = [cell for cell in cells if cell["joint"] == joint]
        x, y = "friction / % of stall torque", "bandwidth / Hz"
        marks = tuple(("y", one.bandwidth_hz, f"printed {one.label}") for one in drawn_models(joint).values())
        return tuple(
            Panel(x, y, _curves(own, motion), f"{MRAD * motion:.3g} mrad", "xy", None, BANDWIDTHS, marks)
            for motion in sorted({cell["gain"] * cell["volts"] for cell in own})
        )

    return Chart(by_view(panels, joints), columns=3, height=240)


def motion_map(cells: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw the map of all joints as one figure, for files; see `motion_chart`."""
    chart = motion_chart(cells)
    views = ((joint, panel) for (joint,), panels in chart.views.items() for panel in panels)
    return draw([replace(panel, title=f"{joint}, {panel.title}") for joint, panel in views], chart.columns)


def _curves(cells: Sequence[Mapping[str, Any]], motion: float) -> tuple[Series, ...]:
    rows = sorted((cell for cell in cells if cell["gain"] * cell["volts"] == motion), key=lambda cell: cell["friction"])
    return tuple(
        Series(
            method.upper(),
            [100 * cell["friction"] for cell in rows],
            [float("nan" if (hz := cell.get(f"{method}_bandwidth_hz")) is None else hz) for cell in rows],
            Style(PALETTE[method].colour, "-", 1.6),
        )
        for method in METHODS
    )
