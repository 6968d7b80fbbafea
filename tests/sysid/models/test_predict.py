"""Prediction k steps ahead, initial states, one-step residuals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from sysid import IOData, Polynomials, StateSpace, SysidError, SysidWarning, findstates, predict, residuals, simulate
from sysid.models import innovations_form
from sysid.models.predict import initial_state
from tests.sysid.refusals import refused

A, B, C = [1, -1.5, 0.7], [0, 1, 0.5], [1, -0.3, 0.1]
MODEL = innovations_form(Polynomials(A, B, C, [1.0], [1.0]), 0.1)


def record(samples: int = 300, cut: int = 0, window: int = 0) -> tuple[IOData, np.ndarray]:
    rng = np.random.default_rng(0)
    u, e = rng.standard_normal((2, samples + cut))
    y = lfilter(B, A, u) + lfilter(C, A, e)
    return IOData(u[cut:], y[cut:], 0.1, window=window), e[cut:]


def test_from_rest_the_residuals_are_the_noise() -> None:
    data, e = record()
    np.testing.assert_allclose(residuals(MODEL, data, x0=np.zeros(2))[:, 0], e, atol=1e-11)


def test_fitted_initial_state_forgets_the_past() -> None:
    data, e = record(cut=50)
    errors = residuals(MODEL, data)[:, 0]
    np.testing.assert_allclose(errors[30:], e[30:], atol=1e-6)
    assert np.sum(errors**2) <= np.sum(e**2)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    sizes=st.tuples(st.integers(1, 4), st.integers(1, 3), st.integers(1, 3)),
    steps=st.one_of(st.integers(1, 12), st.just(40)),
    seed=st.integers(0, 10_000),
    direct=st.booleans(),
)
def test_any_shape_against_the_plain_loop(sizes: tuple[int, int, int], steps: int, seed: int, direct: bool) -> None:
    n, nu, ny = sizes
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    A *= 0.9 / max(np.abs(np.linalg.eigvals(A)).max(), 1e-9)
    C = rng.standard_normal((ny, n))
    D = rng.standard_normal((ny, nu)) if direct else np.zeros((ny, nu))
    model = StateSpace(A, rng.standard_normal((n, nu)), C, D, 0.01 * rng.standard_normal((n, ny)), 0.1)
    data = IOData(rng.standard_normal((30, nu)), rng.standard_normal((30, ny)), 0.1)
    states = [rng.standard_normal(n)]
    for u, y in zip(data.u, data.y, strict=True):
        x = states[-1]
        states.append(model.A @ x + model.B @ u + model.gain @ (y - model.C @ x - model.D @ u))
    expected = np.empty((30, ny))
    for t in range(30):
        first = max(t - steps + 1, 0)
        x = states[first]
        for s in range(first, t):
            x = model.A @ x + model.B @ data.u[s]
        expected[t] = model.C @ x + model.D @ data.u[t]
    np.testing.assert_allclose(predict(model, data, steps=steps, x0=states[0]), expected, rtol=1e-7, atol=1e-9)


def test_no_horizon_is_simulation() -> None:
    data, _ = record()
    x0 = initial_state(MODEL, data, np.zeros((2, 1)))
    np.testing.assert_allclose(predict(MODEL, data, steps=None), simulate(MODEL, data.u, x0=x0), atol=1e-12)


def test_initial_state_is_found_exactly_without_noise() -> None:
    x0 = np.array([3.0, -1.0])
    u = np.random.default_rng(1).standard_normal(80)
    y = simulate(MODEL, u, x0=x0)
    still = StateSpace(MODEL.A, MODEL.B, MODEL.C, MODEL.D, None, 0.1)
    np.testing.assert_allclose(initial_state(still, IOData(u, y, 0.1)), x0, atol=1e-10)


def test_the_window_alone_initialises() -> None:
    """What comes after the window may be anything: the initial state does not see it."""
    data, _ = record(window=30)
    spoilt = IOData(data.u, np.vstack((data.y[:30], data.y[30:] + 9.0)), 0.1, window=30)
    np.testing.assert_allclose(initial_state(MODEL, data), initial_state(MODEL, spoilt), atol=1e-12)


def test_unstable_predictor_is_said() -> None:
    bad = StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], [[-1.0]], 0.1)
    data, _ = record(40)
    with pytest.warns(SysidWarning, match="spectral radius 1.5"):
        predict(bad, data)


def test_refusals() -> None:
    data, _ = record()
    refused("steps must be", lambda: predict(MODEL, data, steps=0))
    refused("2 input", lambda: predict(MODEL, IOData(np.ones((9, 2)), np.ones(9), 0.1)))
    with pytest.raises(SysidError, match=r"sampled every 0\.2 s, the model every 0\.1 s"):
        predict(MODEL, IOData(np.ones(9), np.ones(9), 0.2))
    refused("expected an IOData", lambda: predict(MODEL, np.ones(9)))  # type: ignore[arg-type]


def test_several_experiments_are_predicted_one_by_one() -> None:
    model = innovations_form(Polynomials(B=[0, 0.1], F=[1, -0.9]), 0.1)
    data = IOData(np.ones(5), np.ones(5), 0.1)
    for function in (predict, residuals, findstates):
        refused("take several experiments one after the other", function, model, [data, data])
