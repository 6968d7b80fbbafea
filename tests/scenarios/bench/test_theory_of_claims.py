"""Excuses by bias stand where there is a bias, and only there."""

from collections.abc import Sequence

import numpy as np
import pytest

from scenarios.bench.accuracy import Efficiency, accuracy_trials
from scenarios.bench.claims import Coverage, FrequencyResponse, NormalisedError
from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import MetricDefinition
from scenarios.bench.theory import expected_of_claims, greatest_bias
from scenarios.estimators.estimator import Estimator
from tests.benchmarks.simulated_estimators import Fault, simulated

OBSERVER = Estimator("simulated", "bench:perfect", method="observer")
LEAST_SQUARES = Estimator("simulated", "bench:perfect", method="least_squares", structure="arx")
OUTPUT_ERROR = Estimator("simulated", "bench:perfect", method="pem", structure="oe")
CLAIMS: tuple[MetricDefinition, ...] = (Coverage(), NormalisedError(), FrequencyResponse())
ALARM = 1e-4


def measured(fault: Fault, name: str = "") -> list[Measurement]:
    trials = [trial for trial in accuracy_trials("quick") if name in ("", trial.problem)]
    return simulated(trials, fault, np.random.default_rng(7))


def passes(contestant: Estimator, name: str, data: Sequence[Measurement]) -> bool:
    return expected_of_claims(contestant, name, data, "coverage").passes


@pytest.mark.parametrize("maker", CLAIMS, ids=lambda maker: maker.name)
def test_an_overconfident_estimator_does_not_hide_behind_a_method(maker: MetricDefinition) -> None:
    data = measured(Fault(claimed=0.5))
    figure = maker.evaluate(data, OBSERVER, ALARM, ())
    assert figure.passed is False
    assert any("no bias that would excuse" in part.why for part in figure.parts if part.surprises)
    assert Efficiency().evaluate(data, OBSERVER, ALARM, ()).passed is None


@pytest.mark.parametrize("maker", CLAIMS, ids=lambda maker: maker.name)
def test_a_bias_excuses(maker: MetricDefinition) -> None:
    figure = maker.evaluate(measured(Fault(gain=1.05)), OBSERVER, ALARM, ())
    assert figure.passed is None
    assert any(part.passed is False for part in figure.parts)


def test_a_wrong_disturbance_excuses_beyond_the_bound_only() -> None:
    assert passes(LEAST_SQUARES, "p2", measured(Fault(), "p2"))
    assert not passes(LEAST_SQUARES, "p2", measured(Fault(variance=2.0), "p2"))
    assert passes(OBSERVER, "p2", measured(Fault(variance=2.0), "p2"))
    # white intervals under a coloured disturbance are wrong, efficient or not
    assert not passes(OUTPUT_ERROR, "p3", measured(Fault(), "p3"))


def test_bias_is_free_of_scatter() -> None:
    assert abs(greatest_bias(measured(Fault(), "p3"), "p3", None)) < 0.06
    assert greatest_bias(measured(Fault(gain=2.0), "p3"), "p3", None) > 0.9
    assert np.isnan(greatest_bias(measured(Fault(), "p3")[:1], "p3", None))
    assert np.isnan(greatest_bias([], "p3", None))
