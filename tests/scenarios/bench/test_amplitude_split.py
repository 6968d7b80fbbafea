from zlib import crc32

import numpy as np
import pytest

from scenarios.bench.amplitude_split import ALLOWED, AMPLITUDES, JOINTS, AmplitudeSplit
from scenarios.bench.measurement import Measurement
from scenarios.estimators.estimator import Estimator
from scenarios.files.errors import ScenarioError

FIGURE = AmplitudeSplit()
TRIALS = FIGURE.trials("quick")
LINES = np.arange(1, 26) / 5.12
LINEAR = 1.0 / (1.0 + 1j * LINES) ** 2
ONE = Estimator("one", "module:one")
ALARM = 1e-4


def measured(change=lambda response: response, trials=TRIALS):
    made = []
    for trial in trials:
        wave = np.random.default_rng(crc32(trial.problem.encode()))
        noise = np.random.default_rng(crc32(trial.key.encode()))
        distortion, error = (rng.standard_normal((25, 2)) @ (1, 1j) for rng in (wave, noise))
        shown = LINEAR + 0.02 * distortion + 0.005 * error
        response = change(0.5 * (LINEAR + shown))
        made.append(Measurement(trial, "model", response=response[:, None, None], nonparametric=shown[:, None, None]))
    return made


def figure(outcomes, contestant=ONE):
    return FIGURE.evaluate(outcomes, contestant, ALARM, ())


def test_every_joint_and_amplitude_has_waveforms_and_repeats_of_some():
    names = [trial.problem for trial in TRIALS]
    assert len(set(names)) == len(JOINTS) * len(AMPLITUDES["quick"]) * 8
    assert len(TRIALS) == len(set(TRIALS)) > len(set(names))
    assert len(FIGURE.trials("full")) > 10 * len(TRIALS)
    assert set(AMPLITUDES["quick"]) | set(AMPLITUDES["full"]) == set(ALLOWED)
    assert FIGURE.verdicts == len(JOINTS) * len(ALLOWED)
    with pytest.raises(ScenarioError, match="quick"):
        FIGURE.trials("half")


def test_an_estimator_without_systematic_error_passes_and_its_scatter_is_split():
    found = figure(measured())
    judged = [part for part in found.parts if part.passed is not None]
    assert found.passed is True
    assert len(judged) == len(JOINTS) * len(AMPLITUDES["quick"])
    assert found.false_alarm == pytest.approx(len(judged) * ALARM)
    for joint in JOINTS:
        curve = found.curves[joint]
        assert curve["mrad"] == list(AMPLITUDES["quick"])
        np.testing.assert_allclose(curve["distortion"], np.array(curve["expected_distortion"]) / 2.0, rtol=1e-6)
        np.testing.assert_allclose(curve["noise"], np.array(curve["expected_noise"]) / 2.0, rtol=1e-6)


def test_a_delay_of_one_sample_fails_at_every_joint():
    turned = np.exp(-2j * np.pi * LINES * 0.02)
    found = figure(measured(lambda response: response * turned))
    assert found.passed is False
    assert all(part.passed is False for part in found.parts if part.label.endswith("systematic"))


def test_an_error_that_theory_expects_is_told_and_does_not_fail():
    turned = np.exp(-2j * np.pi * LINES * 0.02)
    found = figure(measured(lambda response: response * turned), Estimator("arx", "a:b", method="least_squares"))
    assert found.passed is None
    assert "equation error" in found.why


def test_the_sequence_of_the_trials_does_not_matter():
    outcomes = measured()
    assert figure(outcomes) == figure(outcomes[::-1])


@pytest.mark.parametrize("outcomes", [[], [Measurement(trial, "crash", "it died") for trial in TRIALS]])
def test_without_any_model_there_is_no_verdict(outcomes):
    found = figure(outcomes)
    assert found.passed is None
    assert np.isnan(found.value)
    assert "no verdict" in found.why
    assert found.curves == {}


def test_with_fewer_than_half_of_the_waveforms_there_is_no_verdict_on_a_class():
    outcomes = measured()
    gone = f"{JOINTS[0]}-multisine-5mrad"
    kept = [
        Measurement(m.trial, "hang") if gone in m.trial.problem and m.trial.problem[-1] in "34567" else m
        for m in outcomes
    ]
    found = figure(kept)
    assert found.passed is True
    assert [part.label for part in found.parts if "no verdict" in part.why] == [f"{JOINTS[0]} 5 mrad"]
    assert found.curves[JOINTS[0]]["mrad"] == [10, 40]


def test_scatter_that_hides_what_should_fail_is_no_pass():
    rng = np.random.default_rng(4)
    wild = measured(lambda response: response * (1.2 + 0.5 * rng.standard_normal() + 0.5j * rng.standard_normal()))
    parts = [part for part in figure(wild).parts if part.label.endswith("systematic")]
    assert parts
    assert not any(part.passed for part in parts)
    assert any("scatter is too large" in part.why for part in parts)
    told = [part for part in figure(measured()).parts if part.passed]
    assert all(f"at most {part.limits[1]:.3g} %" in part.why for part in told)
