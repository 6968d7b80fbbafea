"""Rows of the leaderboard: result files, read, checked and put in order."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from math import inf, isnan, nan
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np

from scenarios.bench.leaderboard_verdict import Verdict, count, judged_metrics
from scenarios.bench.metric import Metric
from scenarios.bench.result import Result
from scenarios.files.errors import ScenarioError
from scenarios.files.printable import one_line

RULE = (
    "Rows are ordered by the number of figures that fail where theory expects them to pass, the fewest first; then by "
    "the number of figures of the models without a verdict (all but time), the fewest first, so that nobody gains by "
    "what could not be judged: to fail as theory says is a verdict; then by the number of figures passed; then by the "
    "number that stands for efficiency, the smallest first; then by name. No score is made of several figures: which "
    "of them matters depends on what the model is for."
)

MOST_BYTES = 2**26
"""Result files are far smaller; an endless or foreign file is not read."""

LARGEST = 2**62
"""Limit of whole numbers in a result; JSON has none, and sums of larger ones overflow."""

LARGEST_DRAWN = 1e100
"""Limit of numbers in a drawing and of their inverses: axes compute squares and products of them."""

MOST_NUMBERS = 100_000
"""Limit of numbers in a curve."""

MOST_NAMED = 6
"""Problems that are named in a sentence; more are counted."""


@dataclass(frozen=True)
class LeaderboardRow:
    """An estimator on the leaderboard.

    Attributes:
        number: Its place, from 1; drawings name it by that.
        result: Its result.
        path: File of the result.
    """

    number: int
    result: Result
    path: Path

    @property
    def name(self) -> str:
        """The estimator's name on one line."""
        return one_line(self.result.contestant.name)

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
        return self.result.figures.get(name)

    def curves(self, name: str) -> Mapping[str, Any]:
        """Numbers for drawing a metric; empty where it has none."""
        metric = self.metric(name)
        return {} if metric is None else metric.curves

    def response_errors(self) -> dict[str, float]:
        """Relative rms error of the frequency response by problem, percent."""
        curves = self.curves("frequency_response")
        errors = {str(name): scalar(table, "relative_error_percent") for name, table in curves.items()}
        return {name: error for name, error in errors.items() if error > 0.0}

    def answered_errors(self) -> dict[str, float]:
        """Those of problems on which at least half of the records, and two, gave a model."""
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
    posed = [problems for row in rows if (problems := _posed(row, known))]
    return tuple(name for name in posed[0] if all(name in problems for problems in posed)) if posed else ()


def _posed(row: LeaderboardRow, known: Collection[str]) -> tuple[str, ...]:
    metric = row.metric("frequency_response")
    labels = [part.label for part in metric.parts] if metric else []  # unanswered problems are parts without a value
    return tuple(dict.fromkeys(name for name in (*labels, *row.response_errors()) if name in known))


def listed(problems: Sequence[str]) -> str:
    """Problems in a sentence."""
    return ", ".join(map(one_line, problems)) if len(problems) <= MOST_NAMED else f"{len(problems)} of them"


def numbers(value: Any, dimensions: int = 1) -> np.ndarray | None:
    """An array of numbers from a result file; None where the value is no array of so many dimensions.

    Unknown numbers are NaN, and so are those that no axis can hold.
    """
    if not isinstance(value, list | tuple) or not value:
        return None
    try:
        array = np.array(value, dtype=float)  # null becomes NaN
    except (TypeError, ValueError, OverflowError):
        return None
    array[~drawable(array)] = nan
    return array if array.ndim == dimensions and array.size <= MOST_NUMBERS else None


def drawable(values: np.ndarray | float) -> np.ndarray:
    """Whether an axis can hold them: finite, and neither huge nor, but for 0, tiny."""
    size = np.abs(values)
    return np.asarray((size == 0.0) | ((size >= 1.0 / LARGEST_DRAWN) & (size <= LARGEST_DRAWN)))


def scalar(table: Any, name: str) -> float:
    """A number by name from a result file; NaN where there is none that an axis can hold."""
    value = table.get(name) if isinstance(table, Mapping) else None
    array = None if isinstance(value, bool | str) else numbers([value])
    return nan if array is None else float(array[0])


