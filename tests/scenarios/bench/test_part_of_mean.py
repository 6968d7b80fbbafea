"""A mean over too few records is told without a verdict, and how many are needed."""

import numpy as np
import pytest

from scenarios.bench.accuracy import Acceptance, RecordStatistic
from scenarios.bench.theory import Expectation


@pytest.mark.parametrize(
    ("values", "run", "passed", "why"),
    [
        (1, 1, None, "no verdict: 1 of 1 records have a value, at least 2 are needed"),
        (4, 9, None, "no verdict: 4 of 9 records have a value, at least 5 are needed"),
        (5, 9, True, ""),
    ],
)
def test_how_many_records_are_needed(values: int, run: int, passed: bool | None, why: str) -> None:
    single = np.linspace(0.0, 2.0, 101)
    statistic = RecordStatistic("p1", np.ones(values), run, single, Expectation(True))
    part = statistic.part(Acceptance(expected=1.0), 0.01)
    assert (part.passed, part.why) == (passed, why)
