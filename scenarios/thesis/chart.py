"""Charts of the study: functions that draw one view become charts of all views."""

from collections.abc import Callable, Mapping
from functools import partial, wraps
from typing import Any

from scenarios.report.chart import Chart, Panel, by_view
from scenarios.report.figure_style import short
from scenarios.thesis.comparison import Comparison, JointResult


def joints(study: Comparison) -> dict[str, JointResult]:
    """Results of the joints by their names in figures: the options of a chart's choice of joint."""
    return {short(name): result for name, result in study.joints.items()}


def chart_of(
    choices: Mapping[str, Mapping[str, Any] | Callable[[Comparison], Mapping[str, Any]]], **layout: int
) -> Callable[[Callable[..., tuple[Panel, ...]]], Callable[[Comparison], Chart]]:
    """Make a chart of a function that draws one view from the study and one option of each choice.

    The options of a choice are a table by name, or a function that takes it from the study.
    """

    def decorated(draw: Callable[..., tuple[Panel, ...]]) -> Callable[[Comparison], Chart]:
        @wraps(draw)
        def chart(study: Comparison) -> Chart:
            options = []
            for table in choices.values():
                options_of_choice = table(study) if callable(table) else table
                options.append(options_of_choice)
            return Chart(by_view(partial(draw, study), *options), tuple(choices), **layout)

        return chart

    return decorated
