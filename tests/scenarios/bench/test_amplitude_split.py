"""The split of errors over amplitude."""

from zlib import crc32

import numpy as np
import pytest

from scenarios.bench.amplitude_split import ALLOWED, AMPLITUDES, JOINTS, AmplitudeSplit, scatter_of, systematic_of
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


def metric(outcomes, contestant=ONE):
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
    found = metric(measured())
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
    found = metric(measured(lambda response: response * turned))
    assert found.passed is False
    assert all(part.passed is False for part in found.parts if part.label.endswith("systematic"))


def test_an_error_that_theory_expects_is_told_and_does_not_fail():
    turned = np.exp(-2j * np.pi * LINES * 0.02)
    found = metric(measured(lambda response: response * turned), Estimator("arx", "a:b", method="least_squares"))
    assert found.passed is None
    assert "equation error" in found.why


def test_the_sequence_of_the_trials_does_not_matter():
    outcomes = measured()
    assert metric(outcomes) == metric(outcomes[::-1])


@pytest.mark.parametrize("outcomes", [[], [Measurement(trial, "crash", "it died") for trial in TRIALS]])
def test_without_any_model_there_is_no_verdict(outcomes):
    found = metric(outcomes)
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
    found = metric(kept)
    assert found.passed is True
    assert [part.label for part in found.parts if "no verdict" in part.why] == [f"{JOINTS[0]} 5 mrad"]
    assert found.curves[JOINTS[0]]["mrad"] == [10, 40]


def test_scatter_that_hides_what_should_fail_is_no_pass():
    rng = np.random.default_rng(4)
    wild = measured(lambda response: response * (1.2 + 0.5 * rng.standard_normal() + 0.5j * rng.standard_normal()))
    parts = [part for part in metric(wild).parts if part.label.endswith("systematic")]
    assert parts
    assert not any(part.passed for part in parts)
    assert any("scatter is too large" in part.why for part in parts)
    told = [part for part in metric(measured()).parts if part.passed]
    assert all(f"at most {part.limits[1]:.3g} %" in part.why for part in told)


LINE_COUNT = 20


def normal(rng, *shape):
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2.0)


def test_noise_and_distortion_are_told_apart():
    rng = np.random.default_rng(1)
    linear = np.full(LINE_COUNT, 1.0 + 0.0j)
    groups = [linear + 0.03 * normal(rng, LINE_COUNT) + 0.01 * normal(rng, 3, LINE_COUNT) for _ in range(60)]
    found = scatter_of(groups, LINE_COUNT)
    assert found.noise == pytest.approx(1.0, rel=0.05)
    assert found.distortion == pytest.approx(3.0, rel=0.05)
    assert found.noise_interval[0] < 1.0 < found.noise_interval[1]
    assert found.distortion_interval[0] < 3.0 < found.distortion_interval[1] < 4.0


def test_without_repeats_nothing_is_said_of_noise():
    found = scatter_of(list(normal(np.random.default_rng(1), 6, 1, LINE_COUNT)), LINE_COUNT)
    assert np.isnan(found.noise)
    assert np.isnan(found.noise_interval).all()
    assert found.distortion == pytest.approx(100.0, rel=0.2)


def test_a_systematic_error_is_found_free_of_what_scatter_adds():
    rng = np.random.default_rng(2)
    errors = 0.04 + 0.05 * normal(rng, 200, LINE_COUNT)
    found = systematic_of(errors, LINE_COUNT, allowed=2.0, false_alarm=1e-4)
    assert found.percent == pytest.approx(4.0, rel=0.05)
    assert found.interval[0] < 4.0 < found.interval[1]
    assert found.limit < found.percent
    assert systematic_of(errors, LINE_COUNT, allowed=5.0, false_alarm=1e-4).limit > found.percent


def test_the_limit_follows_the_noise_and_no_verdict_depends_on_its_level():
    errors = normal(np.random.default_rng(3), 8, LINE_COUNT)
    one = systematic_of(errors, LINE_COUNT, allowed=0.0, false_alarm=1e-3)
    ten = systematic_of(10.0 * errors, LINE_COUNT, allowed=0.0, false_alarm=1e-3)
    assert ten.limit == pytest.approx(10.0 * one.limit)
    assert ten.percent == pytest.approx(10.0 * one.percent)


@pytest.mark.parametrize("directions", [1, 3, LINE_COUNT])
def test_false_alarms_are_no_more_than_stated(directions):
    rng = np.random.default_rng(4)
    mixing = rng.standard_normal((directions, LINE_COUNT)) if directions < LINE_COUNT else np.eye(LINE_COUNT)
    runs, allowed, stated = 600, 0.03, 0.05
    alarms = 0
    for _ in range(runs):
        shift = rng.standard_normal(LINE_COUNT)
        shift *= allowed * np.sqrt(LINE_COUNT) / np.linalg.norm(shift)
        errors = shift + 0.1 * rng.standard_normal((6, directions)) @ mixing
        found = systematic_of(errors.astype(complex), LINE_COUNT, allowed=100.0 * allowed, false_alarm=stated)
        alarms += found.percent > found.limit
    # three standard deviations above what is stated
    assert alarms <= runs * stated + 3.0 * np.sqrt(runs * stated)
    if directions == 1:
        none = [
            systematic_of(
                (rng.standard_normal((6, 1)) @ mixing).astype(complex), LINE_COUNT, allowed=0.0, false_alarm=0.05
            )
            for _ in range(runs)
        ]
        assert sum(one.percent > one.limit for one in none) > 0.5 * runs * stated, "no verdict that never fails"


def test_the_same_error_in_all_waveforms_has_no_scatter_to_hide_in():
    found = systematic_of(np.full((6, LINE_COUNT), 0.06 + 0j), LINE_COUNT, allowed=5.0, false_alarm=1e-6)
    assert found.percent == pytest.approx(6.0)
    assert found.limit == pytest.approx(5.0)
    assert found.interval == pytest.approx((6.0, 6.0))
