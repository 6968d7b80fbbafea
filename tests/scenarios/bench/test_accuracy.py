"""Efficiency, coverage, normalised error and frequency response of perfect and faulty estimators."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from scenarios.bench.accuracy import Acceptance, Efficiency, RecordStatistic, accuracy_trials
from scenarios.bench.claims import Coverage, NormalisedError, ResponseError
from scenarios.bench.consistency import Consistency, NoiseFreeRecovery
from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import MetricDefinition
from scenarios.bench.metrics import false_alarm_of_each
from scenarios.bench.theory import Expectation, expected_of_claims, greatest_bias
from scenarios.estimators.estimator import Estimator
from scenarios.files.errors import ScenarioError
from tests.benchmarks.simulated_estimators import FAULTS, FOUND_BY, HONEST, Fault, simulated

CONTESTANT = Estimator("simulated", "bench:perfect")
OUTPUT_ERROR = Estimator("simulated", "bench:perfect", structure="oe", method="pem")
MAKERS: tuple[MetricDefinition, ...] = (Efficiency(), Coverage(), NormalisedError(), ResponseError())
ALARM = 1e-4


def measured(fault: Fault, *, records: int = 100) -> list[Measurement]:
    trials = [trial for trial in accuracy_trials("quick") if trial.draw < records]
    return simulated(trials, fault, np.random.default_rng(11))


@pytest.mark.parametrize("definition", MAKERS, ids=lambda definition: definition.name)
def test_records_without_model_are_left_out_until_they_are_most(definition: MetricDefinition) -> None:
    data = measured(Fault(), records=40)
    half = [Measurement(m.trial, "error", "none") if m.trial.draw < 20 else m for m in data]
    more = [Measurement(m.trial, "error", "none") if m.trial.draw < 21 else m for m in data]
    assert definition.evaluate(half, CONTESTANT, ALARM, ()).passed
    none = definition.evaluate(more, CONTESTANT, ALARM, ())
    assert none.passed is None
    assert "19 of 40 records" in none.why
    assert definition.evaluate([], CONTESTANT, ALARM, ()).passed is None


@pytest.mark.parametrize("definition", MAKERS, ids=lambda definition: definition.name)
def test_the_share_of_false_alarms_is_that_of_its_verdicts(definition: MetricDefinition) -> None:
    metric = definition.evaluate(measured(Fault(), records=10), CONTESTANT, ALARM, ())
    assert metric.false_alarm == pytest.approx(definition.verdicts * ALARM)
    assert sum(part.passed is not None for part in metric.parts) <= definition.verdicts


def test_what_theory_expects_to_fail_fails_no_figure() -> None:
    coloured = [m for m in measured(Fault(variance=9.0)) if m.trial.problem != "p2"]
    data = [m for m in measured(Fault()) if m.trial.problem == "p2"] + coloured
    metric = Efficiency().evaluate(data, OUTPUT_ERROR, ALARM, ())
    assert metric.passed
    assert {part.label: part.passed for part in metric.parts} == {"p2": True, "p3": False, "p4": False, "p5": False}
    assert "not efficient" in metric.why
    assert Efficiency().evaluate(data, CONTESTANT, ALARM, ()).passed is False
    # nothing is left to judge where theory expects nothing to pass
    assert Efficiency().evaluate(coloured, OUTPUT_ERROR, ALARM, ()).passed is None


def test_a_single_part_between_others_is_found_together() -> None:
    metric = Efficiency().evaluate(measured(Fault(variance=1.3)), CONTESTANT, ALARM, ())
    assert metric.passed is False
    assert [part.label for part in metric.parts if part.passed is False] == ["together"]


def test_parameters_that_have_no_true_values_are_claimed_all_the_same() -> None:
    data = [replace(m, covered=-1) for m in measured(Fault(), records=20)]
    parts = {part.label: part for part in Coverage().evaluate(data, OUTPUT_ERROR, ALARM, ()).parts}
    assert "no oe model is the truth" in parts["p3 parameters"].why
    assert "not those of the orders that were asked" in parts["p2 parameters"].why
    silent = [replace(m, covered=-1, parameters=0) for m in data]
    parts = {part.label: part for part in Coverage().evaluate(silent, OUTPUT_ERROR, ALARM, ()).parts}
    assert "claims no interval of the parameters" in parts["p3 parameters"].why


def test_claims_without_parameters_are_judged_by_the_response() -> None:
    data = [replace(m, normalised_error=np.nan, covered=-1) for m in measured(Fault(claimed=0.5))]
    metric = NormalisedError().evaluate(data, CONTESTANT, ALARM, ())
    assert metric.passed is False
    assert metric.curves["p2"]["of"] == "response"
    honest = [replace(m, normalised_error=np.nan, covered=-1) for m in measured(Fault())]
    metric = NormalisedError().evaluate(honest, CONTESTANT, ALARM, ())
    assert metric.passed
    assert metric.curves["p2"]["kolmogorov_smirnov_p"] > 1e-4


def test_the_distribution_of_the_normalised_error_is_told() -> None:
    for claimed, fits in ((1.0, True), (0.5, False)):
        metric = NormalisedError().evaluate(measured(Fault(claimed=claimed)), CONTESTANT, ALARM, ())
        assert metric.curves["p4"]["degrees_of_freedom"] == 8
        assert (metric.curves["p4"]["kolmogorov_smirnov_p"] > 1e-4) is fits


def test_an_infinite_normalised_error_fails() -> None:
    data = measured(Fault())
    data[3] = replace(data[3], normalised_error=np.inf)
    metric = NormalisedError().evaluate(data, CONTESTANT, ALARM, ())
    assert metric.passed is False
    assert metric.value == np.inf


def test_covariances_that_are_not_known_are_not_counted() -> None:
    data = measured(Fault(), records=30)
    unknown = np.full((16, 1, 1, 2, 2), np.nan)
    one = [replace(m, response_covariance=unknown) if m.trial.draw == 0 else m for m in data]
    most = [replace(m, response_covariance=unknown) if m.trial.draw < 16 else m for m in data]
    metric = ResponseError().evaluate(one, CONTESTANT, ALARM, ())
    assert metric.passed
    assert metric.parts[0].draws == 29
    chosen = ResponseError().evaluate(most, CONTESTANT, ALARM, ())
    assert chosen.passed is False
    assert "claimed of 14 of 30 records" in chosen.parts[0].why


def test_a_covariance_of_another_shape_is_an_error() -> None:
    data = measured(Fault(), records=2)
    data[0] = replace(data[0], response_covariance=np.zeros((16, 2, 2)))
    with pytest.raises(ScenarioError, match="expected"):
        ResponseError().evaluate(data, CONTESTANT, ALARM, ())


def test_bandwidths_without_interval_are_not_counted() -> None:
    unknown = np.full((2, 1, 1), np.nan)
    data = [replace(m, bandwidth_ci95=unknown) if m.trial.draw < 30 else m for m in measured(Fault())]
    metric = Coverage().evaluate(data, CONTESTANT, ALARM, ())
    part = next(part for part in metric.parts if part.label == "p2 bandwidth")
    assert part.passed is False and "claimed of 70 of 100 records" in part.why
    data = [replace(m, bandwidth_hz=unknown[0]) if m.trial.draw < 30 else m for m in data]
    metric = Coverage().evaluate(data, CONTESTANT, ALARM, ())
    part = next(part for part in metric.parts if part.label == "p2 bandwidth")
    assert part.draws == 70
    assert part.passed
    without = [replace(m, bandwidth_ci95=None) for m in data]
    metric = Coverage().evaluate(without, CONTESTANT, ALARM, ())
    part = next(part for part in metric.parts if part.label == "p2 bandwidth")
    assert part.passed is None
    assert "no interval of the bandwidth" in part.why


def test_an_error_at_one_frequency_is_found_there() -> None:
    data = []
    for m in measured(Fault()):
        assert m.response is not None and m.response_covariance is not None
        response = m.response.copy()
        response[7, 0, 0] += 2.0 * np.sqrt(np.trace(m.response_covariance[7, 0, 0]))
        data.append(replace(m, response=response))
    metric = ResponseError().evaluate(data, CONTESTANT, ALARM, ())
    assert metric.passed is False
    failed = [part.label for part in metric.parts if part.passed is False]
    assert {"p2 at", "p3 at", "p4 at", "p5 at"} <= {label[:5] for label in failed}
    assert not {"p2", "p3", "p4", "p5"} & set(failed)


def test_curves_for_drawing() -> None:
    curve = ResponseError().evaluate(measured(Fault(claimed=4.0)), CONTESTANT, ALARM, ()).curves["p3"]
    assert np.shape(curve["truth"]) == np.shape(curve["error"]) == np.shape(curve["claimed"]) == (16, 1, 1)
    assert np.array(curve["claimed"]) == pytest.approx(2.0 * np.array(curve["bound"]))
    assert np.array(curve["error"]) == pytest.approx(np.array(curve["bound"]), rel=0.5)
    silent = ResponseError().evaluate(measured(Fault(claimed_share=0.0, gain=1.5)), CONTESTANT, ALARM, ())
    assert silent.curves["p2"]["claimed"] is None
    assert silent.curves["p2"]["relative_error_percent"] == pytest.approx(50.0, abs=1.0)
    assert "50 % on p2" in silent.why


def test_efforts() -> None:
    assert set(accuracy_trials("quick")) < set(accuracy_trials("full"))
    with pytest.raises(ScenarioError, match="quick"):
        accuracy_trials("long")


CONVERGENCE_AND_CLAIMS: tuple[MetricDefinition, ...] = (
    NoiseFreeRecovery(),
    Consistency(),
    Efficiency(),
    Coverage(),
    NormalisedError(),
    ResponseError(),
)


RUNS = 1


def verdicts(fault: str, seed: int) -> dict[str, bool | None]:
    rng = np.random.default_rng(seed)
    out = {}
    accuracy = simulated(Efficiency().trials("quick"), FAULTS[fault], rng)
    for definition in CONVERGENCE_AND_CLAIMS:
        shared = definition.trials("quick") == Efficiency().trials("quick")
        measured = accuracy if shared else simulated(definition.trials("quick"), FAULTS[fault], rng)
        out[definition.name] = definition.evaluate(measured, CONTESTANT, false_alarm_of_each(), ()).passed
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


OBSERVER = Estimator("simulated", "bench:perfect", method="observer")
LEAST_SQUARES = Estimator("simulated", "bench:perfect", method="least_squares", structure="arx")
PEM_OUTPUT_ERROR = Estimator("simulated", "bench:perfect", method="pem", structure="oe")
CLAIMS: tuple[MetricDefinition, ...] = (Coverage(), NormalisedError(), ResponseError())


def measured_on(fault: Fault, name: str = "") -> list[Measurement]:
    trials = [trial for trial in accuracy_trials("quick") if name in ("", trial.problem)]
    return simulated(trials, fault, np.random.default_rng(7))


def passes(contestant: Estimator, name: str, data: Sequence[Measurement]) -> bool:
    return expected_of_claims(contestant, name, data, "coverage").passes


@pytest.mark.parametrize("definition", CLAIMS, ids=lambda definition: definition.name)
def test_an_overconfident_estimator_does_not_hide_behind_a_method(definition: MetricDefinition) -> None:
    data = measured_on(Fault(claimed=0.5))
    metric = definition.evaluate(data, OBSERVER, ALARM, ())
    assert metric.passed is False
    assert any("no bias that would excuse" in part.why for part in metric.parts if part.surprises)
    assert Efficiency().evaluate(data, OBSERVER, ALARM, ()).passed is None


@pytest.mark.parametrize("definition", CLAIMS, ids=lambda definition: definition.name)
def test_a_bias_excuses(definition: MetricDefinition) -> None:
    metric = definition.evaluate(measured_on(Fault(gain=1.05)), OBSERVER, ALARM, ())
    assert metric.passed is None
    assert any(part.passed is False for part in metric.parts)


def test_a_wrong_disturbance_excuses_beyond_the_bound_only() -> None:
    assert passes(LEAST_SQUARES, "p2", measured_on(Fault(), "p2"))
    assert not passes(LEAST_SQUARES, "p2", measured_on(Fault(variance=2.0), "p2"))
    assert passes(OBSERVER, "p2", measured_on(Fault(variance=2.0), "p2"))
    # white intervals under a coloured disturbance are wrong, efficient or not
    assert not passes(PEM_OUTPUT_ERROR, "p3", measured_on(Fault(), "p3"))


def test_bias_is_free_of_scatter() -> None:
    assert abs(greatest_bias(measured_on(Fault(), "p3"), "p3", None)) < 0.06
    assert greatest_bias(measured_on(Fault(gain=2.0), "p3"), "p3", None) > 0.9
    assert np.isnan(greatest_bias(measured_on(Fault(), "p3")[:1], "p3", None))
    assert np.isnan(greatest_bias([], "p3", None))


@pytest.mark.parametrize(
    ("values", "run", "passed", "why"),
    [
        (1, 1, None, "no verdict: 1 of 1 records have a value, at least 2 are needed"),
        (4, 9, None, "no verdict: 4 of 9 records have a value, at least 5 are needed"),
        (5, 9, True, ""),
    ],
)
def test_how_many_records_are_needed(values: int, run: int, passed: bool | None, why: str) -> None:
    single = np.linspace(0.0, 2.0, 101)
    statistic = RecordStatistic("p1", np.ones(values), run, single, Expectation(True))
    part = statistic.part(Acceptance(expected=1.0), 0.01)
    assert (part.passed, part.why) == (passed, why)
