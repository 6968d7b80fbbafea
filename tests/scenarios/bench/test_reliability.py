"""Failures are counted, refusals are none."""

from dataclasses import replace

import pytest
from scipy.stats import binom

from scenarios.bench.accuracy import Agreement
from scenarios.bench.bias import Bias
from scenarios.bench.measurement import Measurement
from scenarios.bench.metrics import FAILURES, Reliability, interval_of_percentage
from scenarios.estimators.estimator import Estimator
from scenarios.problems.trial import Trial

ANYONE = Estimator("anyone", "bench:perfect")
GOOD = [Measurement(Trial("p3", draw), "model") for draw in range(50)]


def test_no_failure_passes() -> None:
    found = Reliability().evaluate(GOOD, ANYONE, 0.0, ())
    assert found.passed
    assert found.value == 0.0
    assert found.interval == (0.0, pytest.approx(7.112, abs=1e-3))
    assert [part.label for part in found.parts] == list(FAILURES)


@pytest.mark.parametrize("kind", FAILURES)
def test_a_single_failure_of_any_kind_fails(kind: str) -> None:
    measured = [*GOOD[1:], replace(GOOD[0], kind=kind, why="it happened")]
    found = Reliability().evaluate(measured, ANYONE, 0.0, ())
    assert found.passed is False
    assert found.value == pytest.approx(2.0)
    assert {part.label: part.value for part in found.parts if part.value > 0.0} == {kind: pytest.approx(2.0)}
    assert found.curves["reasons"] == {f"{kind}: it happened": 1}
    assert found.curves["problems"] == {"p3": 1}


def test_refusals_do_not_count() -> None:
    refused = [Measurement(Trial("p4", draw), "refused", "no such structure") for draw in range(10)]
    found = Reliability().evaluate([*GOOD, *refused], ANYONE, 0.0, ())
    assert found.passed
    assert found.parts[0].draws == 50
    assert "10 more were refused" in found.why
    for measured in (refused, []):
        nothing = Reliability().evaluate(measured, ANYONE, 0.0, ())
        assert nothing.passed is None


def test_refusing_some_records_of_a_problem_is_a_failure() -> None:
    some = [replace(m, kind="refused", why="too hard") for m in GOOD[:30]]
    choices = [Measurement(Trial("p3", draw, "select"), "refused", "no choice of orders") for draw in range(10)]
    found = Reliability().evaluate([*some, *GOOD[30:], *choices], ANYONE, 0.0, ())
    assert found.passed is False
    assert found.value == pytest.approx(60.0)
    assert "10 more were refused" in found.why
    assert next(part for part in found.parts if part.label == "refused").passed is False


def test_theory_allows_some_unstable_models_of_methods_without_a_guarantee() -> None:
    subspace = replace(ANYONE, method="subspace")
    some = [replace(m, kind="unstable") for m in GOOD[:5]] + GOOD[5:]
    found = Reliability().evaluate(some, subspace, 0.0, ())
    assert (found.passed, found.value) == (True, pytest.approx(10.0))
    assert "[Maciejowski1995]" in found.why
    assert [(part.label, part.theory) for part in found.parts if part.passed is False] == [("unstable", False)]
    most = [replace(m, kind="unstable") for m in GOOD[:26]] + GOOD[26:]
    crash = [replace(GOOD[0], kind="crash"), *some[1:]]
    for measured, who in ((some, ANYONE), (most, subspace), (crash, subspace)):
        assert Reliability().evaluate(measured, who, 0.0, ()).passed is False


def test_trials_are_those_of_all_others() -> None:
    maker = Reliability((Bias(), Agreement(), Agreement()))
    trials = maker.trials("quick")
    assert set(trials) == {*Bias().trials("quick"), *Agreement().trials("quick")}
    assert len(trials) == len(set(trials))


@pytest.mark.parametrize(("found", "total"), [(0, 20), (3, 20), (20, 20)])
def test_interval_of_a_share(found: int, total: int) -> None:
    low, high = (end / 100.0 for end in interval_of_percentage(found, total))
    assert low <= found / total <= high
    if found:
        assert binom.sf(found - 1, total, low) == pytest.approx(0.025)
    if found < total:
        assert binom.cdf(found, total, high) == pytest.approx(0.025)
