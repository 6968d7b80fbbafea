"""Reliability and speed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from scenarios.bench.accuracy import Agreement
from scenarios.bench.bias import Bias
from scenarios.bench.measurement import Measurement
from scenarios.bench.metrics import FAILURES, SLOW, Reliability, Speed, interval_of_percentage
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
    definition = Reliability((Bias(), Agreement(), Agreement()))
    trials = definition.trials("quick")
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


def measured(multiple: float, ruler: float = 0.002) -> list[Measurement]:
    spread = np.random.default_rng(1).lognormal(0.0, 0.3, 50)
    spread /= np.median(spread)
    return [
        Measurement(
            Trial("p3" if n < 25 else "p4", n % 25),
            "model",
            seconds=multiple * ruler * one,
            ruler_seconds=ruler,
            peak_bytes=2**20 * n,
        )
        for n, one in enumerate(spread)
    ]


def test_times_are_multiples_of_the_ruler() -> None:
    found = [Speed().evaluate(measured(20.0, ruler), ANYONE, 0.0, ()) for ruler in (0.0005, 0.01)]
    assert found[0].value == pytest.approx(20.0)
    assert found[0].value == pytest.approx(found[1].value)
    assert found[0].passed
    assert found[0].interval[0] < 20.0 < found[0].interval[1]
    assert found[0].curves["percentile_95"] == pytest.approx(20.0 * np.exp(0.3 * 1.645), rel=0.15)
    assert found[0].curves["peak_bytes"] == 49 * 2**20
    assert [part.label for part in found[0].parts] == ["p3", "p4"]


def test_slow_is_slow() -> None:
    assert Speed().evaluate(measured(1.01 * SLOW), ANYONE, 0.0, ()).passed is False
    assert Speed().evaluate(measured(0.99 * SLOW), ANYONE, 0.0, ()).passed is True


def test_failures_are_not_timed() -> None:
    own = measured(20.0)
    failing = [replace(m, kind="hang", seconds=1e6) if n % 3 == 0 else m for n, m in enumerate(own)]
    assert Speed().evaluate(failing, ANYONE, 0.0, ()).passed
    for other in ([replace(m, kind="crash") for m in own], []):
        assert Speed().evaluate(other, ANYONE, 0.0, ()).passed is None


def test_times_that_are_not_known_leave_no_verdict() -> None:
    own = measured(20.0)
    unknown = [replace(m, seconds=float("nan")) for m in own]
    found = Speed().evaluate(unknown, ANYONE, 0.0, ())
    assert found.passed is None
    assert np.isnan(found.value)
    assert "0 of 50" in found.why
    assert Speed().evaluate([*own, *unknown[:20]], ANYONE, 0.0, ()).passed
