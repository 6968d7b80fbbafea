import warnings

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, SysidWarning, delayest
from tests.benchmarks.delays import INPUTS, answer


def output(u, delay, noise, seed, *, f=(1.0, -0.9)):
    b = np.concatenate((np.zeros(delay), [0.1]))
    return lfilter(b, f, u) + noise * np.random.default_rng(seed).standard_normal(len(u))


def test_a_white_input_leaves_one_delay():
    u = np.random.default_rng(0).choice([-1.0, 1.0], 800)
    for delay in (0, 3, 20):
        delays = delayest(IOData(u, output(u, delay, 0.02, 1), 0.1))
        assert delays.interval.ravel().tolist() == [delay, delay]
        assert delays.arx.item() == delay


def test_slow_commands_leave_the_delay_open_and_the_warning_says_what_would_tell():
    """Two lags and a longer delay answer a slow sine alike."""
    time = np.arange(1500)
    u = np.sin(2 * np.pi * 0.002 * time) + 0.5 * np.sin(2 * np.pi * 0.003 * time + 1.0)
    data = IOData(u, output(u, 2, 0.1, 0, f=np.poly([0.9, 0.8])), 0.01)
    with pytest.warns(
        SysidWarning,
        match="lag and delay cannot be told apart.*An input that changes within \\d+ samples, or a longer record",
    ):
        delays = delayest(data)
    least, most = delays.interval.ravel()
    assert least <= 2 <= most
    assert most - least >= 5


def test_a_long_record_whose_input_moves_late():
    u = np.zeros(30_000)
    u[25_000:] = np.random.default_rng(0).choice([-1.0, 1.0], 5000)
    delays = delayest(IOData(u, output(u, 7, 0.02, 1), 0.1))
    assert delays.arx.item() == 7
    assert delays.interval.ravel().tolist() == [7, 7]


def test_no_delay_of_an_output_that_the_input_does_not_move():
    rng = np.random.default_rng(3)
    delays = delayest(IOData(rng.standard_normal(600), lfilter([1.0], [1, -0.8], rng.standard_normal(600)), 1.0))
    assert delays.arx.item() == -1
    assert delays.interval.ravel().tolist() == [-1, -1]


def test_several_inputs_have_the_interval_of_the_arx_scan():
    u = np.random.default_rng(0).standard_normal((600, 2))
    y = lfilter([0, 0, 1.0], 1, u[:, 0]) + lfilter([0, 0, 0, 0, 1.0], [1, -0.5], u[:, 1])
    delays = delayest(IOData(u, y, 1.0), largest=8)
    np.testing.assert_array_equal(delays.interval[1], delays.arx)
    np.testing.assert_array_equal(delays.interval[0], [[0, 0]])


@pytest.mark.thorough
@pytest.mark.parametrize("kind", sorted(INPUTS))
def test_intervals_hold_the_delay(kind):
    """Of 50 draws at 95 % fewer than 44 happen once in a hundred times."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        answers = [answer(kind, 7, number) for number in range(50)]
    assert sum(a.holds for a in answers) >= 44


def test_more_poles_than_the_models_of_the_profile_are_no_delay():
    """Three resonances and an equation error of 0.3 %: delays of 8 samples alone were allowed in place of 2."""
    poles = np.array([0.951 + 0.248j, 0.952 + 0.232j, 0.975 + 0.05j])
    a = np.poly(np.concatenate((poles, poles.conj()))).real
    rng = np.random.default_rng(0)
    u = lfilter([0.3], [1.0, -0.7], rng.standard_normal(2500))
    y = lfilter([0.0, 0.0, 1.0, -1.1, 0.38], a, u) + lfilter([1.0], a, 0.05 * rng.standard_normal(2500))
    delays = delayest(IOData(u[500:], y[500:], 1.0))
    assert delays.arx.item() == 2
    assert delays.interval[0].item() <= 2 <= delays.interval[1].item()


def test_distortion_that_repeats_with_the_input_is_counted_once():
    """Sixty periods would make each per mille of a distorted lag ahead of the delay significant."""
    delays, intervals = [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        u = np.tile(np.repeat(rng.choice([-1.0, 1.0], 100), 2), 30)
        x = output(u, 2, 0.0, 0)
        y = lfilter([0.5, 0.3], [1.0, -0.2], x + 0.05 * np.abs(x) * x) + 2e-4 * rng.standard_normal(len(u))
        found = delayest(IOData(u, y, 0.02)[200:])
        delays.append(found.arx.item())
        intervals.append(found.interval.ravel())
    assert np.mean(np.array(delays) == 2) >= 0.9
    assert np.mean([low <= 2 <= high for low, high in intervals]) >= 0.9
