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
from scenarios.report.chart import Chart, Panel, Series, by_view
from scenarios.report.chart_drawing import draw
from scenarios.report.figure_style import MRAD, short
from scenarios.report.page import Page
from scenarios.thesis.answer import drawn_models
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
        # Python would read NaN and Infinity, which JSON does not have.
        record = json.loads(source.read_text(encoding="utf-8"), parse_constant=_refuse)
        # Everything is made of it once, so that a damaged file fails here and not after minutes of simulation.
        motion_texts(record)
        Page({"words": str}).render("motion.html.j2", {"motion": record, "motion_sentences": (), "figures": {}})
        for cell in record["map"]:
            # Logarithmic axes show neither of these at zero.
            smallest = min(cell[name] for name in ("gain", "friction", "volts"))
            if not (drawn_models(cell["joint"]) and smallest > 0.0):
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
    # In the order of the record, each once.
    joints = {short(cell["joint"]): cell["joint"] for cell in cells}

    def panels(joint: str) -> tuple[Panel, ...]:
        """A panel for each amplitude of the command."""
        of_joint = [cell for cell in cells if cell["joint"] == joint]
        x, y = "friction / % of stall torque", "bandwidth / Hz"
        marks = tuple(("y", model.bandwidth_hz, f"printed {model.label}") for model in drawn_models(joint).values())
        drawn = []
        for motion in sorted({cell["gain"] * cell["volts"] for cell in of_joint}):
            title = f"{MRAD * motion:.3g} mrad"
            drawn.append(Panel(x, y, _curves(of_joint, motion), title, "xy", None, BANDWIDTHS, marks))
        return tuple(drawn)

    return Chart(by_view(panels, joints), columns=3, height=240)


def motion_map(cells: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw the map of all joints as one figure, for files; see `motion_chart`."""
    chart = motion_chart(cells)
    titled = []
    for (joint,), panels in chart.views.items():
        titled += [replace(panel, title=f"{joint}, {panel.title}") for panel in panels]
    return draw(titled, chart.columns, name_marks=True)


def _curves(cells: Sequence[Mapping[str, Any]], motion: float) -> tuple[Series, ...]:
    """Bandwidth over friction by each method, of the cells whose command moves the joint by this much, rad."""
    same_motion = [cell for cell in cells if cell["gain"] * cell["volts"] == motion]
    same_motion.sort(key=lambda cell: cell["friction"])
    friction_percent = [100 * cell["friction"] for cell in same_motion]
    curves = []
    for method in METHODS:
        bandwidths = []
        for cell in same_motion:
            hz = cell.get(f"{method}_bandwidth_hz")
            # Null or missing where most records have none: the curve has a gap there.
            bandwidths.append(float("nan") if hz is None else float(hz))
        curves.append(Series(method.upper(), friction_percent, bandwidths, Style(PALETTE[method].colour, "-", 1.6)))
    return tuple(curves)
