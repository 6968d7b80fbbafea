"""The numbers of estimators and of the truth are those that this version was recorded with (`tests/golden.py`)."""

import json
from functools import cache

import pytest

from tests.golden import CASES, REFERENCE, Numbers, differences, numbers

QUICK = [
    *("estimators-p2", "estimators-p3", "truth-nominal"),
    *(pytest.param(name, marks=pytest.mark.thorough) for name in ("estimators-p1", "truth-published", "truth-flight")),
]
# Other processors and libraries round otherwise; P1 has a condition number of 4e8.
TOLERANCE = 1e-4


@cache
def recorded() -> dict[str, Numbers]:
    """All recorded cases."""
    cases: dict[str, Numbers] = json.loads(REFERENCE.read_text(encoding="utf-8"))
    return cases


@pytest.mark.slow
@pytest.mark.parametrize("case", QUICK)
def test_numbers_are_those_recorded(case):
    assert not differences(recorded()[case], numbers(case), TOLERANCE)


def test_every_case_is_recorded():
    assert set(recorded()) == set(CASES)
