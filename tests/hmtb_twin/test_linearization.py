import numpy as np
import pytest

from hmtb_twin import JOINTS, STUDIED_JOINTS, TwinError, linearize, load_arm
from hmtb_twin.linearization import linear, simulated


def test_bandwidth_is_near_one_hertz(truth):
    for name in STUDIED_JOINTS:
        assert 0.9 <= truth.joint(name).bandwidth_hz <= 1.3


def test_dominant_poles_are_real_and_where_they_were_wanted(truth):
    for name in STUDIED_JOINTS:
        poles = truth.joint(name).dominant_poles
        assert np.abs(poles.imag).max() < 1e-6 or (np.abs(poles[np.abs(poles.imag) > 1e-6]) > 150).all()
        visible = poles.real[poles.real > -60.0]
        slow, fast = visible[visible > -10.0], visible[visible <= -10.0]
        assert ((slow >= -9.5) & (slow <= -5.5)).all()
        assert len(slow) >= 1
        assert ((fast >= -44.0) & (fast <= -20.0)).all()
        assert len(fast) == 1


def test_gain_at_rest_is_one(truth):
    for name in JOINTS[1:]:
        assert truth.joint(name).dc_gain == pytest.approx(1.0, abs=1e-6)


def test_delays_are_those_of_the_published_models(truth):
    assert [truth.joint(name).delay_samples for name in STUDIED_JOINTS] == [2, 1, 2]


def test_error_against_simulation_falls_with_amplitude(truth):
    errors = [truth.small_signal_error[a] for a in sorted(truth.small_signal_error)]
    assert errors == sorted(errors)
    assert truth.small_signal_error[1e-3] < 1e-4
    assert errors[0] < 0.2 * errors[1] < 0.04 * errors[2]


def test_whole_map_predicts_all_joints_at_once(truth):
    arm = load_arm(friction=False)
    rng = np.random.default_rng(3)
    offsets = 1e-5 * rng.choice([-1.0, 1.0], (200, 7))
    offsets[:, 0] = 0.0
    angles = arm.pose("rpcm_holster_out_approach")
    response = linear(truth.model, offsets)
    difference = simulated(arm, angles, angles + offsets) - response
    assert np.linalg.norm(difference[:, 1:]) < 1e-5 * np.linalg.norm(response[:, 1:])


def test_minimal_joint_model_keeps_the_response(truth):
    f = np.geomspace(0.01, 24.9, 200)
    for name in JOINTS[1:]:
        whole = truth.channel(name, name).frequency_response(f)[:, 0, 0]
        small = truth.joint(name).model.frequency_response(f)[:, 0, 0]
        assert np.abs(whole - small).max() < 1e-7


def test_friction_and_payload_of_the_arm(truth):
    assert linearize(load_arm(friction=False)).joint("elbow_pitch").bandwidth_hz == pytest.approx(
        truth.joint("elbow_pitch").bandwidth_hz, rel=1e-9
    )
    bare = linearize(load_arm(payload="none"))
    assert bare.joint("elbow_pitch").bandwidth_hz != pytest.approx(truth.joint("elbow_pitch").bandwidth_hz, rel=1e-3)


def test_truth_cannot_be_changed(truth):
    with pytest.raises(ValueError, match="read-only"):
        truth.angles[0] = 1.0
    with pytest.raises(TypeError):
        truth.small_signal_error[1e-3] = 0.0


def test_unknown_joint(truth):
    with pytest.raises(TwinError, match=r"'ankle'.*elbow_pitch"):
        truth.joint("ankle")


def test_indexed_joint_has_no_bandwidth(truth):
    assert np.isnan(truth.joint("shoulder_roll").bandwidth_hz)
