"""Efficiency, coverage, normalised error and frequency response where something is missing or theory speaks."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.bench.accuracy import Efficiency, accuracy_trials
from scenarios.bench.claims import Coverage, FrequencyResponse, NormalisedError
from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import MetricDefinition
from scenarios.estimators.estimator import Estimator
from scenarios.files.errors import ScenarioError
from tests.benchmarks.simulated_estimators import Fault, simulated

CONTESTANT = Estimator("simulated", "bench:perfect")
OUTPUT_ERROR = Estimator("simulated", "bench:perfect", structure="oe", method="pem")
MAKERS: tuple[MetricDefinition, ...] = (Efficiency(), Coverage(), NormalisedError(), FrequencyResponse())
ALARM = 1e-4


def measured(fault: Fault, *, records: int = 100) -> list[Measurement]:
    trials = [trial for trial in accuracy_trials("quick") if trial.draw < records]
    return simulated(trials, fault, np.random.default_rng(11))


@pytest.mark.parametrize("maker", MAKERS, ids=lambda maker: maker.name)
def test_records_without_model_are_left_out_until_they_are_most(maker: MetricDefinition) -> None:
    data = measured(Fault(), records=40)
    half = [Measurement(m.trial, "error", "none") if m.trial.draw < 20 else m for m in data]
    more = [Measurement(m.trial, "error", "none") if m.trial.draw < 21 else m for m in data]
    assert maker.evaluate(half, CONTESTANT, ALARM, ()).passed
    none = maker.evaluate(more, CONTESTANT, ALARM, ())
    assert none.passed is None
    assert "19 of 40 records" in none.why
    assert maker.evaluate([], CONTESTANT, ALARM, ()).passed is None


@pytest.mark.parametrize("maker", MAKERS, ids=lambda maker: maker.name)
def test_the_share_of_false_alarms_is_that_of_its_verdicts(maker: MetricDefinition) -> None:
    figure = maker.evaluate(measured(Fault(), records=10), CONTESTANT, ALARM, ())
    assert figure.false_alarm == pytest.approx(maker.verdicts * ALARM)
    assert sum(part.passed is not None for part in figure.parts) <= maker.verdicts


def test_what_theory_expects_to_fail_fails_no_figure() -> None:
    coloured = [m for m in measured(Fault(variance=9.0)) if m.trial.problem != "p2"]
    data = [m for m in measured(Fault()) if m.trial.problem == "p2"] + coloured
    figure = Efficiency().evaluate(data, OUTPUT_ERROR, ALARM, ())
    assert figure.passed
    assert {part.label: part.passed for part in figure.parts} == {"p2": True, "p3": False, "p4": False, "p5": False}
    assert "not efficient" in figure.why
    assert Efficiency().evaluate(data, CONTESTANT, ALARM, ()).passed is False
    # nothing is left to judge where theory expects nothing to pass
    assert Efficiency().evaluate(coloured, OUTPUT_ERROR, ALARM, ()).passed is None


def test_a_single_part_between_others_is_found_together() -> None:
    figure = Efficiency().evaluate(measured(Fault(variance=1.3)), CONTESTANT, ALARM, ())
    assert figure.passed is False
    assert [part.label for part in figure.parts if part.passed is False] == ["together"]


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
    figure = NormalisedError().evaluate(data, CONTESTANT, ALARM, ())
    assert figure.passed is False
    assert figure.curves["p2"]["of"] == "response"
    honest = [replace(m, normalised_error=np.nan, covered=-1) for m in measured(Fault())]
    figure = NormalisedError().evaluate(honest, CONTESTANT, ALARM, ())
    assert figure.passed
    assert figure.curves["p2"]["kolmogorov_smirnov_p"] > 1e-4


def test_the_distribution_of_the_normalised_error_is_told() -> None:
    for claimed, fits in ((1.0, True), (0.5, False)):
        figure = NormalisedError().evaluate(measured(Fault(claimed=claimed)), CONTESTANT, ALARM, ())
        assert figure.curves["p4"]["degrees_of_freedom"] == 8
        assert (figure.curves["p4"]["kolmogorov_smirnov_p"] > 1e-4) is fits


def test_an_infinite_normalised_error_fails() -> None:
    data = measured(Fault())
    data[3] = replace(data[3], normalised_error=np.inf)
    figure = NormalisedError().evaluate(data, CONTESTANT, ALARM, ())
    assert figure.passed is False
    assert figure.value == np.inf


def test_covariances_that_are_not_known_are_not_counted() -> None:
    data = measured(Fault(), records=30)
    unknown = np.full((16, 1, 1, 2, 2), np.nan)
    one = [replace(m, response_covariance=unknown) if m.trial.draw == 0 else m for m in data]
    most = [replace(m, response_covariance=unknown) if m.trial.draw < 16 else m for m in data]
    figure = FrequencyResponse().evaluate(one, CONTESTANT, ALARM, ())
    assert figure.passed
    assert figure.parts[0].draws == 29
    chosen = FrequencyResponse().evaluate(most, CONTESTANT, ALARM, ())
    assert chosen.passed is False
    assert "claimed of 14 of 30 records" in chosen.parts[0].why


def test_a_covariance_of_another_shape_is_an_error() -> None:
    data = measured(Fault(), records=2)
    data[0] = replace(data[0], response_covariance=np.zeros((16, 2, 2)))
    with pytest.raises(ScenarioError, match="expected"):
        FrequencyResponse().evaluate(data, CONTESTANT, ALARM, ())


def test_bandwidths_without_interval_are_not_counted() -> None:
    unknown = np.full((2, 1, 1), np.nan)
    data = [replace(m, bandwidth_ci95=unknown) if m.trial.draw < 30 else m for m in measured(Fault())]
    figure = Coverage().evaluate(data, CONTESTANT, ALARM, ())
    part = next(part for part in figure.parts if part.label == "p2 bandwidth")
    assert part.passed is False and "claimed of 70 of 100 records" in part.why
    data = [replace(m, bandwidth_hz=unknown[0]) if m.trial.draw < 30 else m for m in data]
    figure = Coverage().evaluate(data, CONTESTANT, ALARM, ())
    part = next(part for part in figure.parts if part.label == "p2 bandwidth")
    assert part.draws == 70
    assert part.passed
    without = [replace(m, bandwidth_ci95=None) for m in data]
    figure = Coverage().evaluate(without, CONTESTANT, ALARM, ())
    part = next(part for part in figure.parts if part.label == "p2 bandwidth")
    assert part.passed is None
    assert "no interval of the bandwidth" in part.why


def test_an_error_at_one_frequency_is_found_there() -> None:
    data = []
    for m in measured(Fault()):
        assert m.response is not None and m.response_covariance is not None
        response = m.response.copy()
        response[7, 0, 0] += 2.0 * np.sqrt(np.trace(m.response_covariance[7, 0, 0]))
        data.append(replace(m, response=response))
    figure = FrequencyResponse().evaluate(data, CONTESTANT, ALARM, ())
    assert figure.passed is False
    failed = [part.label for part in figure.parts if part.passed is False]
    assert {"p2 at", "p3 at", "p4 at", "p5 at"} <= {label[:5] for label in failed}
    assert not {"p2", "p3", "p4", "p5"} & set(failed)


def test_curves_for_drawing() -> None:
    curve = FrequencyResponse().evaluate(measured(Fault(claimed=4.0)), CONTESTANT, ALARM, ()).curves["p3"]
    assert np.shape(curve["truth"]) == np.shape(curve["error"]) == np.shape(curve["claimed"]) == (16, 1, 1)
    assert np.array(curve["claimed"]) == pytest.approx(2.0 * np.array(curve["bound"]))
    assert np.array(curve["error"]) == pytest.approx(np.array(curve["bound"]), rel=0.5)
    silent = FrequencyResponse().evaluate(measured(Fault(claimed_share=0.0, gain=1.5)), CONTESTANT, ALARM, ())
    assert silent.curves["p2"]["claimed"] is None
    assert silent.curves["p2"]["relative_error_percent"] == pytest.approx(50.0, abs=1.0)
    assert "50 % on p2" in silent.why


def test_efforts() -> None:
    assert set(accuracy_trials("quick")) < set(accuracy_trials("full"))
    with pytest.raises(ScenarioError, match="quick"):
        accuracy_trials("long")
