"""Digits of the response without noise."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.bench.consistency import MOST_DIGITS, NoiseFreeRecovery
from scenarios.bench.measurement import Measurement
from scenarios.estimators.estimator import Estimator
from tests.benchmarks.simulated_estimators import Fault, simulated

CONTESTANT = Estimator("simulated", "bench:perfect")
MAKER = NoiseFreeRecovery()
TRIALS = MAKER.trials("quick")


def measured(gain: float) -> list[Measurement]:
    return simulated(TRIALS, Fault(gain=gain), np.random.default_rng(0))


@pytest.mark.parametrize(
    ("gain", "digits", "passed"), [(1.0, MOST_DIGITS, True), (1.0 + 1e-8, 8.0, True), (1.02, 1.7, False)]
)
def test_digits(gain: float, digits: float, passed: bool) -> None:
    figure = MAKER.evaluate(measured(gain), CONTESTANT, 1e-4, ())
    assert figure.passed is passed
    assert figure.value == pytest.approx(digits, abs=0.01)
    assert np.array(figure.curves["digits"]) == pytest.approx(np.full((6, 3), digits), abs=0.01)


def test_the_worst_system_stands_for_all() -> None:
    data = measured(1.0)
    wrong = TRIALS[4]
    response = data[4].response
    assert response is not None
    data[4] = replace(data[4], response=response * (1.0 + 1e-3))
    figure = MAKER.evaluate(data, CONTESTANT, 1e-4, ())
    assert figure.passed is False
    assert figure.value == pytest.approx(3.0, abs=0.01)
    assert wrong.problem == "quiet-2-2"
    assert figure.curves["digits"][1][1] == pytest.approx(3.0, abs=0.01)


def test_what_is_familiar_is_told_where_all_that_fail_have_it() -> None:
    figure = MAKER.evaluate(measured(1.02), CONTESTANT, 1e-4, ())
    assert {part.why for part in figure.parts} == {"the response is 1.02 times the truth"}
    assert figure.why.endswith("; where it fails, the response is 1.02 times the truth")
    data = measured(1.02)
    assert data[4].response is not None
    data[4] = replace(data[4], response=-data[4].response)
    assert "where it fails" not in MAKER.evaluate(data, CONTESTANT, 1e-4, ()).why
    assert "where it fails" not in MAKER.evaluate(measured(1.0), CONTESTANT, 1e-4, ()).why


def test_systems_without_model_are_left_out_until_they_are_most() -> None:
    data = measured(1.0)
    few = [Measurement(m.trial, "hang") if k < 9 else m for k, m in enumerate(data)]
    assert MAKER.evaluate(few, CONTESTANT, 1e-4, ()).passed
    many = [Measurement(m.trial, "hang") if k < 10 else m for k, m in enumerate(data)]
    figure = MAKER.evaluate(many, CONTESTANT, 1e-4, ())
    assert figure.passed is None
    assert "8 of 18" in figure.why
    assert MAKER.evaluate([], CONTESTANT, 1e-4, ()).passed is None
