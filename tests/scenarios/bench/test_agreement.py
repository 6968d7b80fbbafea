"""Differences from a second implementation, in variances."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.bench.accuracy import QUICK, Agreement
from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import Metric
from scenarios.bench.statistics import bound_for
from scenarios.estimators.estimator import Estimator
from tests.benchmarks.simulated_estimators import Fault, simulated

ANYONE = Estimator("anyone", "bench:perfect")
SHARE = 1e-4
MAKER = Agreement()


def perfect(seed: int, fault: Fault = Fault()) -> list[Measurement]:  # noqa: B008
    return simulated(MAKER.trials("quick"), fault, np.random.default_rng(seed))


def metric(own: list[Measurement], theirs: list[Measurement], contestant: Estimator = ANYONE) -> Metric:
    return MAKER.evaluate(own, contestant, SHARE, theirs)


def mirrored(m: Measurement) -> Measurement:
    bound = bound_for(m.trial.problem, None)
    assert bound is not None and m.response is not None
    return replace(m, response=2.0 * bound.response - m.response)


def test_the_same_answers_agree_to_all_digits() -> None:
    one = perfect(1)
    found = metric(one, one)
    assert found.passed
    assert found.value == 0.0
    assert found.curves["digits"] == dict.fromkeys(QUICK, 16.0)


def test_independent_errors_differ_by_two_variances_and_opposite_ones_by_four() -> None:
    one, other = perfect(1), perfect(2)
    independent = [part.value for part in metric(one, other).parts]
    assert np.mean(independent) == pytest.approx(2.0, abs=0.5)
    assert metric(one, other).passed
    opposite = metric(one, [mirrored(m) for m in one])
    assert np.mean([part.value for part in opposite.parts]) == pytest.approx(4.0, abs=1.0)
    assert opposite.passed


def test_errors_beyond_that_fail() -> None:
    found = metric(perfect(1, Fault(delay=1)), perfect(2))
    assert found.passed is False
    assert found.value > 10.0


def test_where_efficiency_is_not_expected_it_is_no_surprise() -> None:
    arx = Estimator("arx", "bench:perfect", structure="arx", method="pem")
    found = metric(perfect(1, Fault(delay=1)), perfect(2), arx)
    assert {part.label for part in found.parts if part.theory} == {"p5"}
    assert found.passed is False
    assert [part.label for part in found.parts if part.surprises] == ["p5"]


def test_a_second_implementation_that_errs_itself_is_not_believed() -> None:
    theirs = perfect(2)
    assert theirs[0].response is not None
    theirs[0] = replace(theirs[0], response=100.0 * theirs[0].response)
    found = metric(perfect(1), theirs)
    assert found.passed
    assert [part.draws for part in found.parts] == [19, 20, 20, 20]


def test_nothing_to_compare() -> None:
    one = perfect(1)
    failed = [Measurement(m.trial, "crash") for m in one]
    for own, theirs in ((one, []), ([], one), (failed, one), (one, failed)):
        found = metric(own, theirs)
        assert found.passed is None
        assert np.isnan(found.value)


def test_half_of_the_records_are_enough() -> None:
    one, other = perfect(1), perfect(2)
    half = [Measurement(m.trial, "hang") if m.trial.draw < 10 else m for m in one]
    assert metric(half, other).passed
    fewer = [Measurement(m.trial, "hang") if m.trial.draw < 11 else m for m in one]
    assert metric(fewer, other).passed is None
