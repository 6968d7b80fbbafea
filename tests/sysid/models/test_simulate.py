"""Simulation."""

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import Polynomials, StateSpace, SysidError, simulate
from sysid.models import innovations_form
from tests.sysid.refusals import refused

MODEL = innovations_form(Polynomials([1, -1.5, 0.7], [0, 1, 0.5], [1, 0.2], [1.0], [1.0]), 0.1)


def test_from_rest_it_is_the_filter() -> None:
    u = np.random.default_rng(0).standard_normal(100)
    np.testing.assert_allclose(simulate(MODEL, u)[:, 0], lfilter([0, 1, 0.5], [1, -1.5, 0.7], u), atol=1e-12)


def test_initial_state_adds_its_free_response() -> None:
    u, x0 = np.random.default_rng(0).standard_normal(50), np.array([1.0, -2.0])
    free = [(MODEL.C @ np.linalg.matrix_power(MODEL.A, t) @ x0)[0] for t in range(50)]
    difference = simulate(MODEL, u, x0=x0) - simulate(MODEL, u)
    np.testing.assert_allclose(difference[:, 0], free, atol=1e-12)


def test_direct_term_only() -> None:
    gain = StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), [[2.0, -1.0]], None, 0.1)
    np.testing.assert_allclose(simulate(gain, [[1.0, 1.0], [0.0, 3.0]])[:, 0], [1.0, -3.0])


def test_noise_has_the_colour_and_the_covariance_of_the_model() -> None:
    covariance = np.array([[0.5, 0.2], [0.2, 0.1]])
    A, C, K = np.diag([0.9, 0.5]), np.eye(2), np.array([[0.3, 0.0], [0.1, 0.2]])
    model = StateSpace(A, np.ones((2, 1)), C, np.zeros((2, 1)), K, 0.1, covariance)
    u, x0 = np.random.default_rng(0).standard_normal(20_000), np.array([1.0, -1.0])
    noisy = simulate(model, u, x0=x0, rng=np.random.default_rng(1))
    v = noisy - simulate(model, u, x0=x0)
    e, state = np.empty_like(v), np.zeros(2)
    for t, value in enumerate(v):
        e[t] = value - C @ state
        state = A @ state + K @ e[t]
    np.testing.assert_allclose(np.cov(e.T), covariance, atol=0.03)
    assert np.abs(np.corrcoef(e[1:, 0], e[:-1, 0])[0, 1]) < 0.03
    np.testing.assert_array_equal(noisy, simulate(model, u, x0=x0, rng=np.random.default_rng(1)))
    assert not np.array_equal(noisy, simulate(model, u, x0=x0, rng=np.random.default_rng(2)))


def test_noise_of_unknown_size_is_refused() -> None:
    refused("no innovation covariance", lambda: simulate(MODEL, np.ones(5), rng=np.random.default_rng(0)))
    known = StateSpace(MODEL.A, MODEL.B, MODEL.C, MODEL.D, MODEL.K, 0.1, [[1.0]])
    with pytest.raises(SysidError, match=r"rng: expected a numpy\.random\.Generator, got int"):
        simulate(known, np.ones(5), rng=0)  # type: ignore[arg-type]


def test_refusals() -> None:
    refused(r"u: expected shape \(N, 1\)", lambda: simulate(MODEL, np.ones((5, 2))))
    refused("x0", lambda: simulate(MODEL, np.ones(5), x0=[1.0]))
    refused("NaN", lambda: simulate(MODEL, [1.0, np.nan]))
    refused("StateSpace or an Estimate, got str", lambda: simulate("model", np.ones(3)))  # type: ignore[arg-type]
