"""Slow modes belong to the model where the input drives them, and nowhere else."""

import warnings

import numpy as np
import pytest
import scipy
from scipy.signal import lfilter

from sysid import IOData, auto
from tests.benchmarks.misleading_records import KINDS

SAMPLES, DT = 400, 0.02
TIME = np.arange(SAMPLES)


def binary(samples, hold, seed):
    return np.repeat(np.random.default_rng(seed).choice([-1.0, 1.0], -(-samples // hold)), hold)[:samples]


def disturbances(seed):
    """What the input does not cause, each of about unit size."""
    rng = np.random.default_rng(seed)
    white = 0.2 * rng.standard_normal(SAMPLES)
    walk = np.cumsum(rng.standard_normal(SAMPLES))
    return {
        "ramp": 3.4 * (TIME / SAMPLES - 0.5) + white,
        "slow sine": np.sqrt(2.0) * np.sin(2.0 * np.pi * 3.3 * TIME / SAMPLES + 1.0) + white,
        "hum": np.sqrt(2.0) * np.sin(2.0 * np.pi * 0.11 * TIME + 1.0) + white,
        "random walk": (walk - walk.mean()) / walk.std() + white,
        "level shift": np.where(TIME > 170, 1.0, -1.0) + white,
    }


@pytest.mark.parametrize("kind", disturbances(0))
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_disturbance_gives_the_plant_no_slow_mode(kind, seed):
    """First order, gain 1, bandwidth 0.84 Hz; the disturbance 10 dB below."""
    u = binary(SAMPLES, 4, 50 + seed)
    undisturbed = lfilter([0.0, 0.1], [1.0, -0.9], u)
    y = undisturbed + 0.3 * undisturbed.std() * disturbances(seed)[kind]
    choice = auto(IOData(u, y, DT).detrend())
    assert choice.estimate.dc_gain()[0, 0] == pytest.approx(1.0, abs=0.1)
    assert choice.estimate.bandwidth().path()[0] == pytest.approx(0.84, abs=0.1)
    assert choice.candidates[0].eligible and not choice.cautions


def test_output_error_alone_does_not_follow_a_ramp():
    u = binary(SAMPLES, 4, 51)
    undisturbed = lfilter([0.0, 0.1], [1.0, -0.9], u)
    record = IOData(u, undisturbed + 0.3 * undisturbed.std() * disturbances(1)["ramp"], DT).detrend()
    choice = auto(record, methods=["oe"])
    assert len(choice.estimate.poles()) == 1
    assert any(candidate.remark == "follows a disturbance by a slow mode" for candidate in choice.candidates)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_an_integrator_behind_an_encoder_is_kept(seed):
    """Motor position, 2/(s (0.08 s + 1)), in steps of 0.01 rad."""
    numerator, denominator, _ = scipy.signal.cont2discrete(([2.0], [0.08, 1.0, 0.0]), 0.01, "zoh")
    u = binary(600, 20, seed)
    y = np.round(lfilter(numerator.ravel(), denominator, u) / 0.01) * 0.01
    poles = auto(IOData(u, y, 0.01)).estimate.poles()
    assert len(poles) == 2
    np.testing.assert_allclose(np.sort(np.abs(poles)), [0.8825, 1.0], atol=0.01)


def test_an_unstable_plant_in_its_loop_is_chosen_and_named():
    """theta'' = 25 theta + 10 u, held upright by a controller."""
    dt, rng = 0.01, np.random.default_rng(0)
    # input and its gain as a third state that stays
    discrete = scipy.linalg.expm(dt * np.array([[0.0, 1.0, 0.0], [25.0, 0.0, 10.0], [0.0, 0.0, 0.0]]))
    A, B = discrete[:2, :2], discrete[:2, 2]
    x, last, u, y = np.zeros(2), 0.0, [], []
    for request in binary(1000, 10, 3):
        measured = x[0] + 1e-3 * rng.standard_normal()
        u.append(request - 8.0 * measured - 0.6 * (measured - last) / dt)
        y.append(measured)
        last = measured
        x = A @ x + B * u[-1]
    choice = auto(IOData(u, y, dt).detrend())
    assert np.abs(choice.estimate.poles()).max() == pytest.approx(np.exp(0.05), abs=2e-3)
    assert "unstable" in choice.reason and choice.candidates[0].excess > 4.0


def test_beside_a_controller_of_the_same_sample_there_is_no_direct_term():
    """A process with a PI controller; both are logged in one row."""
    rng = np.random.default_rng(1)
    drift = np.cumsum(0.05 * rng.standard_normal(1500))
    set_point = np.where((np.arange(1500) // 300) % 2 == 1, 1.0, 0.0)
    x, integral, u, y = 0.0, 0.0, [], []
    for k in range(1500):
        y.append(x + drift[k] + 0.01 * rng.standard_normal())
        error = set_point[k] - y[-1]
        integral += 0.3 / 20.0 * error
        u.append(0.3 * error + integral)
        x = np.exp(-0.2) * x + (1.0 - np.exp(-0.2)) * 1.5 * u[-1]
    choice = auto(IOData(u, y, 1.0).detrend())
    assert choice.candidates[0].orders["nk"] >= 1
    assert "feedback" in choice.reason


def test_where_input_and_output_follow_from_each_other_the_choice_says_so():
    """Proportional control without set-point changes: noise moves both, and the controller's inverse fits exactly."""
    rng, y, u, x = np.random.default_rng(2), [], [], 0.0
    for _ in range(800):
        y.append(x + 0.1 * rng.standard_normal())
        u.append(-0.4 * y[-1])
        x = 0.8 * x + 0.3 * u[-1]
    choice = auto(IOData(u, y, 1.0).detrend())
    assert any("feedback" in caution for caution in choice.cautions)


def test_searches_of_the_best_candidates_come_to_their_end():
    """An armax search that stops early takes the poles of a slow sine for those of the plant."""
    plant, (record,) = KINDS["slow sine"](np.random.default_rng([83, 14]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        choice = auto(record[:450].detrend())
    best = choice.candidates[0]
    assert (best.method, best.orders["nb"], best.orders["nf"]) == ("bj", 1, 1)
    assert choice.estimate.dc_gain().item() == pytest.approx(plant.gain, rel=0.05)
    assert choice.estimate.bandwidth().hz.item() == pytest.approx(plant.bandwidth, rel=0.05)
