"""Efficiency, claims and agreement with a second implementation, of perfect and faulty estimators."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.bench.accuracy import QUICK, Agreement, Efficiency
from scenarios.bench.claimed_accuracy import Coverage, NormalisedError, ResponseError
from scenarios.bench.consistency import Consistency, NoiseFreeRecovery
from scenarios.bench.metric import Evidence
from scenarios.bench.metrics import false_alarm_of_each
from scenarios.bench.null_distributions import bound_for
from scenarios.bench.theory import expected_of_claims, greatest_bias
from scenarios.estimators.estimator import Estimator
from scenarios.files.errors import ScenarioError
from tests.scenarios.bench.judging import ALARM, ANYONE, evaluated, failing, parts_of, without_model
from tests.scenarios.bench.simulated import FAULTS, HONEST, Fault, simulated

OUTPUT_ERROR = Estimator("simulated", ":perfect", structure="oe", method="pem")
OBSERVER = Estimator("simulated", ":perfect", method="observer")
LEAST_SQUARES = Estimator("simulated", ":perfect", method="least_squares", structure="arx")
CLAIMS = (Coverage(), NormalisedError(), ResponseError())
each_metric = pytest.mark.parametrize("definition", (Efficiency(), *CLAIMS), ids=lambda one: one.name)


def measured(fault=Fault(), records=100, name="", seed=11):  # noqa: B008
    trials = [t for t in Efficiency().trials("quick") if t.draw < records and name in ("", t.problem)]
    return simulated(trials, fault, np.random.default_rng(seed))


@pytest.mark.slow
@each_metric
def test_records_without_model_are_left_out_until_they_are_most(definition):
    data = measured(records=40)
    assert evaluated(definition, without_model(data, lambda m: m.trial.draw < 20)).passed
    none = evaluated(definition, without_model(data, lambda m: m.trial.draw < 21))
    assert none.passed is None and "19 of 40 records" in none.why
    one = evaluated(definition, measured(records=1))
    assert one.passed is None and "1 of 1 records have a value, at least 2 are needed" in one.why


@each_metric
def test_the_share_of_false_alarms_is_that_of_its_verdicts(definition):
    metric = evaluated(definition, measured(records=10))
    assert metric.false_alarm == pytest.approx(definition.verdicts * ALARM)
    assert sum(part.passed is not None for part in metric.parts) <= definition.verdicts


def test_expected_failures_fail_no_metric():
    coloured = [m for m in measured(Fault(variance=9.0)) if m.trial.problem != "p2"]
    data = [m for m in measured() if m.trial.problem == "p2"] + coloured
    metric = evaluated(Efficiency(), data, OUTPUT_ERROR)
    assert metric.passed
    assert {part.label: part.passed for part in metric.parts} == {"p2": True, "p3": False, "p4": False, "p5": False}
    assert "not efficient" in metric.why
    assert evaluated(Efficiency(), data).passed is False
    # nothing is left to judge where theory expects nothing to pass
    assert evaluated(Efficiency(), coloured, OUTPUT_ERROR).passed is None


def test_a_loss_too_small_for_any_problem_is_seen_in_all_together():
    metric = evaluated(Efficiency(), measured(Fault(variance=1.3)))
    assert metric.passed is False
    assert failing(metric) == {"together"}


def test_why_parameters_have_no_coverage():
    data = [replace(m, covered=-1) for m in measured(records=20)]
    parts = parts_of(evaluated(Coverage(), data, OUTPUT_ERROR))
    assert "no oe model is the truth" in parts["p3 parameters"].why
    assert "not those of the orders that were asked" in parts["p2 parameters"].why
    silent = parts_of(evaluated(Coverage(), [replace(m, parameters=0) for m in data], OUTPUT_ERROR))
    assert "claims no interval of the parameters" in silent["p3 parameters"].why


@pytest.mark.parametrize("claimed", [1.0, 0.5])
@pytest.mark.parametrize("kind", ["parameters", "response"])
def test_the_normalised_error_and_its_distribution(claimed, kind):
    data = measured(Fault(claimed=claimed))
    if kind == "response":  # judged where no parameters are claimed
        data = [replace(m, normalised_error=np.nan, covered=-1) for m in data]
    metric = evaluated(NormalisedError(), data)
    assert metric.passed is (claimed == 1.0)
    assert metric.curves["p4"]["of"] == kind
    assert metric.curves["p4"]["degrees_of_freedom"] == (8 if kind == "parameters" else None)
    assert (metric.curves["p4"]["kolmogorov_smirnov_p"] > 1e-4) is (claimed == 1.0)


def test_an_infinite_normalised_error_fails():
    data = measured()
    data[3] = replace(data[3], normalised_error=np.inf)
    metric = evaluated(NormalisedError(), data)
    assert (metric.passed, metric.value) == (False, np.inf)


def test_unknown_and_malformed_covariances():
    data = measured(records=30)

    def without(records):
        unknown = np.full((16, 1, 1, 2, 2), np.nan)
        return [replace(m, response_covariance=unknown) if m.trial.draw < records else m for m in data]

    one, most = (evaluated(ResponseError(), without(records)) for records in (1, 16))
    assert (one.passed, one.parts[0].draws) == (True, 29)
    assert most.passed is False
    assert "claimed of 14 of 30 records" in most.parts[0].why
    data[0] = replace(data[0], response_covariance=np.zeros((16, 2, 2)))
    with pytest.raises(ScenarioError, match="expected"):
        evaluated(ResponseError(), data)


def test_bandwidths_without_interval_are_not_counted():
    unknown = np.full((2, 1, 1), np.nan)
    some = [replace(m, bandwidth_ci95=unknown) if m.trial.draw < 30 else m for m in measured()]
    without_bandwidth = [replace(m, bandwidth_hz=unknown[0]) if m.trial.draw < 30 else m for m in some]
    without_interval = [replace(m, bandwidth_ci95=None) for m in some]
    each = (some, without_bandwidth, without_interval)
    selective, fair, silent = (parts_of(evaluated(Coverage(), data))["p2 bandwidth"] for data in each)
    assert selective.passed is False and "claimed of 70 of 100 records" in selective.why
    assert (fair.passed, fair.draws) == (True, 70)
    assert silent.passed is None and "no interval of the bandwidth" in silent.why


def test_an_error_at_one_frequency_is_seen_there():
    data = []
    for m in measured():
        response = m.response.copy()
        response[7, 0, 0] += 2.0 * np.sqrt(np.trace(m.response_covariance[7, 0, 0]))
        data.append(replace(m, response=response))
    metric = evaluated(ResponseError(), data)
    assert metric.passed is False
    assert {"p2 at", "p3 at", "p4 at", "p5 at"} <= {label[:5] for label in failing(metric)}
    assert not {"p2", "p3", "p4", "p5"} & failing(metric)


def test_curves_for_drawing():
    curve = evaluated(ResponseError(), measured(Fault(claimed=4.0))).curves["p3"]
    assert np.shape(curve["truth"]) == np.shape(curve["error"]) == np.shape(curve["claimed"]) == (16, 1, 1)
    assert np.array(curve["claimed"]) == pytest.approx(2.0 * np.array(curve["bound"]))
    assert np.array(curve["error"]) == pytest.approx(np.array(curve["bound"]), rel=0.5)
    silent = evaluated(ResponseError(), measured(Fault(claimed_share=0.0, gain=1.5)))
    assert silent.curves["p2"]["claimed"] is None
    assert silent.curves["p2"]["relative_error_percent"] == pytest.approx(50.0, abs=1.0)
    assert "50 % on p2" in silent.why


def test_the_full_effort_holds_the_quick_one():
    for definition in (Efficiency(), Consistency()):
        assert set(definition.trials("quick")) < set(definition.trials("full"))


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_fails_the_metrics_that_should_see_it_and_no_other(name):
    fault, fails = FAULTS[name]
    rng = np.random.default_rng(name == "claims nothing")
    accuracy = simulated(Efficiency().trials("quick"), fault, rng)
    verdicts = {}
    for definition in (NoiseFreeRecovery(), Consistency(), Efficiency(), *CLAIMS):
        shared = definition.trials("quick") == Efficiency().trials("quick")
        data = accuracy if shared else simulated(definition.trials("quick"), fault, rng)
        verdicts[definition.name] = definition.evaluate(Evidence(data, ANYONE, false_alarm_of_each())).passed
    assert {name for name, passed in verdicts.items() if passed is False} == fails
    # who claims nothing has no verdict on claims
    unjudged = HONEST if name == "claims nothing" else frozenset()
    assert {name for name, passed in verdicts.items() if passed is None} == unjudged


@pytest.mark.slow
@pytest.mark.parametrize("definition", CLAIMS, ids=lambda definition: definition.name)
def test_only_a_bias_excuses_the_claims_of_a_biased_method(definition):
    overconfident = measured(Fault(claimed=0.5), seed=7)
    metric = evaluated(definition, overconfident, OBSERVER)
    assert metric.passed is False
    assert any("no bias that would excuse" in part.why for part in metric.parts if part.surprises)
    assert evaluated(Efficiency(), overconfident, OBSERVER).passed is None
    excused = evaluated(definition, measured(Fault(gain=1.05), seed=7), OBSERVER)
    assert excused.passed is None and failing(excused)


@pytest.mark.parametrize(
    ("estimator", "name", "variance", "passes"),
    [
        # a wrong disturbance excuses beyond the bound only
        (LEAST_SQUARES, "p2", 1.0, True),
        (LEAST_SQUARES, "p2", 2.0, False),
        (OBSERVER, "p2", 2.0, True),
        # white intervals under a coloured disturbance are wrong, efficient or not
        (OUTPUT_ERROR, "p3", 1.0, False),
    ],
)
def test_expected_claims(estimator, name, variance, passes):
    data = measured(Fault(variance=variance), name=name, seed=7)
    assert expected_of_claims(estimator, name, data, "coverage").passes is passes


def test_bias_is_free_of_scatter():
    data = measured(name="p3", seed=7)
    assert abs(greatest_bias(data, "p3", None)) < 0.06
    assert greatest_bias(measured(Fault(gain=2.0), name="p3", seed=7), "p3", None) > 0.9
    assert np.isnan(greatest_bias(data[:1], "p3", None))


def second(seed, fault=Fault()):  # noqa: B008
    return simulated(Agreement().trials("quick"), fault, np.random.default_rng(seed))


def agreement(own, theirs, estimator=ANYONE):
    return evaluated(Agreement(), own, estimator, theirs)


def test_differences_are_counted_in_variances():
    """None of the same errors, two of independent ones, four of opposite ones."""
    one = second(1)
    assert agreement(one, second(1)).curves["digits"] == dict.fromkeys(QUICK, 16.0)
    mirrored = [replace(m, response=2.0 * bound_for(m.trial.problem, None).response - m.response) for m in one]
    for theirs, variances, tolerance in ((second(1), 0.0, 0.0), (second(2), 2.0, 0.5), (mirrored, 4.0, 1.0)):
        compared = agreement(one, theirs)
        assert np.mean([part.value for part in compared.parts]) == pytest.approx(variances, abs=tolerance)
        assert compared.passed


def test_errors_beyond_that_fail_where_efficiency_is_expected():
    late = agreement(second(1, Fault(delay=1)), second(2))
    assert late.passed is False and late.value > 10.0
    late = agreement(second(1, Fault(delay=1)), second(2), LEAST_SQUARES)
    assert late.passed is False
    assert {part.label for part in late.parts if part.theory} == {"p5"}
    assert [part.label for part in late.parts if part.surprises] == ["p5"]


def test_a_second_implementation_that_errs_itself_is_not_believed():
    theirs = second(2)
    theirs[0] = replace(theirs[0], response=100.0 * theirs[0].response)
    compared = agreement(second(1), theirs)
    assert compared.passed
    assert [part.draws for part in compared.parts] == [19, 20, 20, 20]


def test_half_of_the_records_are_enough_to_compare():
    one, other = second(1), second(2)
    assert agreement(without_model(one, lambda m: m.trial.draw < 10), other).passed
    assert agreement(without_model(one, lambda m: m.trial.draw < 11), other).passed is None
    failed = without_model(one, lambda m: True)
    for own, theirs in ((one, []), ([], one), (failed, one), (one, failed)):
        nothing = agreement(own, theirs)
        assert nothing.passed is None and np.isnan(nothing.value)
