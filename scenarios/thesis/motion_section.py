"""Map of the motion campaign: recovered bandwidth over friction and motion, with the printed models marked."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from matplotlib.figure import Figure

from scenarios.report.figure_style import MRAD, short
from scenarios.thesis.answer import METHODS, drawn_models
from scenarios.thesis.chart import Chart, Panel, Series, by_view, draw
from sysid.plots import PALETTE, Style


def motion_chart(cells: Sequence[Mapping[str, Any]]) -> Chart:
    """Bandwidth that the methods recover over friction and motion, with the printed models marked.

    Args:
        cells: Those of the map of `motion.json`: one joint, gain, friction and amplitude each.
    """
    joints = {short(joint): joint for joint in dict.fromkeys(cell["joint"] for cell in cells)}

    def panels(joint: str) -> tuple[Panel, ...]:
        own = [cell for cell in cells if cell["joint"] == joint]
        motions = sorted({cell["gain"] * cell["volts"] for cell in own})
        marks = tuple(("y", one.bandwidth_hz, f"printed {one.label}") for one in drawn_models(joint).values())
        return tuple(
            Panel(
                "friction / % of stall torque", "bandwidth / Hz", _curves(own, motion), title, "xy", None, None, marks
            )
            for motion in motions
            for title in [f"{MRAD * motion:.3g} mrad"]
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
            [float("nan") if (hz := cell.get(f"{method}_bandwidth_hz")) is None else hz for cell in rows],
            Style(PALETTE[method].colour, "-", 1.6),
        )
        for method in METHODS
    )
