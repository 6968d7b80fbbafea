from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hmtb_twin.hand_controller import quantise, read_stick
from hmtb_twin.parameters import HAND_CONTROLLER


def stick(volts, parameters=HAND_CONTROLLER, noise=False, quantisation=True, seed=0):
    return read_stick(
        np.atleast_2d(volts).T, parameters, np.random.default_rng(seed), noise=noise, quantisation=quantisation
    )


@given(st.lists(st.floats(-9.9, 9.9), min_size=1, max_size=50))
def test_converter_is_within_half_a_count(volts):
    record = stick(np.array(volts))
    error = HAND_CONTROLLER.adc_step * record.counts[:, 0] - volts
    assert np.abs(error).max() <= 0.5 * HAND_CONTROLLER.adc_step * (1 + 1e-9)


def test_converter_saturates():
    assert stick(np.array([50.0, -50.0])).counts[:, 0].tolist() == [2047.0, -2048.0]


def test_gain_makes_radians_of_volts():
    record = stick(np.array([1.0]), quantisation=False)
    assert record.angle[0, 0] == 1.0 * HAND_CONTROLLER.gain


def test_samples_are_held():
    held = stick(np.arange(6) / 10, replace(HAND_CONTROLLER, hold=3), quantisation=False)
    np.testing.assert_allclose(held.counts[:, 0] * HAND_CONTROLLER.adc_step, [0.0, 0.0, 0.0, 0.3, 0.3, 0.3])


def test_wires_add_noise_of_the_stated_size():
    received = stick(np.zeros(20_000), noise=True).volts[:, 0]
    assert abs(received.std() / HAND_CONTROLLER.noise - 1.0) < 0.02
    assert received.mean() != 0.0


def test_quantise_rounds_to_the_nearest():
    assert quantise(np.array([0.26, -0.26, 0.24]), 0.5).tolist() == [1.0, -1.0, 0.0]
