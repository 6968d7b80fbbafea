"""Subspace identification: exact recovery, several experiments, unlike units, what is refused."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, StateSpace, SysidWarning, n4sid, residuals, simulate
from sysid.subspace.n4sid import kalman_gain, stable_shift
from tests.sysid.refusals import refused

GRID = np.linspace(0.1, 24.0, 40)


def multivariable(seed: int = 2, direct: bool = True) -> StateSpace:
    rng = np.random.default_rng(seed)
    A = np.diag([0.95, 0.8, 0.3, -0.5])
    A[0, 1], A[1, 0] = 0.2, -0.2
    D = rng.standard_normal((2, 2)) * direct
    B, C = rng.standard_normal((4, 2)), rng.standard_normal((2, 4))
    # halves what it can of A, so that the predictor is stable
    return StateSpace(A, B, C, D, 0.5 * A @ np.linalg.pinv(C), 0.02)


def record(truth: StateSpace, samples: int, seed: int = 0, noise: float = 0.0, scale: float = 1.0) -> IOData:
    """From the middle of an experiment, so that it begins in motion."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((samples + 100, 2)) * [1.0, scale]
    e = noise * rng.standard_normal((samples + 100, 2))
    disturbance = StateSpace(truth.A, truth.gain, truth.C, np.eye(2), None, truth.dt)
    return IOData(u, simulate(truth, u) + simulate(disturbance, e), 0.02)[100:]


def test_multivariable_in_unlike_units_and_two_experiments() -> None:
    truth = multivariable()
    scaled = StateSpace(truth.A, truth.B / [1.0, 1e3], truth.C, truth.D / [1.0, 1e3], None, 0.02)
    parts = [record(scaled, n, seed, scale=1e3) for n, seed in ((300, 0), (500, 1))]
    for data in (parts, parts[::-1]):
        found = n4sid(data, 4).model.markov(20)
        np.testing.assert_allclose(found, scaled.markov(20), atol=1e-9)


def test_the_gain_is_the_innovation_gain() -> None:
    truth = multivariable()
    estimate = n4sid(record(truth, 20_000, noise=1.0), 4)
    f = np.linspace(0.1, 24.0, 30)
    expected = truth.noise_response(f)
    error = np.abs(estimate.model.noise_response(f) - expected).max()
    assert error < 0.05 * np.abs(expected).max()
    np.testing.assert_allclose(estimate.noise_variance, np.eye(2), atol=0.05)
    fresh = residuals(estimate, record(truth, 2000, 5, noise=1.0))
    assert np.mean(fresh**2) == pytest.approx(1.0, rel=0.06)


def test_error_falls_with_the_root_of_samples() -> None:
    truth = multivariable()
    expected = truth.markov(50)
    sizes = (1000, 16_000)
    errors = [
        np.mean([np.linalg.norm(n4sid(record(truth, n, s, 0.3), 4).model.markov(50) - expected) for s in range(8)])
        for n in sizes
    ]
    slope = np.log(errors[1] / errors[0]) / np.log(sizes[1] / sizes[0])
    assert -0.65 < slope < -0.35


def test_options() -> None:
    data = record(multivariable(direct=False), 1000, noise=0.1)
    bare = n4sid(data, 4, direct=False, gain=False, block_rows=8)
    assert not bare.model.D.any()
    assert not bare.model.gain.any()
    assert len(bare.parameters) == 4 * (2 + 2)
    assert len(n4sid(data, 4).parameters) == 4 * (2 + 2 * 2) + 4
    assert bare.orders == {"order": 4, "block_rows": 8}
    assert np.isnan(bare.bandwidth().ci95[0]).all()
    assert bare.frequency_response([1.0]).covariance is None


def test_orders_beyond_the_rank_are_reduced_and_said(exact_system: Callable[[int, int], Any]) -> None:
    with pytest.warns(SysidWarning, match="2 nonzero canonical correlations"):
        estimate = n4sid(exact_system(2, 1).data, 5)
    assert estimate.model.order == 2
    assert any("canonical correlations" in text for text in estimate.diagnostics["warnings"])


def test_unstable_systems_are_found_and_said_or_forbidden() -> None:
    rng = np.random.default_rng(0)
    u = rng.standard_normal(300)
    data = IOData(u, lfilter([0, 1.0], [1, -1.02], u), 0.1)
    with pytest.warns(SysidWarning, match="unstable: largest pole modulus 1.02"):
        free = n4sid(data, 1)
    np.testing.assert_allclose(free.model.poles(), [1.02], atol=1e-8)
    with pytest.warns(SysidWarning, match="unstable"):
        bare = n4sid(data, 1, gain=False)
    assert not bare.model.gain.any()
    np.testing.assert_allclose(bare.model.markov(5)[:, 0, 0], free.model.markov(5)[:, 0, 0], atol=1e-8)
    assert n4sid(data, 1, stable=True).model.is_stable()


def test_stable_shift_is_stable() -> None:
    growing = np.array([[1.0, 0.2], [0.0, 1.1]])
    observability = np.vstack([np.array([[1.0, 1.0]]) @ np.linalg.matrix_power(growing, k) for k in range(8)])
    assert np.abs(np.linalg.eigvals(stable_shift(observability, 1))).max() < 1.0


def test_kalman_gain_by_hand() -> None:
    """Scalar random walk, q = r = 1: P = (1 + sqrt 5) / 2, K = P / (P + 1)."""
    golden = (1 + np.sqrt(5)) / 2
    K = kalman_gain(np.eye(1), np.eye(1), np.eye(2), np.eye(2))
    np.testing.assert_allclose(K, [[golden / (golden + 1)]], rtol=1e-8)
    np.testing.assert_array_equal(kalman_gain(0.5 * np.eye(1), np.eye(1), np.zeros((2, 2)), np.eye(2)), [[0.0]])


def test_refusals() -> None:
    data = record(multivariable(), 200, noise=0.1)
    refused("order must be a whole number", lambda: n4sid(data, 0))
    refused("block_rows must be a whole number from 3", lambda: n4sid(data, 4, block_rows=2))
    refused("block_rows", lambda: n4sid(data, 4, block_rows=40))
    refused("too many states for the data", lambda: n4sid(data[:20], 15))
    refused("constant", lambda: n4sid(IOData(np.ones(100), np.arange(100.0), 0.1), 1))
