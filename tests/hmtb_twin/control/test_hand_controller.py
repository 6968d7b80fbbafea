"""The hand controller's options; its links one by one are in tests/test_laboratory.py."""

from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import IDEAL
from hmtb_twin.control.hand_controller import HandControllerInterface, deflection, pickup
from hmtb_twin.parameters.values import HAND_CONTROLLER


def interface(volts, parameters=HAND_CONTROLLER, chain=IDEAL, seed=0):
    """Received volts and counts of one axis."""
    column = np.atleast_2d(volts).T
    disturbance = pickup(len(column), 1, parameters, np.random.default_rng(seed), chain)
    received, counts = HandControllerInterface(parameters, chain, disturbance).read(column)
    return received[:, 0], counts[:, 0]


def test_converter_saturates():
    assert interface(np.array([50.0, -50.0]))[1].tolist() == [2047.0, -2048.0]


def test_the_circuit_takes_most_of_the_bias_away():
    chain = replace(IDEAL, bias=True)
    bias, left = (interface(np.zeros(1), replace(HAND_CONTROLLER, compensation=part), chain)[0] for part in (0.0, 0.95))
    np.testing.assert_allclose(left, 0.05 * bias)


def test_coloured_noise_keeps_its_size_and_loses_its_high_frequencies():
    coloured, _ = interface(np.zeros(60_000), replace(HAND_CONTROLLER, noise_corner=1.0), replace(IDEAL, noise=True))
    assert abs(coloured.std() / HAND_CONTROLLER.noise - 1.0) < 0.05
    correlation = np.corrcoef(coloured[1:], coloured[:-1])[0, 1]
    assert correlation == pytest.approx(np.exp(-2 * np.pi / 50), abs=0.02)


def test_mains_hum_is_seen_at_its_alias():
    hum, _ = interface(np.zeros(5000), replace(HAND_CONTROLLER, noise=0.0, hum=0.1), replace(IDEAL, noise=True))
    spectrum = np.abs(np.fft.rfft(hum)) / 2500
    assert np.fft.rfftfreq(5000, 0.02)[spectrum.argmax()] == pytest.approx(10.0)
    assert spectrum.max() == pytest.approx(0.1, rel=1e-3)


def test_deadband_keeps_small_deflections_from_the_arm_and_leaves_no_step():
    wide = replace(HAND_CONTROLLER, deadband=0.1)
    counts = np.array([-1.0, -0.1, 0.05, 0.1, 0.3]) / HAND_CONTROLLER.adc_step
    np.testing.assert_allclose(deflection(counts, wide), [-0.9, 0.0, 0.0, 0.0, 0.2], atol=1e-12)
