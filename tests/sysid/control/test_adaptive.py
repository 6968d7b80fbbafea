"""Adaptive model following: what it learns, what it ignores, and that it stays bounded."""

from dataclasses import replace

import numpy as np
import pytest

from sysid.control import AdaptiveFollowing, adaptive, model_following
from sysid.models.state_space import StateSpace
from sysid.records.errors import SysidError

DT, SIGMA, SAMPLES = 0.02, 1e-4, 3000
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


def requests():
    """Smooth moves of both loops (N, 2)."""
    t = DT * np.arange(SAMPLES)
    return 0.15 * np.column_stack([np.sin(1.3 * t) + np.sin(0.7 * t), np.cos(1.1 * t) - np.cos(1.7 * t)])


def run(design, plant, theta, *, noise=0.0, limit=np.inf, r=None, kick=0.0):
    """Close the loop: measurements (N, 2), commands, and the controller at the end."""
    r = requests() if r is None else r
    rng, loop = np.random.default_rng(1), design.start()
    x, xr, last = np.zeros(plant.order), np.zeros(REFERENCE.order), np.zeros(2)
    y, u = np.empty_like(r), np.empty_like(r)
    for k in range(len(r)):
        yr = REFERENCE.C @ xr
        v, last = (yr - last) / DT, yr
        y[k] = plant.C @ x + noise * rng.standard_normal(2)
        u[k] = np.clip(loop.command(r[k], y[k]), -limit, limit)
        loop.applied(u[k])
        d = theta[:, 0] * v / np.sqrt(v**2 + 0.005**2) + theta[:, 1:] @ yr + kick * (k % 500 < 250)
        x, xr = plant.A @ x + plant.B @ (u[k] + d), REFERENCE.A @ xr + REFERENCE.B @ r[k]
    return y, u, loop


def rms(design, plant, theta, **kwargs):
    """Tracking error over the second half, against the reference model."""
    r, x = requests(), np.zeros(REFERENCE.order)
    yr = np.empty_like(r)
    for k in range(len(r)):
        yr[k], x = REFERENCE.C @ x, REFERENCE.A @ x + REFERENCE.B @ r[k]
    return float(np.sqrt(np.mean((run(design, plant, theta, **kwargs)[0] - yr)[SAMPLES // 2 :] ** 2)))


def test_learns_a_disturbance_in_the_span_of_its_regressors(monkeypatch):
    monkeypatch.setattr(adaptive, "LARGEST", np.inf)
    loop = run(ADAPTIVE, PLANT, TRUE)[2]
    assert loop.coefficients == pytest.approx(TRUE, abs=0.03 * np.abs(TRUE).max())
    assert rms(ADAPTIVE, PLANT, TRUE) < 0.25 * rms(ADAPTIVE.fixed, PLANT, TRUE)


def test_learns_through_limits_of_the_command(monkeypatch):
    monkeypatch.setattr(adaptive, "LARGEST", np.inf)
    r = requests()
    _, u, loop = run(ADAPTIVE, PLANT, TRUE, limit=0.2, r=r)
    assert 0.1 < np.mean(np.abs(u) == 0.2) < 0.9
    assert loop.coefficients == pytest.approx(TRUE, abs=0.05 * np.abs(TRUE).max())


def test_measurement_noise_within_the_dead_zone_teaches_nothing():
    loop = run(replace(ADAPTIVE, dead_zone=4.0), PLANT, np.zeros((2, 3)), noise=0.5 * SIGMA)[2]
    assert loop.learnt == 0
    assert not loop.coefficients.any()


def test_an_obstacle_teaches_nothing():
    loop = run(ADAPTIVE, PLANT, np.zeros((2, 3)), kick=0.05)[2]
    assert (np.abs(loop.coefficients) <= [2e-4, 4e-3, 4e-3]).all()


@pytest.mark.parametrize("plant", [lags(0.05, -0.3), lags(0.11, 0.4)])
def test_wrong_models_and_noise_stay_within_the_bound(plant):
    assert np.abs(ADAPTIVE.fixed.closed_loop(plant).poles()[0]) < 1.0
    adaptive = run(ADAPTIVE, plant, 4.0 * TRUE, noise=30 * SIGMA, kick=0.05)
    fixed = run(ADAPTIVE.fixed, plant, 4.0 * TRUE, noise=30 * SIGMA, kick=0.05)
    assert (np.abs(adaptive[2].coefficients) <= [0.02, 0.4, 0.4]).all()
    loop = ADAPTIVE.fixed.closed_loop(plant)
    x, norm = loop.B[:, 2:], np.zeros((2, 2))
    for _ in range(3000):
        norm, x = norm + np.abs(loop.C[:2] @ x), loop.A @ x
    largest = 0.02 + 0.4 * np.abs(requests()).sum(axis=1).max()
    assert (np.abs(adaptive[0] - fixed[0]).max(axis=0) <= norm @ np.full(2, largest)).all()


def test_an_unstable_loop_within_a_range_of_commands_stays_bounded():
    plant = replace(PLANT, B=12.0 * PLANT.B)
    assert np.abs(ADAPTIVE.fixed.closed_loop(plant).poles()[0]) > 1.0
    y, _, loop = run(ADAPTIVE, plant, TRUE, limit=0.5)
    assert np.abs(y).max() < 12.0 * 1.2 * (0.5 + 0.02 + 0.3)
    assert np.isfinite(loop.coefficients).all()


def test_the_same_run_gives_the_same_bits():
    first, second = (run(ADAPTIVE, PLANT, TRUE, noise=SIGMA)[1] for _ in range(2))
    assert first.tobytes() == second.tobytes()


def test_what_it_refuses():
    with pytest.raises(SysidError, match="reference: expected 2 inputs"):
        replace(ADAPTIVE, reference=replace(REFERENCE, dt=0.1))
    with pytest.raises(SysidError, match="variances of its innovations"):
        replace(ADAPTIVE, plant=replace(PLANT, innovation_covariance=None))
    with pytest.raises(SysidError, match="plant: expected a stable model"):
        replace(ADAPTIVE, plant=replace(PLANT, A=1.2 * np.eye(4)))
    with pytest.raises(SysidError, match="memory"):
        replace(ADAPTIVE, memory=0.0)
