"""Excuses by bias stand where there is a bias, and only there."""

from collections.abc import Sequence

import numpy as np
import pytest

from scenarios.bench.accuracy_records import accuracy_trials
from scenarios.bench.coverage import Coverage
from scenarios.bench.efficiency import Efficiency
from scenarios.bench.frequency_response import FrequencyResponse
from scenarios.bench.measured import Measured
from scenarios.bench.metric import FigureMaker
from scenarios.bench.normalised_error import NormalisedError
from scenarios.bench.simulated_estimators import Fault, simulated
from scenarios.bench.theory_of_claims import ClaimsTheory, greatest_bias
from scenarios.estimators.contestant import Contestant

OBSERVER = Contestant("simulated", "bench:perfect", method="observer")
LEAST_SQUARES = Contestant("simulated", "bench:perfect", method="least_squares", structure="arx")
OUTPUT_ERROR = Contestant("simulated", "bench:perfect", method="pem", structure="oe")
CLAIMS: tuple[FigureMaker, ...] = (Coverage(), NormalisedError(), FrequencyResponse())
ALARM = 1e-4


def measured(fault: Fault, name: str = "") -> list[Measured]:
    """Of the quick effort's records, or of those of one problem."""
    trials = [trial for trial in accuracy_trials("quick") if name in ("", trial.problem)]
    return simulated(trials, fault, np.random.default_rng(7))


def passes(contestant: Contestant, name: str, data: Sequence[Measured]) -> bool:
    return ClaimsTheory(contestant, name, data).expectation("coverage").passes


@pytest.mark.parametrize("maker", CLAIMS, ids=lambda maker: maker.name)
def test_an_overconfident_estimator_does_not_hide_behind_a_method(maker: FigureMaker) -> None:
    """That it is said to be biased says nothing where it is not."""
    data = measured(Fault(claimed=0.5))
    figure = maker.figure(data, OBSERVER, ALARM, ())
    assert figure.passed is False
    assert any("no bias that would excuse" in part.why for part in figure.parts if part.surprises)
    assert Efficiency().figure(data, OBSERVER, ALARM, ()).passed is None


@pytest.mark.parametrize("maker", CLAIMS, ids=lambda maker: maker.name)
def test_a_bias_excuses(maker: FigureMaker) -> None:
    """As theory says."""
    figure = maker.figure(measured(Fault(gain=1.05)), OBSERVER, ALARM, ())
    assert figure.passed is None
    assert any(part.passed is False for part in figure.parts)


def test_a_wrong_disturbance_excuses_beyond_the_bound_only() -> None:
    """It spoils the claimed covariance without any bias, but not where nothing is lost."""
    assert passes(LEAST_SQUARES, "p2", measured(Fault(), "p2"))
    assert not passes(LEAST_SQUARES, "p2", measured(Fault(variance=2.0), "p2"))
    assert passes(OBSERVER, "p2", measured(Fault(variance=2.0), "p2"))
    # white intervals under a coloured disturbance are wrong, efficient or not
    assert not passes(OUTPUT_ERROR, "p3", measured(Fault(), "p3"))


def test_bias_is_free_of_scatter() -> None:
    """None of an unbiased estimator; all of the error of one that errs by its gain alone; unknown of one record."""
    assert abs(greatest_bias(measured(Fault(), "p3"), "p3", None)) < 0.06
    assert greatest_bias(measured(Fault(gain=2.0), "p3"), "p3", None) > 0.9
    assert np.isnan(greatest_bias(measured(Fault(), "p3")[:1], "p3", None))
    assert np.isnan(greatest_bias([], "p3", None))
