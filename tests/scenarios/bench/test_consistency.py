"""Recovery without noise, and the slope of the error."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
from scenarios.bench.consistency import (
    LENGTHS,
    MOST_DIGITS,
    RECORDS,
    Consistency,
    NoiseFreeRecovery,
    perfect_slopes,
    recognised_fault,
)
from scenarios.bench.measurement import Measurement
from scenarios.estimators.estimator import Estimator
from tests.benchmarks.simulated_estimators import Fault, simulated

CONTESTANT = Estimator("simulated", "bench:perfect")
MAKER = Consistency()


def measured(fault: Fault, seed: int = 1) -> list[Measurement]:
    return simulated(MAKER.trials("quick"), fault, np.random.default_rng(seed))


def test_slopes_of_perfect_estimators_are_minus_a_half() -> None:
    for name in ("p2", "p3"):
        assert np.mean(perfect_slopes(name, None, LENGTHS, (RECORDS,) * 3)) == pytest.approx(-0.5, abs=0.02)


def test_the_slope_knows_no_scale() -> None:
    plain, scaled, biased = (
        MAKER.evaluate(measured(fault), CONTESTANT, 1e-4, ())
        for fault in (Fault(), Fault(variance=10.0), Fault(gain=2.0))
    )
    assert plain.passed
    assert [part.value for part in scaled.parts] == pytest.approx([part.value for part in plain.parts])
    assert biased.passed is False
    assert biased.value == pytest.approx(0.0, abs=0.02)


def test_too_few_models_of_one_length_leave_no_verdict() -> None:
    some = [
        Measurement(m.trial, "crash") if m.trial.problem == "p3@4000" and m.trial.draw > 8 else m
        for m in measured(Fault())
    ]
    metric = MAKER.evaluate(some, CONTESTANT, 1e-4, ())
    assert [part.passed for part in metric.parts] == [True, None]
    assert "9 of 20 at 4000" in metric.parts[1].why


def test_nothing_measured_is_no_verdict() -> None:
    assert MAKER.evaluate([], CONTESTANT, 1e-4, ()).passed is None


def test_the_full_effort_has_more_problems_and_records() -> None:
    assert set(MAKER.trials("quick")) < set(MAKER.trials("full"))


RECOVERY = NoiseFreeRecovery()
TRIALS = RECOVERY.trials("quick")


def without_noise(gain: float) -> list[Measurement]:
    return simulated(TRIALS, Fault(gain=gain), np.random.default_rng(0))


@pytest.mark.parametrize(
    ("gain", "digits", "passed"), [(1.0, MOST_DIGITS, True), (1.0 + 1e-8, 8.0, True), (1.02, 1.7, False)]
)
def test_digits(gain: float, digits: float, passed: bool) -> None:
    metric = RECOVERY.evaluate(without_noise(gain), CONTESTANT, 1e-4, ())
    assert metric.passed is passed
    assert metric.value == pytest.approx(digits, abs=0.01)
    assert np.array(metric.curves["digits"]) == pytest.approx(np.full((6, 3), digits), abs=0.01)


def test_the_worst_system_stands_for_all() -> None:
    data = without_noise(1.0)
    wrong = TRIALS[4]
    response = data[4].response
    assert response is not None
    data[4] = replace(data[4], response=response * (1.0 + 1e-3))
    metric = RECOVERY.evaluate(data, CONTESTANT, 1e-4, ())
    assert metric.passed is False
    assert metric.value == pytest.approx(3.0, abs=0.01)
    assert wrong.problem == "quiet-2-2"
    assert metric.curves["digits"][1][1] == pytest.approx(3.0, abs=0.01)


def test_what_is_familiar_is_told_where_all_that_fail_have_it() -> None:
    metric = RECOVERY.evaluate(without_noise(1.02), CONTESTANT, 1e-4, ())
    assert {part.why for part in metric.parts} == {"the response is 1.02 times the truth"}
    assert metric.why.endswith("; where it fails, the response is 1.02 times the truth")
    data = without_noise(1.02)
    assert data[4].response is not None
    data[4] = replace(data[4], response=-data[4].response)
    assert "where it fails" not in RECOVERY.evaluate(data, CONTESTANT, 1e-4, ()).why
    assert "where it fails" not in RECOVERY.evaluate(without_noise(1.0), CONTESTANT, 1e-4, ()).why


def test_systems_without_model_are_left_out_until_they_are_most() -> None:
    data = without_noise(1.0)
    few = [Measurement(m.trial, "hang") if k < 9 else m for k, m in enumerate(data)]
    assert RECOVERY.evaluate(few, CONTESTANT, 1e-4, ()).passed
    many = [Measurement(m.trial, "hang") if k < 10 else m for k, m in enumerate(data)]
    metric = RECOVERY.evaluate(many, CONTESTANT, 1e-4, ())
    assert metric.passed is None
    assert "8 of 18" in metric.why
    assert RECOVERY.evaluate([], CONTESTANT, 1e-4, ()).passed is None


DT = 0.02
F = np.array([0.1, 0.5, 2.0, 8.0, 20.0])


def response(b: list[float], a: list[float]) -> np.ndarray:
    return sysid.models.innovations_form(sysid.Polynomials(A=a, B=b), DT).frequency_response(F)


TRUE = response([0.0, 0.2, 0.1], [1.0, -1.5, 0.7])


@pytest.mark.parametrize(
    ("b", "told"),
    [
        ([0.0, 0.0, 0.2, 0.1], "1 sample late"),
        ([0.0, 0.0, 0.0, 0.2, 0.1], "2 samples late"),
        ([0.2, 0.1], "1 sample early"),
        ([0.0, -0.2, -0.1], "of the wrong sign"),
        ([0.0, 0.204, 0.102], "1.02 times the truth"),
        ([0.0, 0.200002, 0.100001], "1.00001 times the truth"),
        ([0.0, 0.2, 0.11], ""),
    ],
)
def test_what_is_familiar_is_told(b: list[float], told: str) -> None:
    found = response(b, [1.0, -1.5, 0.7])
    assert recognised_fault([found, found], TRUE, F, DT, 1e-6) == told


def test_all_responses_must_have_it() -> None:
    assert recognised_fault([-TRUE, TRUE], TRUE, F, DT, 1e-6) == ""
    assert recognised_fault([1.02 * TRUE, 1.03 * TRUE], TRUE, F, DT, 1e-6) == ""
