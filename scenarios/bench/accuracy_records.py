"""Records on which accuracy is judged: the same for efficiency, coverage, normalised error and frequency response."""

from collections.abc import Sequence

import numpy as np

from scenarios.bench.measured import Measured
from scenarios.bench.metric import DRAWS
from scenarios.estimators.outcome import MODEL
from scenarios.files.errors import ScenarioError
from scenarios.problems.trial import Trial

QUICK = ("p2", "p3", "p4", "p5")
"""One problem for each kind of disturbance: output error, ARMAX, Box-Jenkins, equation error."""

FULL = {
    **dict.fromkeys(("p1", *QUICK), 1000),
    **dict.fromkeys(("published-4.7", "published-4.12"), 1000),
    **{f"random-{difficulty}-{number}": 1000 for difficulty in ("easy", "medium", "hard") for number in (1, 2)},
    "mimo@24000": 100,
}
"""Records of each problem by the full effort. Three inputs and outputs have nine responses each, so that fewer will do;
they need long ones: what the bound leaves out, of second order, is 10 % of the variance at 12 000 samples."""

RECORDS = 100
"""Of each problem by the quick effort."""

NO_RECORD = "no verdict: no record was run"


def accuracy_trials(effort: str) -> tuple[Trial, ...]:
    """Trials of the figures of accuracy.

    Raises:
        ScenarioError: There is no such effort.
    """
    if effort not in DRAWS:
        raise ScenarioError(f"effort {effort!r} given, expected one of {', '.join(DRAWS)}")
    records = dict.fromkeys(QUICK, RECORDS) if effort == "quick" else FULL
    return tuple(Trial(name, draw) for name, count in records.items() for draw in range(count))


def by_problem(measured: Sequence[Measured]) -> dict[str, tuple[list[Measured], int]]:
    """Trials with a model by problem, in their sequence, each with the number that were run."""
    groups: dict[str, tuple[list[Measured], int]] = {}
    for m in measured:
        good, run = groups.setdefault(m.trial.problem, ([], 0))
        if m.kind == MODEL and m.response is not None and np.isfinite(m.response).all():
            good.append(m)
        groups[m.trial.problem] = (good, run + 1)
    return groups


def enough(count: int, run: int) -> bool:
    """Whether there are values of enough records for a verdict."""
    return count >= needed(run)


def needed(run: int) -> int:
    """Of how many records values are needed for a verdict: of at least half of those that were run, and two."""
    return max(2, (run + 1) // 2)
