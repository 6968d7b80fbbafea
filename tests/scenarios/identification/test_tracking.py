from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import linearize, load_arm
from scenarios.identification.tracking import Tracking, best_linear_servo, phase_delay, true_stretches
from scenarios.identification.tracking_figure import tracking_figure
from sysid import FrequencyResponse
from sysid.recursive import track
from tests.refusals import refused


@pytest.fixture(scope="module")
def tracking(exchange_log):
    followed = track(exchange_log.iodata(), calibration=15.0)
    return Tracking(exchange_log.name, followed, true_stretches(exchange_log, "elbow_pitch", best_linear=False))


@pytest.mark.slow
def test_the_change_is_found_and_stands_beside_its_truth(tracking):
    assert [(one.begin, one.end, one.payload) for one in tracking.truth] == [(0.0, 20.0, "none"), (20.0, 40.0, "mdm")]
    for stretch, last in tracking.rows():
        truth = linearize(load_arm(payload=stretch.payload), amplitudes=()).joint("elbow_pitch")
        assert stretch.small_signal_hz == truth.bandwidth_hz
        # Friction changes both by a few percent.
        assert last["bandwidth"] == pytest.approx(stretch.small_signal_hz, rel=0.06)
        assert last["delay"] == pytest.approx(stretch.small_signal_delay, rel=0.06)
    assert 20.0 < tracking.alarm(tracking.truth[1]).detected < 22.0
    assert tracking.false_alarms == ()


@pytest.mark.slow
def test_an_alarm_far_from_a_change_is_false_and_a_change_without_alarm_is_missed(tracking):
    (alarm,) = tracking.track.changes
    early = replace(tracking, track=replace(tracking.track, changes=(replace(alarm, detected=17.0),)))
    assert early.record()["true_changes"] == [{"time": 20.0, "payload": "mdm", "detected": None}]
    assert early.record()["false_alarms"] == [17.0]


@pytest.mark.slow
def test_without_truth_the_parts_lie_between_the_alarms(tracking):
    plain = replace(tracking, truth=())
    (alarm,) = plain.track.changes
    assert [(one.begin, one.end) for one in plain.stretches] == [(0.0, alarm.time), (alarm.time, 40.0)]
    assert plain.record()["false_alarms"] is None


@pytest.mark.slow
def test_the_figure_has_both_quantities(tracking):
    upper, lower = tracking_figure(tracking).axes
    assert (upper.get_ylabel(), lower.get_ylabel(), lower.get_xlabel()) == ("bandwidth / Hz", "delay / ms", "time / s")
    assert [text.get_text().strip() for text in upper.texts] == ["none", "mdm"]


@pytest.mark.parametrize("payload", ["rpcm", "mdm"])
def test_the_best_linear_bandwidth_of_a_linear_arm_is_its_own(payload):
    truth = linearize(load_arm(payload=payload), amplitudes=()).joint("elbow_pitch")
    f = 0.098 * np.arange(1, 29)
    exact = truth.model.frequency_response(f)
    covariance = 1e-8 * np.broadcast_to(np.eye(2), (len(f), 1, 1, 2, 2))
    response = FrequencyResponse(f, 0.98 * exact, 0.02, "bla", covariance=covariance)
    hz, (low, high), delay = best_linear_servo(response, truth)
    assert hz == pytest.approx(truth.bandwidth_hz, rel=2e-3)
    assert low < hz < high
    assert delay == pytest.approx(phase_delay(truth.model.frequency_response, hz), rel=2e-3)


def test_a_shutdown_has_no_truth(exchange_log):
    off = replace(exchange_log, status=exchange_log.status | 16)
    refused("a shutdown, or work in contact, has no linear truth", true_stretches, off, "elbow_pitch")
