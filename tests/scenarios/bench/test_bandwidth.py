"""Recovered bandwidths by joint and excitation, beside the true ones."""

import numpy as np
import pytest

from scenarios.bench.bandwidth import BandwidthMetric, sequence_class, true_bandwidths
from scenarios.bench.measurement import Measurement
from scenarios.problems.trial import Trial
from tests.scenarios.bench.judging import evaluated

TRUTH = {"small_signal": 1.03, "best_linear": 0.95, "best_linear_ci95": [0.93, 0.97], "published": {"ARMAX (4.7)": 0.4}}
PITCH = "twin-nominal-shoulder_pitch-multisine-10mrad"
YAW = "twin-nominal-shoulder_yaw-prbs-67mrad"


def outcome(problem, hz, interval=None, kind="model", draw=0):
    band = None if hz is None else np.array([[hz]])
    ends = None if interval is None else np.array(interval)[:, None, None]
    return Measurement(Trial(problem, draw), kind, bandwidth_hz=band, bandwidth_ci95=ends)


@pytest.fixture(autouse=True)
def truth(monkeypatch):
    monkeypatch.setattr("scenarios.bench.bandwidth.true_bandwidths", lambda name: (0.2, TRUTH))


def metric(outcomes):
    return evaluated(BandwidthMetric(), outcomes)


def on_pitch(values):
    return metric([outcome(f"{PITCH}-w{k}", hz) for k, hz in enumerate(values)])


def test_it_is_shown_with_the_range_of_95_percent_and_never_judged():
    shown = on_pitch((0.7, 0.9, 1.0, 1.1, 1.3))
    assert shown.passed is None and shown.parts[0].passed is None
    assert (shown.value, shown.expected, shown.interval) == (1.0, 0.95, (0.7, 1.3))
    assert "3 of 5 near 1 Hz" in shown.why
    assert BandwidthMetric.verdicts == 0
    values = np.linspace(0.5, 1.5, 200)
    low, high = on_pitch(values).interval
    assert np.mean((values >= low) & (values <= high)) == pytest.approx(0.95, abs=0.02)


def test_waveforms_are_one_class_and_excitations_are_two():
    shown = metric([outcome(f"{PITCH}-w{k}", 1.0) for k in range(3)] + [outcome(YAW, 0.9, draw=k) for k in range(2)])
    rows = shown.curves["classes"]
    labels = ["shoulder_pitch multisine 10 mrad", "shoulder_yaw prbs 67 mrad"]
    assert [part.label for part in shown.parts] == [row["label"] for row in rows] == labels
    assert [row["hz"] for row in rows] == [(1.0,) * 3, (0.9,) * 2]
    assert rows[0]["small_signal"] == TRUTH["small_signal"]


def test_its_number_is_that_of_the_joint_furthest_from_its_truth_at_the_largest_amplitude():
    elbow = YAW.replace("shoulder_yaw", "elbow_pitch")
    shown = metric([outcome(f"{PITCH}-w0", 5.0), outcome(YAW, 0.9), outcome(elbow, 0.5)])
    assert (shown.value, shown.expected) == (0.5, 0.95)
    assert "The number is that of elbow_pitch prbs 67 mrad: 0 of 1 near 1 Hz" in shown.why
    assert "All joints together: 1 of 3 near 1 Hz" in shown.why


def test_bandwidths_that_cannot_be_claimed_count_as_not_near_1_hz():
    uncertain = [outcome(f"{PITCH}-w{k}", 1.0, ends) for k, ends in enumerate([(0.01, 10.0), (0.9, 1.1)])]
    shown = metric([outcome(f"{PITCH}-w2", np.nan), outcome(f"{PITCH}-w3", 0.1), *uncertain])
    assert shown.curves["classes"][0]["hz"] == (1.0,)
    assert "1 of 4 near 1 Hz" in shown.parts[0].why
    nothing = on_pitch((None, np.nan))
    assert np.isnan(nothing.value) and np.isnan(nothing.parts[0].value)
    assert "0 of 2" in nothing.why


@pytest.mark.parametrize("outcomes", [[], [outcome(f"{PITCH}-w0", None, kind="crash")]])
def test_without_any_model_it_says_so(outcomes):
    nothing = metric(outcomes)
    assert nothing.passed is None and np.isnan(nothing.value) and "no record has a model" in nothing.why


@pytest.mark.slow
def test_truth_is_that_of_the_arm():
    lowest, truth = true_bandwidths(sequence_class("elbow_pitch"))
    assert truth["small_signal"] == pytest.approx(1.035, abs=1e-3)
    low, high = truth["best_linear_ci95"]
    assert 1.0 < low < truth["best_linear"] < high < truth["small_signal"]
    assert lowest == 0.5
    assert len(truth["published"]) == 2
