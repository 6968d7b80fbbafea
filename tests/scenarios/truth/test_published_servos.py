"""The servos of the variant `published` are found again from the printed models, and the arm has their poles."""

import numpy as np
import pytest

from hmtb_twin import linearize, load_arm
from hmtb_twin.parameters.published_variant import PUBLISHED_SERVOS
from scenarios.truth.published import SHOULDER_PITCH_OE, YAW_OE
from scenarios.truth.published_servos import PITCH_PLANE, TARGETS, YAW_PLANE, coupled, dominant_poles, solved


@pytest.mark.parametrize("plane", [YAW_PLANE, PITCH_PLANE], ids=["yaw", "pitch"])
def test_the_servos_are_found_again(plane) -> None:
    for name, servo in solved(plane).items():
        assert servo.slow_pole == pytest.approx(PUBLISHED_SERVOS[name].slow_pole, rel=1e-3)
        assert servo.fast_pole == pytest.approx(PUBLISHED_SERVOS[name].fast_pole, rel=1e-3)


def test_the_arm_has_the_dominant_poles_of_the_chosen_models() -> None:
    truth = linearize(load_arm("published"))
    for model in TARGETS:
        found = truth.joint(model.joint).natural_poles
        for pole in dominant_poles(model):
            assert np.abs(found / pole - 1.0).min() < 0.025, f"{model.label}: {pole:.4g} rad/s, found {found}"


def test_dominant_poles_of_a_print() -> None:
    np.testing.assert_allclose(dominant_poles(SHOULDER_PITCH_OE), 50.0 * np.log([0.8884, 0.0892]), rtol=1e-3)
    # Of (4.8) one pole is delay and one lies on the negative axis.
    np.testing.assert_allclose(dominant_poles(YAW_OE), 50.0 * np.log([0.94265]), rtol=1e-3)


def test_the_closed_form_is_the_arm_but_for_the_step_of_the_physics() -> None:
    truth = linearize(load_arm("published"))
    for plane in (YAW_PLANE, PITCH_PLANE):
        poles = np.linalg.eigvals(coupled(plane.joints, PUBLISHED_SERVOS)[0])
        found = truth.joint(plane.joints[0]).natural_poles
        for pole in poles[poles.real > -30.0]:
            assert np.abs(found / pole - 1.0).min() < 0.005
