"""Joints with known nonlinearity, integrated by independent equations, and linear systems with coloured noise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, arx, bj, oe, pem_ss
from sysid.validation.joint_nonlinearity import play, stop
from sysid.validation.nonlinearity import nonlinearity
from tests.benchmarks.nonlinear_joints import joint


def test_play_follows_at_its_half_width():
    signal = np.array([0.0, 1.0, 3.0, 2.5, 1.0, -2.0])
    np.testing.assert_allclose(play(signal, 0.5), [0.0, 0.5, 2.5, 2.5, 1.5, -1.5])
    np.testing.assert_allclose(play(signal, 0.5) + stop(signal, 0.5), signal)


@pytest.mark.parametrize(
    ("kind", "name"), [("friction", "dry friction"), ("play", "play"), ("saturation", "saturation")]
)
def test_the_nonlinearity_of_a_joint_is_seen_and_named(kind, name):
    for seed in (0, 6, 10):
        _, record = joint(np.random.default_rng([101, seed]), kind)
        record = record.detrend()
        test = nonlinearity(oe(record, 2, 2, 1), [record])
        assert test.material.all()
        assert test.p_values[0] < 1e-6
        assert test.kinds == (name,)


def test_a_linear_servo_is_not_called_nonlinear():
    for seed in range(5):
        _, record = joint(np.random.default_rng([101, seed]), "linear")
        record = record.detrend()
        assert not nonlinearity(oe(record, 2, 2, 1), [record]).material.any()


def test_friction_that_commands_of_one_amplitude_hide_is_told_by_a_servo_with_it():
    """Commands between two levels: a linear model of order 8 leaves nothing that looks nonlinear."""
    _, record = joint(np.random.default_rng([61, 33]), "friction")
    assert len(np.unique(record.u)) == 2
    noise = np.random.default_rng(33).standard_normal(record.y.shape)
    record = replace(record, y=record.y + 0.003 * record.y.std() * noise).detrend()
    test = nonlinearity(oe(record, 8, 8, 1), [record])
    assert not any(test.varies) and not test.material.any()
    assert test.hidden == ("dry friction",)


def test_linear_systems_under_commands_of_one_amplitude_hide_no_friction():
    """Of order six to eight, which no servo of second order describes."""
    for seed in range(4):
        rng = np.random.default_rng([5, seed])
        pairs = rng.uniform(0.8, 0.97, 3) * np.exp(1j * rng.uniform(0.05, 1.5, 3))
        denominator = np.poly([*pairs, *pairs.conj()]).real
        u = np.repeat(rng.choice([-1.0, 1.0], 300), 5)
        y = lfilter([0.0, *rng.standard_normal(6)], denominator, u)
        record = IOData(u, y + 0.01 * y.std() * rng.standard_normal(1500), 0.02).detrend()
        assert nonlinearity(oe(record, 6, 6, 1), [record]).hidden == ("",)


def linear_record(rng, noise):
    u = np.repeat(rng.choice([-1.0, 1.0], 160), 5)
    return IOData(u, lfilter([0, 0.1, 0.05], [1, -1.5, 0.65], u) + noise, 0.02).detrend()


def test_few_linear_records_with_coloured_noise_are_called_nonlinear():
    """A level of 0.99 allows one in a hundred; 6 of 150 have a probability of 0.2 %."""
    alarms = 0
    for seed in range(150):
        rng = np.random.default_rng([7, seed])
        noise = 0.1 * lfilter([1.0, 0.5], [1.0, -0.9], rng.standard_normal(800))
        record = linear_record(rng, noise)
        test = nonlinearity(arx(record, 10, 10, 1), [record], level=0.99)
        alarms += test.p_values[0] < 0.01
    assert alarms <= 5


def test_feedback_is_no_nonlinearity():
    """A controller that reads the output makes the input depend on past noise."""
    rng, x, u, y = np.random.default_rng(3), 0.0, [], []
    noise = lfilter([1.0], [1.0, -0.9], 0.05 * rng.standard_normal(1200))
    for request, disturbance in zip(np.repeat(rng.choice([-1.0, 1.0], 60), 20), noise, strict=True):
        y.append(x + disturbance)
        u.append(0.8 * (request - y[-1]))
        x = 0.8 * x + 0.3 * u[-1]
    record = IOData(u, y, 0.02).detrend()
    assert not nonlinearity(bj(record, 1, 1, 1, 1, 1), [record]).material.any()


def test_only_the_output_behind_play_is_called_nonlinear():
    rng = np.random.default_rng(5)
    u = np.column_stack([np.repeat(rng.choice([-1.0, 1.0], 200), 8), np.repeat(rng.choice([-1.0, 1.0], 320), 5)])
    first = lfilter([0, 0.2], [1, -0.8], u[:, 0]) + lfilter([0, 0.05], [1, -0.9], u[:, 1])
    second = lfilter([0, 0.3], [1, -0.7], u[:, 1])
    y = np.column_stack([play(first, 0.2), second]) + 1e-3 * rng.standard_normal((1600, 2))
    record = IOData(u, y, 0.02).detrend()
    # n4sid alone leaves errors of the first output in the prediction of the second
    test = nonlinearity(pem_ss(record, 3), [record])
    assert test.material.tolist() == [True, False]


def test_unstable_models_and_short_records_are_not_tested():
    rng = np.random.default_rng(6)
    record = linear_record(rng, 0.01 * rng.standard_normal(800))
    estimate = arx(record, 2, 2, 1)
    short = nonlinearity(estimate, [record[:100]])
    assert np.isnan(short.p_values).all()
    assert not short.material.any()
    growing = IOData(record.u, 1.01 ** np.arange(800), 0.02)
    assert nonlinearity(arx(growing, 1, 1, 1), [growing]) is None


def test_commands_of_one_amplitude_show_less_of_friction_than_matters():
    """Records of friction between two levels: half a percent of the output or less, gains up to 16 % off."""
    for seed in (16, 21, 42, 44):
        _, record = joint(np.random.default_rng([41, seed]), "friction")
        record = record.detrend()
        test = nonlinearity(bj(record, 4, 1, 1, 4, 1), [record])
        assert test.varies == (False,)
        assert test.material.all()


def test_linear_servos_between_two_levels_are_not_called_nonlinear():
    called = 0
    for seed in range(60):
        rng = np.random.default_rng([43, seed])
        servo, _ = joint(rng, "linear")
        u = np.repeat(rng.choice([-1.0, 1.0], 150), 8)
        b, a = servo.discrete(0.02)
        noise = 10.0 ** rng.uniform(-5.0, -1.0) * rng.standard_normal(len(u))
        record = IOData(u, lfilter(b, a, u) + noise, 0.02).detrend()
        called += nonlinearity(oe(record, 2, 2, 1), [record]).material.sum()
    # one in a thousand is the level: two of sixty have a probability of 0.2 %
    assert called <= 1


@pytest.mark.parametrize("samples", [1, 2, 3, 64, 1000])
@pytest.mark.parametrize("width", [0.0, 0.5, 3.0, 100.0])
def test_play_follows_its_input_at_a_distance(samples, width):
    signal = np.cumsum(np.random.default_rng(3).standard_normal(samples))
    position, expected = signal[0], []
    for value in signal:
        position = min(max(position, value - width), value + width)
        expected.append(position)
    np.testing.assert_array_equal(play(signal, width), expected)
