"""The leaderboard: result files, read, checked and put in order."""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, isnan, nan
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.bench.bandwidth import bandwidth_classes
from scenarios.bench.leaderboard_words import GUIDE
from scenarios.bench.metric import NEVER_JUDGED, Metric, Part, Verdict
from scenarios.bench.result import Result, metrics_of_any
from scenarios.files.errors import DAMAGE, ScenarioError

MOST_NAMED = 6
"""Problems that are named in a sentence; more are counted."""

Curve = dict[str, np.ndarray]
"""Arrays by name, those with dimensions equally long."""

_RESPONSES = ("frequencies_hz", "truth", "error", "claimed", "bound")
_SHARES = ("mrad", "systematic", "noise", "distortion", "systematic_limit", "expected_noise", "expected_distortion")
_INTERVALS = ("systematic_interval", "noise_interval", "distortion_interval")

CURVES: Mapping[str, Mapping[str, int]] = {
    "frequency_response": dict.fromkeys(_RESPONSES, 3) | {"frequencies_hz": 1, "relative_error_percent": 0},
    "amplitude_split": dict.fromkeys(_SHARES, 1) | dict.fromkeys(_INTERVALS, 2),
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
        curves: Numbers of drawings by metric and by problem or joint.
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

    def verdict(self, name: str) -> Verdict:
        """The verdict of one of its metrics."""
        metric = self.metric(name)
        return Verdict.NONE if metric is None else metric.verdict

    def verdicts(self, names: Iterable[str]) -> Counter[Verdict]:
        """Count the metrics of these names by verdict."""
        return Counter(map(self.verdict, names))

    def parts(self, name: str) -> Sequence[Part]:
        """Parts of one of its metrics; none where it lacks the metric."""
        metric = self.metric(name)
        return () if metric is None else metric.parts

    def response_errors(self) -> dict[str, float]:
        """Relative rms error of the frequency response by problem, percent."""
        curves = self.curves["frequency_response"]
        errors = {problem: float(curve["relative_error_percent"]) for problem, curve in curves.items()}
        return {problem: error for problem, error in errors.items() if 0.0 < error < inf}

    def answered_errors(self) -> dict[str, float]:
        """Response errors of problems on which at least half of the records, and two, gave a model."""
        # Efficiency gives no verdict where fewer records have a model.
        unjudged = [metric_part for metric_part in self.parts("efficiency") if metric_part.passed is None]
        too_few = {metric_part.label for metric_part in unjudged if metric_part.draws}
        return {problem: error for problem, error in self.response_errors().items() if problem not in too_few}

    def unanswered(self, problems: Iterable[str]) -> tuple[str, ...]:
        """Those of the problems that it did not answer; none for a row without the metric."""
        if self.metric("frequency_response") is None:
            return ()
        errors = self.answered_errors()
        return tuple(problem for problem in problems if problem not in errors)

    def median_error(self, problems: Sequence[str]) -> float:
        """Median response error over the problems, percent; NaN where it did not answer all of them."""
        if not problems:
            return nan
        errors = self.answered_errors()
        return float(np.median([errors.get(problem, nan) for problem in problems]))


@dataclass(frozen=True)
class Leaderboard:
    """Estimators, compared.

    Attributes:
        rows: The estimators, at least one.
    """

    rows: Sequence[LeaderboardRow]

    @cached_property
    def metrics(self) -> dict[str, Metric]:
        """All metrics that any row has, as the first row with them has them: those of this version, then others."""
        first = metrics_of_any(row.result for row in self.rows)
        known = [name for name in GUIDE if name in first]
        return {name: first[name] for name in (*known, *sorted(first.keys() - GUIDE.keys()))}

    @cached_property
    def judged(self) -> tuple[str, ...]:
        """Names of the metrics by which rows are compared: all that give verdicts, whether a row has them or not."""
        known = [name for name in GUIDE if name not in NEVER_JUDGED]
        return (*known, *(name for name in self.metrics if name not in GUIDE and self.is_judged(name)))

    def is_judged(self, name: str) -> bool:
        """Whether any row has a verdict on a metric."""
        return any(row.verdict(name) is not Verdict.NONE for row in self.rows)

    def false_alarm(self, name: str) -> float:
        """Probability that a perfect estimator fails a metric, the largest of all rows."""
        metrics = [row.result.metrics[name] for row in self.rows if row.metric(name) is not None]
        return max(metric.false_alarm for metric in metrics)

    @cached_property
    def problems(self) -> tuple[str, ...]:
        """Problems by whose response errors rows are compared: those that were put to all rows with this metric.

        The problems put to a row count, not those that it answered: else an estimator that answers only easy ones
        would have the better median, or take hard ones away from the others.
        """
        measured: set[str] = set()
        for row in self.rows:
            measured |= row.response_errors().keys()
        posed_by_row = []
        for row in self.rows:
            # Parts also name problems that it did not answer.
            labels = [metric_part.label for metric_part in row.parts("frequency_response")]
            posed = [problem for problem in dict.fromkeys((*labels, *row.response_errors())) if problem in measured]
            if posed:
                posed_by_row.append(posed)
        if not posed_by_row:
            return ()
        common = set.intersection(*map(set, posed_by_row))
        return tuple(problem for problem in posed_by_row[0] if problem in common)

    def problems_in_words(self) -> str:
        """The problems by whose response errors rows are compared, in a sentence."""
        return ", ".join(self.problems) if len(self.problems) <= MOST_NAMED else f"{len(self.problems)} of them"

    def sorting_key(self, row: LeaderboardRow) -> tuple[int, int, int, float, str]:
        """The sorting key that `RULE` describes."""
        counts = row.verdicts(self.judged)
        unjudged = counts[Verdict.NONE]
        # An estimator may lack a time without harm: what is timed is no matter of its models.
        if row.verdict("speed") is Verdict.NONE:
            unjudged -= 1
        # Rows without a value of efficiency stand behind those with one.
        efficiency = row.metric("efficiency")
        variance = inf if efficiency is None or isnan(efficiency.value) else efficiency.value
        return counts[Verdict.FAILS], unjudged, -counts[Verdict.PASSES], variance, row.name


def ranked(paths: Iterable[Path]) -> Leaderboard:
    """Read results of the test bench and rank the estimators.

    Args:
        paths: Files, or folders of which all `*.json` are read.

    Raises:
        ScenarioError: There is none, one is no result, or two have the same name.
    """
    rows: dict[str, LeaderboardRow] = {}
    for path in _result_files(paths):
        row = _read(path)
        if row.name in rows:
            raise ScenarioError(
                f"{path} and {rows[row.name].path} are both of {row.name!r}; expected a name for each: leave one out, "
                "or run it again under another name"
            )
        # Tables and drawings call estimators by their names.
        rows[row.name] = row
    unordered = Leaderboard(tuple(rows.values()))
    ordered = sorted(unordered.rows, key=unordered.sorting_key)
    return Leaderboard(tuple(replace(row, number=number) for number, row in enumerate(ordered, 1)))


def _result_files(paths: Iterable[Path]) -> Collection[Path]:
    """Files, those of folders included, each once."""
    files: dict[Path, None] = {}
    for path in paths:
        results = sorted(path.glob("*.json")) if path.is_dir() else [path]
        if not results:
            raise ScenarioError(f"folder {path} given, expected one with results of hmtb verify in it (*.json)")
        files |= dict.fromkeys(results)
    if not files:
        raise ScenarioError("no result given; expected files that hmtb verify wrote, such as results/*.json")
    return files


def _read(path: Path) -> LeaderboardRow:
    """Read a result and check its curves: anyone may have written the file."""
    result = Result.read(path)
    curves = {}
    for name in (*CURVES, "bandwidth"):
        try:
            curves[name] = _curves(result, name)
        except DAMAGE as error:
            why = f"the numbers for drawing {name} are damaged ({error})"
            raise ScenarioError(f"{path} is no result of hmtb verify: {why}") from error
    return LeaderboardRow(0, result, path, curves)


def _curves(result: Result, name: str) -> dict[str, Curve]:
    """Read the curves of a metric by problem or joint; of bandwidths, which are drawn from parts, only check them."""
    if name == "bandwidth":
        bandwidth_classes(result.metrics)
        return {}
    tables = result.metrics[name].curves if name in result.metrics else {}
    return {str(label): _arrays(table, CURVES[name]) for label, table in tables.items()}


def _arrays(table: Any, dimensions: Mapping[str, int]) -> Curve:
    """The arrays of one table for a drawing, checked as far as the drawing relies on them."""
    arrays: Curve = {}
    for name, expected in dimensions.items():
        if name in MAY_LACK and table[name] is None:
            continue
        arrays[name] = np.array(table[name], dtype=float)  # null becomes NaN
        if arrays[name].ndim != expected:
            raise ValueError(f"{name} has {arrays[name].ndim} dimensions, expected {expected}")
    if len({len(array) for array in arrays.values() if array.ndim}) > 1:
        raise ValueError("its arrays differ in length")
    axis = next(iter(dimensions))
    if not (arrays[axis] > 0.0).all():
        raise ValueError(f"{axis} has numbers that are not above 0")
    return arrays
