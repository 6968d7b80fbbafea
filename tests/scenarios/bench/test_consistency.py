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
from tests.scenarios.bench.judging import evaluated, without_model
from tests.scenarios.bench.simulated import Fault, simulated


def measured(definition, fault=Fault()):  # noqa: B008
    return simulated(definition.trials("quick"), fault, np.random.default_rng(1))


@pytest.mark.parametrize("name", ["p2", "p3"])
def test_slopes_of_perfect_estimators_are_minus_a_half(name):
    assert np.mean(perfect_slopes(name, None, LENGTHS, (RECORDS,) * 3)) == pytest.approx(-0.5, abs=0.02)


def test_the_slope_knows_no_scale():
    plain, scaled, biased = (
        evaluated(Consistency(), measured(Consistency(), fault))
        for fault in (Fault(), Fault(variance=10.0), Fault(gain=2.0))
    )
    assert plain.passed
    assert [part.value for part in scaled.parts] == pytest.approx([part.value for part in plain.parts])
    assert biased.passed is False
    assert biased.value == pytest.approx(0.0, abs=0.02)


def test_too_few_models_of_one_length_leave_no_verdict():
    some = without_model(measured(Consistency()), lambda m: m.trial.problem == "p3@4000" and m.trial.draw > 8)
    metric = evaluated(Consistency(), some)
    assert [part.passed for part in metric.parts] == [True, None]
    assert "9 of 20 at 4000" in metric.parts[1].why


def without_noise(gain):
    return measured(NoiseFreeRecovery(), Fault(gain=gain))


@pytest.mark.parametrize(
    ("gain", "digits", "passed"), [(1.0, MOST_DIGITS, True), (1.0 + 1e-8, 8.0, True), (1.02, 1.7, False)]
)
def test_digits(gain, digits, passed):
    metric = evaluated(NoiseFreeRecovery(), without_noise(gain))
    assert metric.passed is passed
    assert metric.value == pytest.approx(digits, abs=0.01)
    assert np.array(metric.curves["digits"]) == pytest.approx(np.full((6, 3), digits), abs=0.01)
    # a fault that all failing systems have in common is named
    fault = "" if passed else "the response is 1.02 times the truth"
    assert {part.why for part in metric.parts} == {fault}
    assert metric.why.endswith(f"; where it fails, {fault}") is not passed


def test_the_worst_system_stands_for_all_and_different_faults_have_no_common_name():
    data = without_noise(1.0)
    data[4] = replace(data[4], response=data[4].response * (1.0 + 1e-3))
    metric = evaluated(NoiseFreeRecovery(), data)
    assert metric.passed is False
    assert metric.value == metric.curves["digits"][1][1] == pytest.approx(3.0, abs=0.01)
    data = without_noise(1.02)
    data[4] = replace(data[4], response=-data[4].response)
    assert "where it fails" not in evaluated(NoiseFreeRecovery(), data).why


def test_systems_without_model_are_left_out_until_they_are_most():
    data = without_noise(1.0)
    half, most = (without_model(data, lambda m, n=n: m in data[:n]) for n in (9, 10))
    assert evaluated(NoiseFreeRecovery(), half).passed
    metric = evaluated(NoiseFreeRecovery(), most)
    assert metric.passed is None and "8 of 18" in metric.why


DT = 0.02
F = np.array([0.1, 0.5, 2.0, 8.0, 20.0])


def response(b):
    return sysid.models.innovations_form(sysid.Polynomials(A=[1.0, -1.5, 0.7], B=b), DT).frequency_response(F)


TRUE = response([0.0, 0.2, 0.1])


@pytest.mark.parametrize(
    ("responses", "fault"),
    [
        ([response([0.0, 0.0, 0.0, 0.2, 0.1])] * 2, "2 samples late"),
        ([response([0.2, 0.1])] * 2, "1 sample early"),
        ([-TRUE] * 2, "of the wrong sign"),
        ([1.00001 * TRUE] * 2, "1.00001 times the truth"),
        ([response([0.0, 0.2, 0.11])] * 2, ""),
        # all responses must have it
        ([-TRUE, TRUE], ""),
        ([1.02 * TRUE, 1.03 * TRUE], ""),
    ],
)
def test_familiar_faults_are_named(responses, fault):
    assert recognised_fault(responses, TRUE, F, DT, 1e-6) == fault
