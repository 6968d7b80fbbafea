from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import JOINTS, STUDIED_JOINTS, Plant, linearize, load_arm
from hmtb_twin.parameters.variants import MOTIONS, OPERATING_POSE, POSES
from hmtb_twin.truth import linearization
from hmtb_twin.truth.linearization import CLEARANCE, SPOOL_STEP, STEP, linear, simulated, small_signal_error
from tests.refusals import refused


@pytest.mark.slow
def test_joints_have_their_bandwidths_gains_and_published_delays(truth):
    for name in STUDIED_JOINTS:
        assert 0.9 <= truth.joint(name).bandwidth_hz <= 1.3
    assert [truth.joint(name).delay_samples for name in STUDIED_JOINTS] == [2, 1, 2]
    assert [truth.joint(name).dc_gain for name in JOINTS[1:]] == pytest.approx(6 * [1.0], abs=1e-6)
    assert np.isnan(truth.joint("shoulder_roll").bandwidth_hz)
    elbow = truth.joint("elbow_pitch").bandwidth_hz
    smooth, bare = (linearize(arm, amplitudes=()) for arm in (load_arm(friction=False), load_arm(payload="none")))
    assert smooth.joint("elbow_pitch").bandwidth_hz == pytest.approx(elbow, rel=1e-9)
    assert bare.joint("elbow_pitch").bandwidth_hz != pytest.approx(elbow, rel=1e-3)


@pytest.mark.parametrize("law", ["flow", "torque"])
def test_dominant_poles_are_damped_and_where_they_were_wanted(law):
    truth = linearize(load_arm(plant=Plant(servo=law)), amplitudes=())
    for name in STUDIED_JOINTS:
        poles = truth.joint(name).dominant_poles
        slow = poles[np.abs(poles) < 10.0]
        assert len(slow) >= 1
        # Each joint alone has its slow pole at -6.7; together the pitches of a flow servo, soft against the weight of
        # the others, swing a little, while those of a torque servo stay real.
        assert (-slow.real > (0.6 if law == "flow" else 1.0 - 1e-9) * np.abs(slow)).all()
        assert ((slow.real >= -9.5) & (slow.real <= -4.5)).all()
        others = poles[np.abs(poles) >= 10.0]
        assert (-others.real > 0.45 * np.abs(others)).all()


@pytest.mark.slow
@pytest.mark.parametrize(("variant", "payload"), [("nominal", "rpcm"), ("nominal", "mdm"), ("published", "rpcm")])
def test_error_against_simulation_is_proportional_to_amplitude_over_three_decades(variant, payload):
    errors = linearize(load_arm(variant, payload)).small_signal_error
    assert list(errors) == [1e-5, 1e-4, 1e-3, 1e-2]
    assert errors[1e-5] < 1.5e-6
    for amplitude, error in errors.items():
        assert error / amplitude == pytest.approx(errors[1e-3] / 1e-3, rel=0.03)


def test_whole_map_predicts_all_joints_at_once_and_divergence_shows(truth, monkeypatch):
    arm = load_arm(friction=False)
    bits = np.random.default_rng(3).choice([-1.0, 1.0], (200, 7))
    bits[:, 0] = 0.0
    angles, errors = arm.pose("rpcm_holster_out_approach"), []
    for amplitude in (1e-5, 1e-4):
        response = linear(truth.model, amplitude * bits)
        difference = simulated(arm, angles, angles + amplitude * bits) - response
        errors.append(np.linalg.norm(difference[:, 1:]) / np.linalg.norm(response[:, 1:]))
    assert errors[0] < 3e-6
    assert errors[1] / errors[0] == pytest.approx(10.0, rel=0.05)
    with pytest.raises(ValueError, match="read-only"):
        truth.angles[0] = 1.0
    with pytest.raises(TypeError):
        truth.small_signal_error[1e-3] = 0.0

    def diverged(*arguments):
        response = simulated(*arguments)
        response[-1, JOINTS.index("elbow_pitch")] = np.nan
        return response

    # The elbow's is neither the first nor the last of the comparisons.
    assert np.isfinite(small_signal_error(arm, truth.model, truth.angles, 1e-3))
    monkeypatch.setattr(linearization, "simulated", diverged)
    assert np.isnan(small_signal_error(arm, truth.model, truth.angles, 1e-3))


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"shoulder_yaw": 9.0}, r"shoulder_yaw = 515.662 deg given, .* -90 and 90 deg"),
        ({"elbow_pitch": 0.0}, r"elbow_pitch = 0 deg given, expected between 0 and 150 deg, .* off the stops"),
        ({"elbow_pitch": MOTIONS["elbow_pitch"].upper}, r"elbow_pitch = 150 deg given"),
        ({"wrist_yaw": MOTIONS["wrist_yaw"].lower + 0.9 * CLEARANCE}, r"wrist_yaw = -89.9\d* deg given"),
        ({"shoulder_roll": 0.1}, r"shoulder_roll = 5.72958 deg given, expected 0 deg, where its pin"),
        ({"elbow_pitch": 1.001 * CLEARANCE}, None),
    ],
)
def test_poses_out_of_range_or_on_a_stop_are_refused(arm, changes, expected):
    pose, amplitude = np.array([changes.get(j, at) for j, at in zip(JOINTS, POSES[OPERATING_POSE], strict=True)]), 1e-3
    pin = arm.model.joint("shoulder_roll").qpos_spring[0]
    assert {angles[0] for angles in POSES.values()} == {pin} == {0.0}
    if expected is None:
        # The nearest pose to a stop is clear of it.
        assert 10 * max(STEP, SPOOL_STEP) <= CLEARANCE
        amplitude = 0.1 * CLEARANCE
        assert linearize(arm, pose, amplitudes=(amplitude,)).small_signal_error[amplitude] < 0.2 * amplitude
    else:
        refused(expected, linearize, arm, pose, amplitudes=())


