"""Adaptive model following: what it learns, what it ignores, and that it stays bounded."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
from sysid import AdaptiveFollowing, StateSpace, model_following
from sysid.control import adaptive
from tests.refusals import refused
from tests.sysid.control.closed_loop import DT, run

SIGMA, SAMPLES = 1e-4, 3000
TRUE = np.array([[0.004, 0.10, -0.05], [0.002, 0.02, 0.08]])  # friction, stiffness against both outputs


def lags(seconds, coupling=0.0):
    """Two loops, each of two equal first-order lags; the first disturbs the second."""
    pole = np.exp(-DT / seconds)
    one = np.array([[pole, 1.0 - pole], [0.0, pole]]), np.array([[0.0], [1.0 - pole]])
    A, B = np.kron(np.eye(2), one[0]), np.kron(np.eye(2), one[1])
    A[2, 1] = coupling * (1.0 - pole)
    C = np.kron(np.eye(2), [[1.0, 0.0]])
    return StateSpace(A, B, C, np.zeros((2, 2)), None, DT, SIGMA**2 * np.eye(2))


PLANT, REFERENCE = lags(0.08, 0.1), lags(0.2)
ADAPTIVE = AdaptiveFollowing(model_following(PLANT, REFERENCE).controller, PLANT, REFERENCE)


TIME = DT * np.arange(SAMPLES)
REQUESTS = 0.15 * np.column_stack([np.sin(1.3 * TIME) + np.sin(0.7 * TIME), np.cos(1.1 * TIME) - np.cos(1.7 * TIME)])
WANTED = sysid.simulate(REFERENCE, REQUESTS)
VELOCITY = np.diff(WANTED, axis=0, prepend=0.0) / DT
OBSTACLE = np.where(np.arange(SAMPLES) % 500 < 250, 0.05, 0.0)[:, None]


def pushed(theta):
    """Disturbance (N, 2) in the span of the regressors."""
    return VELOCITY / np.sqrt(VELOCITY**2 + 0.005**2) * theta[:, 0] + WANTED @ theta[:, 1:].T


@pytest.mark.slow
@pytest.mark.parametrize(("limit", "near"), [(np.inf, 0.03), (0.2, 0.05)])
def test_learns_a_disturbance_in_the_span_of_its_regressors(monkeypatch, limit, near):
    """Also through limits of the command."""
    monkeypatch.setattr(adaptive, "LARGEST", np.inf)
    y, u, loop = run(ADAPTIVE, PLANT, REQUESTS, disturbance=pushed(TRUE), limit=limit)
    assert loop.coefficients == pytest.approx(TRUE, abs=near * np.abs(TRUE).max())
    if np.isfinite(limit):
        assert 0.1 < np.mean(np.abs(u) == limit) < 0.9
        return
    without = run(ADAPTIVE.fixed, PLANT, REQUESTS, disturbance=pushed(TRUE))[0]
    errors = [np.linalg.norm((one - WANTED)[SAMPLES // 2 :]) for one in (y, without)]
    assert errors[0] < 0.25 * errors[1]


def test_measurement_noise_within_the_dead_zone_teaches_nothing():
    loop = run(replace(ADAPTIVE, dead_zone=4.0), PLANT, REQUESTS, noise=0.5 * SIGMA)[2]
    assert loop.learnt == 0
    assert not loop.coefficients.any()


def test_an_obstacle_teaches_nothing():
    loop = run(ADAPTIVE, PLANT, REQUESTS, disturbance=OBSTACLE)[2]
    assert (np.abs(loop.coefficients) <= [2e-4, 4e-3, 4e-3]).all()


@pytest.mark.slow
@pytest.mark.parametrize("plant", [lags(0.05, -0.3), lags(0.11, 0.4)])
def test_wrong_models_and_noise_stay_within_the_bound(plant):
    loop = ADAPTIVE.fixed.closed_loop(plant)
    assert loop.is_stable()
    (adaptive, _, work), (fixed, _, _) = (
        run(law, plant, REQUESTS, noise=30 * SIGMA, disturbance=pushed(4.0 * TRUE) + OBSTACLE)
        for law in (ADAPTIVE, ADAPTIVE.fixed)
    )
    assert (np.abs(work.coefficients) <= [0.02, 0.4, 0.4]).all()
    norm = np.abs(loop.markov(3001)[1:, :2, 2:]).sum(axis=0)
    largest = 0.02 + 0.4 * np.abs(REQUESTS).sum(axis=1).max()
    assert (np.abs(adaptive - fixed).max(axis=0) <= norm @ np.full(2, largest)).all()


def test_an_unstable_loop_within_a_range_of_commands_stays_bounded():
    plant = replace(PLANT, B=12.0 * PLANT.B)
    assert not ADAPTIVE.fixed.closed_loop(plant).is_stable()
    y, _, loop = run(ADAPTIVE, plant, REQUESTS, disturbance=pushed(TRUE), limit=0.5)
    assert np.abs(y).max() < 12.0 * 1.2 * (0.5 + 0.02 + 0.3)
    assert np.isfinite(loop.coefficients).all()


def test_the_same_run_gives_the_same_bits():
    first, second = (run(ADAPTIVE, PLANT, REQUESTS, disturbance=pushed(TRUE), noise=SIGMA)[1] for _ in range(2))
    assert first.tobytes() == second.tobytes()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"reference": replace(REFERENCE, dt=0.1)}, "reference: expected 2 inputs"),
        ({"plant": replace(PLANT, innovation_covariance=np.diag([1.0, 0.0]))}, "plant: .* without zero variances"),
        ({"plant": replace(PLANT, A=1.2 * np.eye(4))}, "plant: expected a stable model"),
        ({"memory": 0.0}, "memory"),
        ({"fixed": None}, "fixed: expected a Controller"),
    ],
)
def test_what_it_refuses(wrong, message):
    refused(message, replace, ADAPTIVE, **wrong)
