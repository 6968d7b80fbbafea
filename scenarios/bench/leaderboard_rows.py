"""Rows of the leaderboard: result files, read, checked and put in order."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isnan, nan
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.bench.leaderboard_verdict import WORDS, Verdict, count, judged_metrics
from scenarios.bench.metric import Metric
from scenarios.bench.result import Result
from scenarios.files.errors import ScenarioError

RULE, ORDERS_GIVEN = WORDS["rules"]["order"], WORDS["rules"]["orders_given"]

MOST_BYTES = 2**26
"""Result files are far smaller; an endless or foreign file is not read."""

MOST_NAMED = 6
"""Problems that are named in a sentence; more are counted."""

Curve = dict[str, np.ndarray]
"""Arrays by name, those with dimensions equally long."""

CURVES: Mapping[str, Mapping[str, int]] = {
    "frequency_response": {
        **{"frequencies_hz": 1, "truth": 3, "error": 3, "claimed": 3, "bound": 3},
        "relative_error_percent": 0,
    },
    "amplitude_split": {
        **{"mrad": 1, "systematic": 1, "noise": 1, "distortion": 1},
        **{"systematic_limit": 1, "expected_noise": 1, "expected_distortion": 1},
        **{"systematic_interval": 2, "noise_interval": 2, "distortion_interval": 2},
    },
    "bandwidth": {"mrad": 0, "hz": 1, "models": 0, "small_signal": 0, "best_linear": 0},
}
"""Numbers that drawings need, with their dimensions, by metric; the first is an axis, whose numbers are positive."""

MAY_LACK = ("claimed", "bound")
"""Curves that are null where an estimator claims nothing and where there is no bound."""


@dataclass(frozen=True)
class LeaderboardRow:
    """An estimator on the leaderboard.

    Attributes:
        number: Its place, from 1; drawings name it by that.
        result: Its result.
        path: File of the result.
        curves: Numbers of drawings by metric and by problem, or for bandwidths by joint and excitation.
    """

    number: int
    result: Result
    path: Path
    curves: Mapping[str, Mapping[str, Curve]]

    @property
    def name(self) -> str:
        """The estimator's name."""
        return self.result.estimator.name

    @property
    def title(self) -> str:
        """Number and name."""
        return f"{self.number} {self.name}"

    @property
    def mark(self) -> str:
        """Its anchor on the page."""
        return f"estimator-{self.number}"

    def metric(self, name: str) -> Metric | None:
        """One of its metrics, or None."""
        return self.result.metrics.get(name)

    def response_errors(self) -> dict[str, float]:
        """Relative rms error of the frequency response by problem, percent."""
        curves = self.curves["frequency_response"]
        errors = {name: float(curve["relative_error_percent"]) for name, curve in curves.items()}
        return {name: error for name, error in errors.items() if 0.0 < error < inf}

    def answered_errors(self) -> dict[str, float]:
        """Response errors of problems on which at least half of the records, and two, gave a model."""
        efficiency = self.metric("efficiency")
        # Values without a verdict are of too few records.
        few = {part.label for part in efficiency.parts if part.passed is None and part.draws} if efficiency else set()
        return {name: error for name, error in self.response_errors().items() if name not in few}

    def unanswered(self, problems: Iterable[str]) -> tuple[str, ...]:
        """Those of the problems that it did not answer; none for a row without the metric."""
        errors = self.answered_errors()
        return tuple(name for name in problems if name not in errors) if self.metric("frequency_response") else ()

    def median_error(self, problems: Sequence[str]) -> float:
        """Median response error over the problems, percent; NaN where it did not answer all of them."""
        errors = self.answered_errors()
        return float(np.median([errors.get(name, nan) for name in problems])) if problems else nan


def common_problems(rows: Sequence[LeaderboardRow]) -> tuple[str, ...]:
    """Problems by whose response errors rows are compared: those that were put to all rows with this metric.

    The problems put to a row count, not those that it answered: else an estimator that answers only easy ones would
    have the better median, or take hard ones away from the others.
    """
    known = {name for row in rows for name in row.response_errors()}
    posed = []
    for row in rows:
        metric = row.metric("frequency_response")
        labels = [part.label for part in metric.parts] if metric else []  # also of problems that it did not answer
        if problems := [name for name in dict.fromkeys((*labels, *row.response_errors())) if name in known]:
            posed.append(problems)
    return tuple(name for name in posed[0] if all(name in problems for problems in posed)) if posed else ()


