"""A chart whose views a record may not all give: those that it does, and why not the others."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

from scenarios.files.errors import ScenarioError
from scenarios.report.chart import Chart, Panel
from sysid import SysidError

SECONDS = "time / s"


@dataclass(frozen=True, eq=False)
class Drawing:
    """A chart and what it lacks.

    Attributes:
        chart: The chart; without views where a record gives none.
        reasons: Why views are missing, a line each.
    """

    chart: Chart
    reasons: tuple[str, ...] = ()


def no_drawing(reason: str) -> Drawing:
    """Return an empty drawing that says why there is none."""
    return Drawing(Chart({}), (reason,))


def views_with_reasons(
    draw: Callable[..., tuple[Panel, ...]], choices: Mapping[str, Mapping[str, Any]], *, columns: int = 1, height: int
) -> Drawing:
    """Draw every combination of the options of some choices.

    Args:
        draw: Draws one view from one option of each choice; an error of the analyst's means that it cannot.
        choices: Options by their names, of every choice by its name.
        columns: Panels side by side.
        height: Height of a panel, pixels.
    """
    views: dict[tuple[str, ...], tuple[Panel, ...]] = {}
    # By reason: many views of one figure usually lack the same.
    lacking: dict[str, list[str]] = {}
    for combination in product(*(options.items() for options in choices.values())):
        names = tuple(name for name, _ in combination)
        try:
            views[names] = draw(*(option for _, option in combination))
        # A record of three joints has 27 views of some figures: one that fails must not cost the others.
        except (SysidError, ScenarioError) as error:
            lacking.setdefault(str(error), []).append(", ".join(names))
    reasons = []
    # Where no view is left the reason needs no names: it is that of the whole figure.
    for reason, views_without in lacking.items():
        reasons.append(reason if not views else f"{'; '.join(views_without)}: {reason}")
    return Drawing(Chart(views, tuple(choices), columns, height), tuple(reasons))
