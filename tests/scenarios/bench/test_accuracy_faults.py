"""Which known fault fails which figure of accuracy: all that should, and no other."""

import numpy as np
import pytest

from scenarios.bench.accuracy import Efficiency
from scenarios.bench.claims import Coverage, FrequencyResponse, NormalisedError
from scenarios.bench.consistency import Consistency, NoiseFreeRecovery
from scenarios.bench.metric import MetricDefinition
from scenarios.bench.metrics import false_alarm_of_each
from scenarios.estimators.estimator import Estimator
from tests.benchmarks.simulated_estimators import FAULTS, FOUND_BY, HONEST, simulated

MAKERS: tuple[MetricDefinition, ...] = (
    NoiseFreeRecovery(),
    Consistency(),
    Efficiency(),
    Coverage(),
    NormalisedError(),
    FrequencyResponse(),
)
CONTESTANT = Estimator("simulated", "bench:perfect")
RUNS = 1


def verdicts(fault: str, seed: int) -> dict[str, bool | None]:
    rng = np.random.default_rng(seed)
    out = {}
    accuracy = simulated(Efficiency().trials("quick"), FAULTS[fault], rng)
    for maker in MAKERS:
        shared = maker.trials("quick") == Efficiency().trials("quick")
        measured = accuracy if shared else simulated(maker.trials("quick"), FAULTS[fault], rng)
        out[maker.name] = maker.evaluate(measured, CONTESTANT, false_alarm_of_each(), ()).passed
    return out


@pytest.mark.parametrize("fault", [name for name in FAULTS if name != "claims nothing"])
def test_a_fault_fails_the_figures_that_should_find_it_and_no_other(fault: str) -> None:
    for seed in range(RUNS):
        given = verdicts(fault, seed)
        assert None not in given.values()
        assert {name for name, passed in given.items() if not passed} == FOUND_BY[fault]


def test_who_claims_nothing_has_no_verdict_on_claims() -> None:
    given = verdicts("claims nothing", 1)
    assert {name for name, passed in given.items() if passed is None} == HONEST
    assert all(passed for name, passed in given.items() if name not in HONEST)


def test_every_fault_is_in_the_matrix() -> None:
    assert set(FAULTS) == set(FOUND_BY)