def ranked(paths: Iterable[Path]) -> tuple[LeaderboardRow, ...]:
    """Read results and put them in order.

    Args:
        paths: Files, or folders of which all `*.json` are read.

    Raises:
        ScenarioError: There is none, one is no result, or two have the same name.
    """
    results = _results(paths)
    judged = judged_metrics(results.values())
    ordered = sorted(results.items(), key=lambda pair: _key(pair[1], judged))
    return tuple(LeaderboardRow(number, result, path) for number, (path, result) in enumerate(ordered, 1))


def _key(result: Result, judged: Collection[str]) -> tuple[int, int, int, float, str]:
    """The sorting key that RULE describes."""
    counts = count(map(result.figures.get, judged))
    # An estimator may lack a time without harm: what is timed is no matter of its models.
    unjudged = count(result.figures.get(name) for name in judged if name != "speed")[Verdict.NONE]
    metric = result.figures.get("efficiency")
    efficiency = inf if metric is None or isnan(metric.value) else metric.value
    return counts[Verdict.FAILS], unjudged, -counts[Verdict.PASSES], efficiency, one_line(result.contestant.name)


def _results(paths: Iterable[Path]) -> dict[Path, Result]:
    files = dict.fromkeys(file for path in paths for file in _files(path))
    if not files:
        raise ScenarioError("no result given; expected files that hmtb verify wrote, such as results/*.json")
    results = {path: _read(path) for path in files}
    names: dict[str, Path] = {}
    for path, result in results.items():
        name = one_line(result.contestant.name)
        if name in names:
            raise ScenarioError(
                f"{path} and {names[name]} are both of {name!r}; expected a name for each: leave one out, "
                "or run it again under another name"
            )
        names[name] = path
    return results


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    files = sorted(path.glob("*.json"))
    if not files:
        raise ScenarioError(f"folder {path} given, expected one with results of hmtb verify in it (*.json)")
    return files


def _read(path: Path) -> Result:
    if path.exists() and not path.is_file():
        raise ScenarioError(f"{path} is no result of hmtb verify: it is no ordinary file")
    if path.is_file() and path.stat().st_size > MOST_BYTES:
        raise ScenarioError(f"{path} is no result of hmtb verify: it has more than {MOST_BYTES} bytes")
    result = Result.read(path)
    if fault := _fault(result):
        raise ScenarioError(f"{path} is no result of hmtb verify: {fault}")
    return result


def _fault(result: Result) -> str:
    """A wrong type or range in a file that anyone may have written; empty where there is none."""
    if fault := _wrong_type(result, Result, "the result"):
        return fault
    if not one_line(result.contestant.name):
        return f"name {result.contestant.name!r} has no character that can be seen"
    metrics = result.figures.values()
    counts = [*result.outcomes.values(), *result.reasons.values(), *result.refused.values()]
    if min(*counts, *(part.draws for metric in metrics for part in metric.parts), 0) < 0:
        return "a number of requests or records is below 0"
    rates = [metric.false_alarm for metric in metrics]
    return "" if all(0.0 <= rate <= 1.0 for rate in rates) else f"a false-alarm rate of {rates} is none from 0 to 1"


def _wrong_type(value: object, hint: Any, place: str) -> str:
    """A value of another type than its record declares, with its place; empty where there is none."""
    kinds = get_args(hint)
    inner: list[tuple[object, Any, str]] = []
    if is_dataclass(value) and type(value) is hint:
        hints = get_type_hints(hint)
        inner = [(getattr(value, one.name), hints[one.name], f"{place}, {one.name}") for one in fields(value)]
    elif get_origin(hint) is Mapping and isinstance(value, Mapping):
        inner = [(entry, kinds[1], f"{place}, {name}") for name, entry in value.items()]
    elif get_origin(hint) is tuple and isinstance(value, tuple):
        inner = [(entry, kinds[0], place) for entry in value]
    elif hint is not Any:
        allowed = kinds if get_origin(hint) is UnionType else (get_origin(hint) or hint,)
        fits = type(value) in allowed or (float in allowed and type(value) is int)
        if not fits or (isinstance(value, int) and abs(value) > LARGEST):
            return f"{place} is {str(value)[:80]!r}, expected {' or '.join(kind.__name__ for kind in allowed)}"
    return next(filter(None, (_wrong_type(*entry) for entry in inner)), "")