@pytest.mark.parametrize("pose", [["a"] * 7, [1j] * 7, {}, [0.0] * 6, [np.nan] * 7, 5, [True] * 7, [[1, 2], [3]]])
def test_a_pose_is_seven_finite_numbers(pose):
    refused("expected a name or 7 finite joint angles", linearize, load_arm(), pose)


@pytest.mark.parametrize("amplitude", [0.0, -1e-3, float("nan"), float("inf"), 1e3, True, None, "1e-3", 1e-3j])
def test_amplitudes_are_a_sequence_of_small_positive_numbers(arm, amplitude):
    refused(r"expected above 0 and up to 6\.283 rad", linearize, arm, amplitudes=(amplitude,))
    if amplitude in (-1e-3, None, "1e-3"):
        refused(r"amplitudes = .* given, expected a sequence of numbers in rad", linearize, arm, amplitudes=amplitude)


@pytest.mark.filterwarnings("error")
def test_unstable_arm_has_a_linear_model_but_no_joint_truths(truth, monkeypatch):
    sampled = linearization._sampled_model

    def unstable(*values):
        path, disturbances = sampled(*values)
        return replace(path, A=path.A * 1.2 / np.abs(np.linalg.eigvals(path.A)).max()), disturbances

    monkeypatch.setattr(linearization, "_sampled_model", unstable)
    grown = linearize(load_arm(plant=Plant(supply_pressure=50.0)))
    assert grown.spectral_radius == pytest.approx(1.2)
    assert all(np.isnan(error) for error in grown.small_signal_error.values())
    conditions = r"at rpcm_holster_out_approach under .*supply_pressure = 50\.0"
    refused(rf"^the arm is unstable {conditions}.*: spectral radius 1\.2 at 50 Hz", grown.joint, "elbow_pitch")
    assert truth.spectral_radius < 1.0


@pytest.mark.parametrize("names", [5, None, {}, "elbow_pitch", (), ("elbow_pitch", "elbow_pitch"), {"elbow_pitch"}])
def test_a_subset_takes_joints_each_once(truth, names):
    for arguments in ((names, JOINTS), (JOINTS, names)):
        refused("expected one or more joints, each once", truth.subset, *arguments)


@pytest.mark.parametrize("name", [5, None, ["elbow_pitch"], np.array(["elbow_pitch", "ankle"]), "ankle"])
def test_unknown_names_are_answered_with_what_there_is(truth, name):
    for ask in (truth.joint, lambda one: truth.channel("elbow_pitch", one)):
        refused(r"unknown joint .*, available: .*elbow_pitch", ask, name)
    refused(r"unknown variant .*, available: nominal", load_arm, variant=name)
    # None is the payload for which the servos are tuned.
    if name is not None:
        refused(r"unknown payload .*, available: .*rpcm", load_arm, payload=name)


FREQUENCIES = np.geomspace(0.05, 24.0, 60)
ARMS = [
    ("nominal", "rpcm", "linear"),
    ("nominal", "mdm", "linear"),
    ("published", "rpcm", "linear"),
    ("flight", "none", "linear"),
    ("nominal", "rpcm", "orifice"),
]


@pytest.fixture(scope="module", params=ARMS, ids="-".join)
def truths(request):
    variant, payload, actuator = request.param
    return [
        linearize(load_arm(variant, payload, plant=Plant(actuator=actuator, process_noise=noise)), amplitudes=())
        for noise in (0.0, 0.005)
    ]


@pytest.mark.slow
def test_poles_are_eigenvalues_of_the_whole_arm_with_and_without_noise(truths):
    for truth in truths:
        whole = np.linalg.eigvals(truth.model.A)
        for name in JOINTS[1:]:
            poles = truth.joint(name).poles
            assert np.abs(poles[:, None] - whole).min(axis=1).max() < 1e-9
    quiet, noisy = (truth.joint("shoulder_pitch") for truth in truths)
    np.testing.assert_allclose(noisy.dominant_poles, quiet.dominant_poles, rtol=1e-9)


def test_poles_zeros_gain_and_delay_are_the_response(truths):
    truth = truths[0]
    z = np.exp(2j * np.pi * FREQUENCIES * truth.dt)[:, None]
    for name in JOINTS[1:]:
        joint = truth.joint(name)
        assert len(joint.poles) - len(joint.zeros) == joint.delay_samples
        assert len(joint.shares) == len(joint.poles)
        assert len(joint.dominant_poles) >= 1
        assert (joint.dominant_poles.real < 0.0).all()
        ratio = np.prod(z - joint.zeros, axis=1) / np.prod(z - joint.poles, axis=1)
        gain = joint.dc_gain * np.prod(1.0 - joint.poles) / np.prod(1.0 - joint.zeros)
        response = truth.channel(name, name).frequency_response(FREQUENCIES)[:, 0, 0]
        # Of unit gain at rest: poles of equal spools coincide, and are known the less well.
        np.testing.assert_allclose(gain * ratio, response, rtol=1e-5, atol=1e-6)
