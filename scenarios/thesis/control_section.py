"""Report section on model reference control: recorded results of `hmtb control` as tables and a chart."""

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from scenarios.control.campaign import CONTROLLED
from scenarios.control.figures import LAWS, WITHOUT, WITHOUT_LABEL
from scenarios.report.chart import Chart, Panel, Series, by_view
from scenarios.report.figure_style import MRAD, short
from sysid.plots import Style


@cache
def read_control() -> Mapping[str, Any]:
    """Return the record: `runs` and `stress` of `hmtb control`, made by docs/images/control.py."""
    record: dict[str, Any] = json.loads((files("scenarios") / "data" / "control.json").read_text(encoding="utf-8"))
    return record


def control_section(_: object) -> dict[str, Any]:
    """Return the variables of the section's template; the study itself takes no part."""
    return {**read_control(), "scenarios": _scenario_names()}


def _scenario_names() -> dict[str, str]:
    """Names of the recorded scenarios, each once, in the order of the record: choice and label are the same."""
    return {run["scenario"]: run["scenario"] for run in read_control()["runs"]}


def control_chart() -> Chart:
    """Root mean square error of every joint without control and with each method, by scenario."""
    return Chart(by_view(_scenario_panels, _scenario_names()), ("Run",))


def _scenario_panels(scenario: str) -> tuple[Panel, ...]:
    """Panel of one scenario: errors without control, then with each method, joint by joint."""
    record = read_control()
    # There may be more styles than methods in the record.
    styles = dict(zip(record["methods"], LAWS, strict=False))
    runs = [run for run in record["runs"] if run["scenario"] == scenario]
    # Every run of a scenario has the same errors without control.
    series = [_error_marks(WITHOUT_LABEL, WITHOUT, runs[0]["joints"], "rmse_without")]
    for run in runs:
        series.append(_error_marks(run["method"], styles[run["method"]], run["joints"], "rmse_with"))
    return (Panel("joint", "rms error / mrad", series, log="y"),)


def _error_marks(label: str, style: Style, errors_by_joint: Mapping[str, Any], key: str) -> Series:
    """Marks at the errors of the controlled joints, mrad: those of a run under `key`, rad."""
    # A run that failed has no errors: the type turns its None into NaN, which is not drawn.
    errors = MRAD * np.array([errors_by_joint[joint][key] for joint in CONTROLLED], dtype=float)
    marks = Style(style.colour, "", style.width, style.marker)
    return Series(label, [short(joint) for joint in CONTROLLED], errors, marks)
