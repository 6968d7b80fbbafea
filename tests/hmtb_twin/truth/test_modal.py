import numpy as np
import pytest

from hmtb_twin import JOINTS, Plant, linearize, load_arm

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
        np.testing.assert_allclose(gain * ratio, response, rtol=1e-5)
