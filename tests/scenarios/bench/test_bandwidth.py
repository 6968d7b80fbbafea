import numpy as np
import pytest

from scenarios.bench.bandwidth import BandwidthMetric, TrueBandwidths, sequence_class, true_bandwidths
from scenarios.bench.measurement import Measurement
from scenarios.estimators.estimator import Estimator
from scenarios.problems.trial import Trial

TRUTH = TrueBandwidths(1.03, 0.95, (0.93, 0.97), 0.2, (("ARMAX (4.7)", 0.4),))
FIGURE = BandwidthMetric(lambda name: TRUTH)
PITCH = "twin-nominal-shoulder_pitch-multisine-10mrad"
YAW = "twin-nominal-shoulder_yaw-prbs-67mrad"
ONE = Estimator("one", "module:one")


def outcome(problem, draw, hz, interval=None, kind="model"):
    band = None if hz is None else np.array([[hz]])
    ends = None if interval is None else np.array(interval)[:, None, None]
    return Measurement(Trial(problem, draw), kind, bandwidth_hz=band, bandwidth_ci95=ends)


def metric(outcomes):
    return FIGURE.evaluate(outcomes, ONE, 1e-4, ())


def test_it_is_told_and_never_judged():
    found = metric([outcome(f"{PITCH}-w{k}", 0, hz) for k, hz in enumerate((0.7, 0.9, 1.0, 1.1, 1.3))])
    assert found.passed is None
    assert found.parts[0].passed is None
    assert found.value == 1.0
    assert found.expected == 0.95
    assert found.interval == (0.7, 1.3)
    assert "3 of 5 near 1 Hz" in found.why
    assert FIGURE.verdicts == 0


def test_waveforms_are_one_class_and_excitations_are_two():
    found = metric([outcome(f"{PITCH}-w{k}", 0, 1.0) for k in range(3)] + [outcome(YAW, k, 0.9) for k in range(2)])
    assert [part.label for part in found.parts] == ["shoulder_pitch multisine 10 mrad", "shoulder_yaw prbs 67 mrad"]
    assert [row["hz"] for row in found.curves["classes"]] == [[1.0] * 3, [0.9] * 2]
    assert found.curves["classes"][0]["small_signal"] == TRUTH.small_signal


def test_its_number_is_that_of_the_joint_furthest_from_its_truth_at_the_largest_amplitude():
    elbow = YAW.replace("shoulder_yaw", "elbow_pitch")
    hz = {f"{PITCH}-w0": 5.0, YAW: 0.9, elbow: 0.5}
    found = metric([outcome(name, 0, value) for name, value in hz.items()])
    assert (found.value, found.expected) == (0.5, 0.95)
    assert "The number is that of elbow_pitch prbs 67 mrad: 0 of 1 near 1 Hz" in found.why
    assert "All joints together: 1 of 3 near 1 Hz" in found.why
    assert [row["label"] for row in found.curves["classes"]] == [part.label for part in found.parts]


def test_what_cannot_be_claimed_counts_as_not_near_1_hz():
    given = [
        outcome(f"{PITCH}-w0", 0, np.nan),
        outcome(f"{PITCH}-w1", 0, 0.1),
        outcome(f"{PITCH}-w2", 0, 1.0, (0.01, 10.0)),
        outcome(f"{PITCH}-w3", 0, 1.0, (0.9, 1.1)),
    ]
    found = metric(given)
    assert found.curves["classes"][0]["hz"] == [1.0]
    assert "1 of 4 near 1 Hz" in found.parts[0].why


def test_a_contestant_without_bandwidth_has_a_figure_of_nothing():
    found = metric([outcome(f"{PITCH}-w0", 0, None), outcome(f"{PITCH}-w1", 0, np.nan)])
    assert np.isnan(found.value)
    assert np.isnan(found.parts[0].value)
    assert "0 of 2" in found.why


@pytest.mark.parametrize("outcomes", [[], [outcome(f"{PITCH}-w0", 0, None, kind="crash")]])
def test_without_any_model_it_says_so(outcomes):
    found = metric(outcomes)
    assert found.passed is None
    assert np.isnan(found.value)
    assert "no record has a model" in found.why


def test_of_many_records_the_range_holds_95_percent():
    values = np.linspace(0.5, 1.5, 200)
    found = metric([outcome(f"{PITCH}-w{k}", 0, hz) for k, hz in enumerate(values)])
    low, high = found.interval
    assert np.mean((values >= low) & (values <= high)) == pytest.approx(0.95, abs=0.02)


def test_truth_is_that_of_the_arm():
    truth = true_bandwidths(sequence_class("elbow_pitch"))
    assert truth.small_signal == pytest.approx(1.086, abs=1e-3)
    low, high = truth.best_linear_ci95
    assert 1.0 < low < truth.best_linear < high < truth.small_signal
    assert truth.lowest == 0.5
    assert len(truth.published) == 2
