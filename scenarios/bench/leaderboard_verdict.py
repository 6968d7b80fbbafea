"""Verdicts of the test bench in four words, and the words of the leaderboard: guides to metrics, rules, captions."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from scenarios.bench.metric import Metric, Part
from scenarios.bench.result import Result
from scenarios.files.codec import structure
from scenarios.files.toml_file import read_toml


class Verdict(Enum):
    """A verdict: its word, the sign that tells it apart without colour, its marker in drawings; from good to bad."""

    PASSES = ("passes", "✓", "o")
    FAILS_AS_THEORY_SAYS = ("fails as theory says", "△", "^")
    NONE = ("no verdict", "–", "o")
    FAILS = ("fails", "✗", "X")

    def __init__(self, word: str, sign: str, marker: str) -> None:
        self.word, self.sign, self.marker = word, sign, marker


def verdict(metric: Metric | None) -> Verdict:
    """The verdict of a metric: a part that fails where theory expects it to pass outweighs all others.

    Args:
        metric: The metric; None where the run has none of it.
    """
    if metric is None:
        return Verdict.NONE
    if metric.passed is False or any(part.surprises for part in metric.parts):
        return Verdict.FAILS
    if any(part.passed is False for part in metric.parts):
        return Verdict.FAILS_AS_THEORY_SAYS
    return Verdict.NONE if metric.passed is None else Verdict.PASSES


def part_verdict(part: Part) -> Verdict:
    """The verdict of a part of a metric."""
    if part.passed is None:
        return Verdict.NONE
    if part.passed:
        return Verdict.PASSES
    return Verdict.FAILS if part.theory else Verdict.FAILS_AS_THEORY_SAYS


def count(metrics: Iterable[Metric | None]) -> dict[Verdict, int]:
    """The number of metrics with each verdict."""
    counts = dict.fromkeys(Verdict, 0)
    for metric in metrics:
        counts[verdict(metric)] += 1
    return counts


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


def _read_words(file_name: str) -> dict[str, Any]:
    return read_toml(Path(__file__).with_name(file_name).read_text(encoding="utf-8"), file_name)


GUIDE: Mapping[str, MetricGuide] = structure(dict[str, MetricGuide], _read_words("metric_guide.toml"))
"""Guides by name of the metric, in the order of the page."""

WORDS: Mapping[str, Mapping[str, str]] = _read_words("leaderboard.toml")
"""Rules, captions and conditions of the leaderboard."""

INFORMATIVE = ("bandwidth",)
"""Metrics that never give a verdict."""


def judged_metrics(results: Iterable[Result]) -> tuple[str, ...]:
    """Names of the metrics by which rows are compared: all that give verdicts, whether a row has them or not.

    Args:
        results: Of all rows; metrics that they judge and this version does not know count too.
    """
    # Results of another version of the bench may have metrics of other names.
    unknown: set[str] = set()
    for result in results:
        for name in result.metrics.keys() - GUIDE.keys():
            if verdict(result.metrics[name]) is not Verdict.NONE:
                unknown.add(name)
    return (*(name for name in GUIDE if name not in INFORMATIVE), *sorted(unknown))
