"""Report section on model reference control: the package's record of `hmtb control` as tables and a chart."""

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

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


def control_section(_: object) -> dict[str, Any]:
    """Return the variables of the section's template; the study itself takes no part."""
    record = read_control()
    return {**record, "scenarios": dict.fromkeys(row["scenario"] for row in record["runs"])}


def control_chart() -> Chart:
    """Root mean square error of every joint without control and with each method, by scenario."""
    record = read_control()
    methods = dict(zip(record["methods"], LAWS, strict=False))

    def panels(scenario: str) -> tuple[Panel, ...]:
        rows = [row for row in record["runs"] if row["scenario"] == scenario]
        runs = [(WITHOUT_LABEL, WITHOUT, rows[0]["joints"], "rmse_without")]
        runs += [(row["method"], methods[row["method"]], row["joints"], "rmse_with") for row in rows]
        series = []
        for label, style, joints, key in runs:
            # A run that failed has no errors.
            errors = MRAD * np.array([joints[joint][key] for joint in CONTROLLED], dtype=float)
            marks = Style(style.colour, "", style.width, style.marker)
            series.append(Series(label, [short(joint) for joint in CONTROLLED], errors, marks))
        return (Panel("joint", "rms error / mrad", series, log="y"),)

    return Chart(by_view(panels, {name: name for name in control_section(None)["scenarios"]}), ("Run",))
