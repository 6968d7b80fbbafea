"""Simulation."""

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import Polynomials, StateSpace, SysidError, innovations_form, simulate

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


def test_refusals() -> None:
    with pytest.raises(SysidError, match=r"u: expected shape \(N, 1\)"):
        simulate(MODEL, np.ones((5, 2)))
    with pytest.raises(SysidError, match="x0"):
        simulate(MODEL, np.ones(5), x0=[1.0])
    with pytest.raises(SysidError, match="NaN"):
        simulate(MODEL, [1.0, np.nan])
    with pytest.raises(SysidError, match="StateSpace or an Estimate, got str"):
        simulate("model", np.ones(3))  # type: ignore[arg-type]
