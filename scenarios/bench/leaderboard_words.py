"""Words of the leaderboard: guides to metrics, rules, captions, and what follows where rows differ."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenarios.files.codec import structure
from scenarios.files.toml_file import read_toml


@dataclass(frozen=True)
class MetricGuide:
    """How to read a metric.

    Attributes:
        short: Heading of its column.
        measures: What it measures and when it passes.
        blind: What it cannot see.
    """

    short: str
    measures: str
    blind: str


def guide_to(metric: str) -> MetricGuide:
    """The guide to a metric; results of another version of the bench may have metrics that this one does not know."""
    unknown = MetricGuide(metric.replace("_", " "), "This version of the page does not know this figure.", "")
    return GUIDE.get(metric, unknown)


def _read_words(file_name: str) -> dict[str, Any]:
    return read_toml(Path(__file__).with_name(file_name).read_text(encoding="utf-8"), file_name)


GUIDE: Mapping[str, MetricGuide] = structure(dict[str, MetricGuide], _read_words("metric_guide.toml"))
"""How to read each metric, by its name, in the order of the page."""

_WORDS: Mapping[str, Mapping[str, str]] = _read_words("leaderboard.toml")

RULE, ORDERS_GIVEN = _WORDS["rules"]["order"], _WORDS["rules"]["orders_given"]

CAPTIONS = _WORDS["captions"]
"""Captions of tables and drawings."""

CONDITIONS = _WORDS["conditions"]
"""Settings that two rows must share to compare, with what follows where they differ."""
