"""The order of estimators on the page. No score is made of several figures."""

import math
from collections.abc import Collection, Iterable
from pathlib import Path

from scenarios.bench.leaderboard_entry import Entry, read_results
from scenarios.bench.leaderboard_verdict import Verdict, count, judged_figures
from scenarios.bench.result import Result
from scenarios.files.printable import one_line

RULE = (
    "Rows are ordered by the number of figures that fail where theory expects them to pass, the fewest first; then by "
    "the number of figures of the models without a verdict (all but time), the fewest first, so that nobody gains by "
    "what could not be judged: to fail as theory says is a verdict; then by the number of figures passed; then by the "
    "number that stands for efficiency, the smallest first; then by name. No score is made of several figures: which "
    "of them matters depends on what the model is for."
)

NOT_OF_MODELS = ("speed",)
"""Figures that may lack a verdict without harm: the perfect estimator has no time."""


def ranked(paths: Iterable[Path]) -> tuple[Entry, ...]:
    """Read results and put them in order.

    Args:
        paths: See `read_results`.

    Raises:
        ScenarioError: There is none, one is no result, or two are of the same name.
    """
    found = read_results(paths)
    judged = judged_figures(result for _, result in found)
    ordered = sorted(found, key=lambda pair: _key(pair[1], judged))
    return tuple(Entry(number, result, path) for number, (path, result) in enumerate(ordered, 1))


def _key(result: Result, judged: Collection[str]) -> tuple[int, int, int, float, str]:
    found = count(map(result.figures.get, judged))
    unjudged = count(result.figures.get(name) for name in judged if name not in NOT_OF_MODELS)[Verdict.NONE]
    efficiency = result.figures.get("efficiency")
    worst = math.nan if efficiency is None else efficiency.value
    worst = math.inf if math.isnan(worst) else worst
    return (found[Verdict.FAILS], unjudged, -found[Verdict.PASSES], worst, one_line(result.contestant.name))
