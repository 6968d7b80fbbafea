"""The slope of the error against the number of samples."""

import numpy as np
import pytest

from scenarios.bench.consistency import LENGTHS, RECORDS, Consistency, perfect_slopes
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
    figure = MAKER.evaluate(some, CONTESTANT, 1e-4, ())
    assert [part.passed for part in figure.parts] == [True, None]
    assert "9 of 20 at 4000" in figure.parts[1].why


def test_nothing_measured_is_no_verdict() -> None:
    assert MAKER.evaluate([], CONTESTANT, 1e-4, ()).passed is None


def test_the_full_effort_has_more_problems_and_records() -> None:
    assert set(MAKER.trials("quick")) < set(MAKER.trials("full"))
