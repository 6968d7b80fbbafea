from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmtb_twin import IDEAL, Chain
from hmtb_twin.control.hand_controller import HandControllerInterface, deflection, pickup, quantise
from hmtb_twin.parameters.values import HAND_CONTROLLER


def interface(volts, parameters=HAND_CONTROLLER, chain=IDEAL, seed=0):
    """Received volts and counts of one axis."""
    column = np.atleast_2d(volts).T
    disturbance = pickup(len(column), 1, parameters, np.random.default_rng(seed), chain)
    received, counts = HandControllerInterface(parameters, chain, disturbance).read(column)
    return received[:, 0], counts[:, 0]


@given(st.lists(st.floats(-9.9, 9.9), min_size=1, max_size=50))
def test_converter_is_within_half_a_count(volts):
    _, counts = interface(np.array(volts), chain=replace(IDEAL, adc=True))
    error = HAND_CONTROLLER.adc_step * counts - volts
    assert np.abs(error).max() <= 0.5 * HAND_CONTROLLER.adc_step * (1 + 1e-9)


def test_converter_saturates():
    assert interface(np.array([50.0, -50.0]))[1].tolist() == [2047.0, -2048.0]


def test_samples_are_held():
    slow, volts = replace(HAND_CONTROLLER, hold=3), np.arange(6) / 10
    _, held = interface(volts, slow, replace(IDEAL, hold=True))
    np.testing.assert_allclose(held * HAND_CONTROLLER.adc_step, [0.0, 0.0, 0.0, 0.3, 0.3, 0.3])
    np.testing.assert_allclose(interface(volts, slow)[1] * HAND_CONTROLLER.adc_step, volts)


def test_wires_add_noise_and_axes_a_bias_of_the_stated_size():
    noisy, _ = interface(np.zeros(20_000), chain=replace(IDEAL, noise=True))
    assert abs(noisy.std() / HAND_CONTROLLER.noise - 1.0) < 0.02
    biased = [interface(np.zeros(1), chain=replace(IDEAL, bias=True), seed=seed)[0][0] for seed in range(2000)]
    assert abs(np.std(biased) / HAND_CONTROLLER.bias - 1.0) < 0.05


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


def test_the_same_numbers_are_drawn_whatever_acts():
    draws = []
    for chain in (IDEAL, Chain()):
        rng = np.random.default_rng(3)
        pickup(100, 2, HAND_CONTROLLER, rng, chain)
        draws.append(rng.random())
    assert draws[0] == draws[1]


def test_deadband_keeps_small_deflections_from_the_arm_and_leaves_no_step():
    wide = replace(HAND_CONTROLLER, deadband=0.1)
    counts = np.array([-1.0, -0.1, 0.05, 0.1, 0.3]) / HAND_CONTROLLER.adc_step
    np.testing.assert_allclose(deflection(counts, wide), [-0.9, 0.0, 0.0, 0.0, 0.2], atol=1e-12)


def test_quantise_rounds_to_the_nearest():
    assert quantise(np.array([0.26, -0.26, 0.24]), 0.5).tolist() == [1.0, -1.0, 0.0]
