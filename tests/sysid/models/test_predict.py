import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

import sysid
from sysid import IOData, Polynomials, StateSpace, SysidWarning, arx, findstates, predict, residuals, simulate
from sysid.models import innovations_form
from sysid.models.predict import initial_state
from tests.refusals import refused
from tests.sysid.systems import A, B

C = [1, -0.3, 0.1]
MODEL = innovations_form(Polynomials(A, B, C, [1.0], [1.0]), 0.1)


def record(samples=300, cut=0, window=0):
    rng = np.random.default_rng(0)
    u, e = rng.standard_normal((2, samples + cut))
    y = lfilter(B, A, u) + lfilter(C, A, e)
    return IOData(u[cut:], y[cut:], 0.1, window=window), e[cut:]


def test_residuals_are_the_noise_and_a_fitted_initial_state_forgets_the_past():
    data, e = record()
    np.testing.assert_allclose(residuals(MODEL, data, x0=np.zeros(2))[:, 0], e, atol=1e-11)
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
def test_any_shape_against_the_plain_loop(sizes, steps, seed, direct):
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


def test_the_window_alone_initialises():
    """What comes after the window may be anything: the initial state does not see it."""
    data, _ = record(window=30)
    spoilt = IOData(data.u, np.vstack((data.y[:30], data.y[30:] + 9.0)), 0.1, window=30)
    np.testing.assert_allclose(initial_state(MODEL, data), initial_state(MODEL, spoilt), atol=1e-12)


def test_unstable_predictor_is_reported():
    bad = StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], [[-1.0]], 0.1)
    data, _ = record(40)
    with pytest.warns(SysidWarning, match="spectral radius 1.5"):
        predict(bad, data)


def test_refusals():
    data, _ = record()
    refused("steps must be", lambda: predict(MODEL, data, steps=0))
    refused("2 input", lambda: predict(MODEL, IOData(np.ones((9, 2)), np.ones(9), 0.1)))
    refused(r"sampled every 0\.2 s, the model every 0\.1 s", predict, MODEL, IOData(np.ones(9), np.ones(9), 0.2))
    for function in (predict, residuals, findstates):
        refused("take several experiments one after the other", function, MODEL, [data, data])
    refused("expected an IOData", lambda: predict(MODEL, np.ones(9)))


def test_simulation_is_the_filter_and_an_initial_state_adds_its_free_response():
    u, x0 = np.random.default_rng(0).standard_normal(50), np.array([1.0, -2.0])
    free = [(MODEL.C @ np.linalg.matrix_power(MODEL.A, t) @ x0)[0] for t in range(50)]
    difference = simulate(MODEL, u, x0=x0) - simulate(MODEL, u)
    np.testing.assert_allclose(difference[:, 0], free, atol=1e-12)
    np.testing.assert_allclose(simulate(MODEL, u)[:, 0], lfilter(B, A, u), atol=1e-12)
    gain = StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), [[2.0, -1.0]], None, 0.1)
    np.testing.assert_allclose(simulate(gain, [[1.0, 1.0], [0.0, 3.0]])[:, 0], [1.0, -3.0])


def test_noise_has_the_colour_and_the_covariance_of_the_model():
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


def test_noise_of_unknown_size_is_refused():
    refused("no innovation covariance", lambda: simulate(MODEL, np.ones(5), rng=np.random.default_rng(0)))
    known = StateSpace(MODEL.A, MODEL.B, MODEL.C, MODEL.D, MODEL.K, 0.1, [[1.0]])
    refused(r"rng: expected a numpy\.random\.Generator, got int", lambda: simulate(known, np.ones(5), rng=0))


def test_refusals_of_simulations():
    refused(r"u: expected shape \(N, 1\)", lambda: simulate(MODEL, np.ones((5, 2))))
    refused("x0", lambda: simulate(MODEL, np.ones(5), x0=[1.0]))
    refused("NaN", lambda: simulate(MODEL, [1.0, np.nan]))
    refused("StateSpace or an Estimate, got str", lambda: simulate("model", np.ones(3)))


def test_an_estimate_applies_to_signals_about_its_operating_point():
    """Raw records are predicted in their own coordinates, detrended ones relative to their own means, as ever."""
    rng = np.random.default_rng(0)
    u = rng.standard_normal(400)
    raw = IOData(5.0 + u, 7.0 + lfilter(B, A, u) + 0.1 * rng.standard_normal(400), 0.1)
    about = raw.detrend()
    estimate = arx(about, 2, 2)
    u0, y0 = estimate.operating_point
    np.testing.assert_allclose([u0, y0], [about.input_offset, about.output_offset])
    assert arx(raw, 2, 2).operating_point is None
    for function in (predict, simulate, lambda m, d: sysid.forecast(m, d[:300], 100, d.u[300:]).y):
        np.testing.assert_allclose(function(estimate, raw), function(estimate, about) + y0, atol=1e-10)
    np.testing.assert_allclose(residuals(estimate, raw), residuals(estimate, about), atol=1e-12)
    np.testing.assert_allclose(findstates(estimate, raw), findstates(estimate, about), atol=1e-10)
    np.testing.assert_allclose(sysid.compare(estimate, raw)[0].simulation, sysid.compare(estimate, about)[0].simulation)
    np.testing.assert_allclose(predict(estimate.model, about), predict(estimate, about))


@pytest.mark.parametrize("covariance", [None, np.diag([0.1, 0.5])])
@pytest.mark.parametrize("lost", [False, True])
def test_fits_do_not_depend_on_the_units_of_the_outputs(covariance, lost):
    rng = np.random.default_rng(3)
    u = rng.standard_normal((60, 1))
    drift = lfilter([0.3], [1.0, -0.9], rng.standard_normal((60, 2)), axis=0)
    y = np.column_stack([lfilter([0.0, 1.0], [1.0, -pole], u[:, 0]) for pole in (0.95, 0.8)]) + drift
    if lost:
        y[20:24, 0] = np.nan
    C, K = np.eye(2), np.array([[0.5, 0.1], [0.0, 0.3]])

    def fit(units):
        R = None if covariance is None else covariance * np.outer(units, units)
        model = StateSpace(
            np.diag([0.95, 0.8]), np.ones((2, 1)), units[:, None] * C, np.zeros((2, 1)), K / units, 1.0, R
        )
        (fits,) = sysid.compare(model, IOData(u, y * units, 1.0, missing=lost))
        return np.array([fits.one_step, fits.simulation])

    np.testing.assert_allclose(fit(np.array([1e-5, 1e5])), fit(np.ones(2)), rtol=1e-8)
