"""Report section on model reference control: the package's record of `hmtb control` as tables and a chart."""

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from scenarios.control.campaign import CONTROLLED
from scenarios.control.figures import LAWS, WITHOUT, WITHOUT_LABEL
from scenarios.report.figure_style import MRAD, short
from scenarios.thesis.chart import Chart, Panel, Series, by_view
from sysid.plots import Style


@cache
def read_control() -> Mapping[str, Any]:
    """Return the record: `runs` and `stress` of `hmtb control`, made by docs/images/control.py."""
    record: dict[str, Any] = json.loads((files("scenarios") / "data" / "control.json").read_text(encoding="utf-8"))
    return record


def control_section(_: object) -> dict[str, object]:
    """Return the variables of the section's template; the study itself takes no part."""
    record = read_control()
    return {**record, "scenarios": dict.fromkeys(row["scenario"] for row in record["runs"])}


def control_chart() -> Chart:
    """Root mean square error of every joint without control and with each method, by scenario."""
    record = read_control()
    methods = dict(zip(record["methods"], LAWS, strict=False))

    def panels(scenario: str) -> tuple[Panel, ...]:
        rows = {row["method"]: row["joints"] for row in record["runs"] if row["scenario"] == scenario}
        first = next(iter(rows.values()))
        errors = {WITHOUT_LABEL: ([first[joint]["rmse_without"] for joint in CONTROLLED], WITHOUT)}
        errors |= {
            name: ([own[joint]["rmse_with"] for joint in CONTROLLED], methods[name]) for name, own in rows.items()
        }
        series = tuple(
            Series(name, [short(joint) for joint in CONTROLLED], [MRAD * one for one in values], _marks(style))
            for name, (values, style) in errors.items()
        )
        return (Panel("joint", "rms error / mrad", series, log="y"),)

    names = dict.fromkeys(row["scenario"] for row in record["runs"])
    return Chart(by_view(panels, dict(zip(names, names, strict=True))), ("Run",))


def _marks(style: Style) -> Style:
    return Style(style.colour, "", style.width, style.marker)