def listed(problems: Sequence[str]) -> str:
    """Problems in a sentence."""
    return ", ".join(problems) if len(problems) <= MOST_NAMED else f"{len(problems)} of them"


def ranked(paths: Iterable[Path]) -> tuple[LeaderboardRow, ...]:
    """Read results and put them in order.

    Args:
        paths: Files, or folders of which all `*.json` are read.

    Raises:
        ScenarioError: There is none, one is no result, or two have the same name.
    """
    files: dict[Path, None] = {}
    for path in paths:
        inside = sorted(path.glob("*.json")) if path.is_dir() else [path]
        if not inside:
            raise ScenarioError(f"folder {path} given, expected one with results of hmtb verify in it (*.json)")
        files |= dict.fromkeys(inside)
    if not files:
        raise ScenarioError("no result given; expected files that hmtb verify wrote, such as results/*.json")
    by_name: dict[str, LeaderboardRow] = {}
    for row in map(_read, files):
        if (other := by_name.setdefault(row.name, row)) is not row:
            raise ScenarioError(
                f"{row.path} and {other.path} are both of {row.name!r}; expected a name for each: leave one out, "
                "or run it again under another name"
            )
    judged = judged_metrics(row.result for row in by_name.values())
    ordered = sorted(by_name.values(), key=lambda row: _key(row.result, judged))
    return tuple(replace(row, number=number) for number, row in enumerate(ordered, 1))


def _key(result: Result, judged: Collection[str]) -> tuple[int, int, int, float, str]:
    """The sorting key that RULE describes."""
    counts = count(map(result.metrics.get, judged))
    # An estimator may lack a time without harm: what is timed is no matter of its models.
    unjudged = count(result.metrics.get(name) for name in judged if name != "speed")[Verdict.NONE]
    metric = result.metrics.get("efficiency")
    efficiency = inf if metric is None or isnan(metric.value) else metric.value
    return counts[Verdict.FAILS], unjudged, -counts[Verdict.PASSES], efficiency, result.estimator.name


def _read(path: Path) -> LeaderboardRow:
    foreign = f"{path} is no result of hmtb verify"
    if path.exists() and not path.is_file():
        raise ScenarioError(f"{foreign}: it is no ordinary file")
    if path.is_file() and path.stat().st_size > MOST_BYTES:
        raise ScenarioError(f"{foreign}: it has more than {MOST_BYTES} bytes")
    result = Result.read(path)
    metrics = result.metrics.values()
    counts = [*result.outcomes.values(), *result.reasons.values(), *result.refused.values()]
    if min(*counts, *(part.draws for metric in metrics for part in metric.parts), 0) < 0:
        raise ScenarioError(f"{foreign}: a number of requests or records is below 0")
    if rates := [metric.false_alarm for metric in metrics if not 0.0 <= metric.false_alarm <= 1.0]:
        raise ScenarioError(f"{foreign}: false-alarm rates {rates} given, expected 0 to 1")
    curves: dict[str, dict[str, Curve]] = {}
    for name, dimensions in CURVES.items():
        try:
            tables = result.metrics[name].curves if name in result.metrics else {}
            if name == "bandwidth":
                tables = {entry["label"]: entry for entry in tables.get("classes", ())}
            curves[name] = {str(problem): _arrays(table, dimensions) for problem, table in tables.items()}
        except (TypeError, KeyError, ValueError, AttributeError) as error:
            raise ScenarioError(f"{foreign}: the numbers for drawing {name} are damaged ({error})") from error
    return LeaderboardRow(0, result, path, curves)


def _arrays(table: Any, dimensions: Mapping[str, int]) -> Curve:
    arrays = {
        name: np.array(table[name], dtype=float)  # null becomes NaN
        for name in dimensions
        if not (name in MAY_LACK and table[name] is None)
    }
    for name, array in arrays.items():
        if array.ndim != dimensions[name]:
            raise ValueError(f"{name} has {array.ndim} dimensions, expected {dimensions[name]}")
    if len({len(array) for array in arrays.values() if array.ndim}) > 1:
        raise ValueError("its arrays differ in length")
    if not (arrays[next(iter(dimensions))] > 0.0).all():
        raise ValueError(f"{next(iter(dimensions))} has numbers that are not above 0")
    return arrays
