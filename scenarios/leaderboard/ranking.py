"""The order of estimators on the page. No score is made of several figures."""

import math
from collections.abc import Iterable
from pathlib import Path

from scenarios.bench_run.result import Result
from scenarios.leaderboard.entry import Entry, read_results, shown
from scenarios.leaderboard.verdict import Verdict, count

RULE = (
    "Rows are ordered by the number of figures that fail where theory expects them to pass, the fewest first; then by "
    "the number of figures passed; then by the number that stands for efficiency, the smallest first; then by name. "
    "No score is made of several figures: which of them matters depends on what the model is for."
)


def ranked(paths: Iterable[Path]) -> tuple[Entry, ...]:
    """Read results and put them in order.

    Args:
        paths: See `read_results`.

    Raises:
        ScenarioError: There is none, one is no result, or two are of the same name.
    """
    ordered = sorted(read_results(paths), key=lambda found: _key(found[1]))
    return tuple(Entry(number, result, path) for number, (path, result) in enumerate(ordered, 1))


def _key(result: Result) -> tuple[int, int, float, str]:
    found = count(result.figures.values())
    efficiency = result.figures.get("efficiency")
    worst = math.nan if efficiency is None else efficiency.value
    worst = math.inf if math.isnan(worst) else worst
    return (found[Verdict.FAILS], -found[Verdict.PASSES], worst, shown(result.contestant.name))
