"""The split of errors over amplitude."""

import numpy as np
import pytest

from scenarios.bench.amplitude_split import ALLOWED, AMPLITUDES, JOINTS, AmplitudeSplit
from scenarios.bench.measurement import Measurement
from scenarios.estimators.estimator import Estimator
from tests.scenarios.bench.judging import ALARM, ANYONE, LINES, evaluated, on_arm, without_model

TRIALS = AmplitudeSplit().trials("quick")


def measured(change=lambda response: response):
    return [on_arm(trial, change) for trial in TRIALS]


def metric(data, estimator=ANYONE):
    return evaluated(AmplitudeSplit(), data, estimator)


def systematic(metric):
    return [part for part in metric.parts if part.label.endswith("systematic")]


def test_every_joint_and_amplitude_has_waveforms_and_repeats_of_some():
    names = [trial.problem for trial in TRIALS]
    assert len(set(names)) == len(JOINTS) * len(AMPLITUDES["quick"]) * 8
    assert len(TRIALS) == len(set(TRIALS)) > len(set(names))
    assert len(AmplitudeSplit().trials("full")) > 10 * len(TRIALS)
    assert set(AMPLITUDES["quick"]) | set(AMPLITUDES["full"]) == set(ALLOWED)
    assert AmplitudeSplit().verdicts == len(JOINTS) * len(ALLOWED)


def test_an_estimator_without_systematic_error_passes_and_its_scatter_is_split():
    passing = metric(measured())
    assert passing.passed is True
    judged = [part for part in passing.parts if part.passed is not None]
    assert len(judged) == len(JOINTS) * len(AMPLITUDES["quick"])
    assert passing.false_alarm == pytest.approx(len(judged) * ALARM)
    assert all(f"at most {part.limits[1]:.3g} %" in part.why for part in judged)
    for joint in JOINTS:
        curve = passing.curves[joint]
        assert curve["mrad"] == list(AMPLITUDES["quick"])
        for kind in ("distortion", "noise"):
            np.testing.assert_allclose(curve[kind], np.array(curve[f"expected_{kind}"]) / 2.0, rtol=1e-6)


def test_a_delay_of_one_sample_fails_at_every_joint_where_theory_expects_none():
    late = measured(lambda response: response * np.exp(-2j * np.pi * LINES * 0.02))
    failing = metric(late)
    assert failing.passed is False
    assert all(part.passed is False for part in systematic(failing))
    excused = metric(late, Estimator("arx", "a:b", method="least_squares"))
    assert excused.passed is None
    assert "equation error" in excused.why


def test_the_sequence_of_the_trials_does_not_matter():
    assert metric(measured()) == metric(measured()[::-1])


@pytest.mark.parametrize("data", [[], [Measurement(trial, "crash", "it died") for trial in TRIALS]])
def test_without_any_model_there_is_no_verdict(data):
    nothing = metric(data)
    assert nothing.passed is None and np.isnan(nothing.value) and "no verdict" in nothing.why
    assert nothing.curves == {}


def test_with_fewer_than_half_of_the_waveforms_there_is_no_verdict_on_a_class():
    gone = f"{JOINTS[0]}-multisine-5mrad"
    some = without_model(measured(), lambda m: gone in m.trial.problem and m.trial.problem[-1] in "34567")
    passing = metric(some)
    assert passing.passed is True
    assert [part.label for part in passing.parts if "no verdict" in part.why] == [f"{JOINTS[0]} 5 mrad"]
    assert passing.curves[JOINTS[0]]["mrad"] == [10, 40]


def test_scatter_that_hides_failures_is_no_pass():
    rng = np.random.default_rng(4)
    wild = measured(lambda response: response * (1.2 + 0.5 * rng.standard_normal() + 0.5j * rng.standard_normal()))
    parts = systematic(metric(wild))
    assert parts and not any(part.passed for part in parts)
    assert any("the estimates scatter too much" in part.why for part in parts)
