"""OKID: exact recovery, the published relations, uncertainty."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, StateSpace, SysidWarning, okid, simulate
from sysid.subspace.observer_gain import deadbeat_gain, stable_gain
from tests.sysid.refusals import refused

GRID = np.linspace(0.1, 24.0, 40)
DEPENDENT = pytest.mark.filterwarnings("ignore:the regressors have rank")


def multivariable() -> StateSpace:
    rng = np.random.default_rng(2)
    A = np.diag([0.95, 0.8, 0.3, -0.5])
    A[0, 1], A[1, 0] = 0.2, -0.2
    return StateSpace(
        A, rng.standard_normal((4, 2)), rng.standard_normal((2, 4)), np.zeros((2, 2)), None, 0.02, 0.01 * np.eye(2)
    )


@DEPENDENT
@pytest.mark.parametrize("normalise", [True, False])
def test_multivariable_in_unlike_units(normalise: bool) -> None:
    truth = multivariable()
    u = np.random.default_rng(0).standard_normal((1500, 2)) * [1.0, 1e3]
    y = simulate(truth, u)
    estimate = okid(IOData(u, y, 0.02)[100:], 4, p=4, normalise=normalise)
    np.testing.assert_allclose(estimate.model.markov(20), truth.markov(20), atol=1e-8)


def arx_record(seed: int, samples: int = 4000) -> IOData:
    """Second-order system whose predictor is exactly of length two: K = -a."""
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal((2, samples))
    return IOData(u, lfilter([0, 1.0, 0.5], [1, -1.5, 0.7], u) + lfilter([1.0], [1, -1.5, 0.7], 0.3 * e), 0.1)


def test_observer_parameters_are_least_squares() -> None:
    """With p = 2 the regression is ARX(2, 3) with direct term, and K the predictor's gain."""
    data = arx_record(0)
    observer = okid(data, 2, p=2)
    arx = sysid.arx(data, 2, 3, 0)
    a1, a2, b0, b1, b2 = arx.parameters
    np.testing.assert_allclose(observer.parameters, [b0, b1, -a1, b2, -a2], atol=1e-10)
    deviations = np.sqrt(np.diag(arx.covariance))[[2, 3, 0, 4, 1]]
    np.testing.assert_allclose(np.sqrt(np.diag(observer.covariance)), deviations, rtol=1e-6)
    np.testing.assert_allclose(observer.noise_variance, arx.noise_variance, rtol=1e-8)
    assert observer.parameter_names == ("y1: u1(t)", "y1: u1(t-1)", "y1: y1(t-1)", "y1: u1(t-2)", "y1: y1(t-2)")


def test_recursions_by_hand() -> None:
    """Y_k = Y1_k + sum_i Y2_i Y_(k-i), and the same for the gain, written out."""
    estimate = okid(arx_record(1), 2, p=3)
    d = estimate.diagnostics
    y1, y2 = d["observer_markov_u"][:, 0, 0], d["observer_markov_y"][:, 0, 0]
    y = [d["system_markov"][0, 0, 0]]
    gain: list[float] = []
    for k in range(1, 9):
        own = (y1[k - 1], y2[k - 1]) if k <= 3 else (0.0, 0.0)
        y.append(own[0] + sum(y2[i - 1] * y[k - i] for i in range(1, min(k, 3) + 1)))
        gain.append(own[1] + sum(y2[i - 1] * gain[k - i - 1] for i in range(1, min(k - 1, 3) + 1)))
    np.testing.assert_allclose(d["system_markov"][:9, 0, 0], y, rtol=1e-12)
    np.testing.assert_allclose(d["gain_markov"][:8, 0, 0], gain, rtol=1e-12)


def test_the_gain_is_the_innovation_gain() -> None:
    """K = c - a = (1.5, -0.7) in companion form: compare the noise responses, whatever the basis."""
    model = okid(arx_record(2, 20_000), 2, p=4).model
    f = np.linspace(0.05, 4.9, 20)
    z = np.exp(-2j * np.pi * f * 0.1)
    truth = 1.0 / (1 - 1.5 * z + 0.7 * z**2)
    np.testing.assert_allclose(model.noise_response(f)[:, 0, 0], truth, atol=0.1 * np.abs(truth).max())
    errors = sysid.residuals(model, arx_record(3))
    assert np.std(errors) == pytest.approx(0.3, rel=0.05)


@pytest.mark.slow
def test_intervals_cover() -> None:
    truth = sysid.models.innovations_form(
        sysid.Polynomials([1, -1.5, 0.7], [0, 1.0, 0.5], np.ones(1), np.ones(1), np.ones(1)), 0.1
    )
    hz, f = truth.bandwidth()[0, 0], np.array([0.2, 1.0, 3.0])
    g = np.abs(truth.frequency_response(f))
    bandwidths, responses = [], []
    for seed in range(100):
        estimate = okid(arx_record(seed, 2000), 2, p=3)
        bandwidths.append(bool(estimate.bandwidth().covers(hz)[0, 0]))
        low, high = estimate.frequency_response(f).magnitude_ci95()
        responses.append((low <= g) & (g <= high))
    # three binomial standard deviations below 95 % of 100
    assert np.mean(bandwidths) > 0.88
    assert np.mean(responses, axis=0).min() > 0.88


def test_without_direct_term() -> None:
    estimate = okid(arx_record(5), 2, p=3, direct=False)
    np.testing.assert_array_equal(estimate.model.D, [[0.0]])
    assert len(estimate.parameters) == 6


def test_unstable_realisation_is_said() -> None:
    rng = np.random.default_rng(0)
    u = rng.standard_normal(300)
    y = lfilter([0, 1.0], [1, -1.02], u)
    with pytest.warns(SysidWarning, match="the model is unstable: largest pole modulus 1.02"):
        okid(IOData(u, y, 0.1), 1, p=1)


@DEPENDENT
def test_orders_beyond_the_rank_are_reduced_and_kept_in_the_record(exact_system: Callable[[int, int], Any]) -> None:
    with pytest.warns(SysidWarning, match="numerical rank 2: the model has that order instead of 5"):
        estimate = okid(exact_system(2, 1).data, 5, p=5)
    assert estimate.model.order == 2
    assert any("numerical rank 2" in text for text in estimate.diagnostics["warnings"])


def test_unstable_gains_are_replaced_by_the_factor_of_the_same_spectrum() -> None:
    """H = (z + 1.5) / (z - 0.5) and (z + 2/3) / (z - 0.5) differ by a factor 1.5 in magnitude only."""
    A, C = np.array([[0.5]]), np.array([[1.0]])
    np.testing.assert_allclose(stable_gain(A, C, np.array([[2.0]]), np.eye(1)), [[0.5 + 2 / 3]], rtol=1e-10)
    np.testing.assert_array_equal(stable_gain(A, C, np.array([[0.3]]), np.eye(1)), [[0.3]])


@pytest.mark.parametrize(
    ("order", "p", "message"),
    [
        (0, 3, "order must be"),
        (2, 0, "p must be"),
        (5, 3, r"p \* ny must be at least the order 5"),
        (2, 2500, "too many observer parameters"),
    ],
)
def test_refusals(order: int, p: int, message: str) -> None:
    refused(message, lambda: okid(arx_record(0), order, p=p))


@pytest.mark.parametrize(("states", "outputs"), [(1, 1), (5, 1), (4, 2), (7, 3), (3, 3)])
def test_deadbeat_gains_forget_in_as_few_samples_as_can_be(states: int, outputs: int) -> None:
    rng = np.random.default_rng(states)
    A, C = rng.standard_normal((states, states)), rng.standard_normal((outputs, states))
    observer = A - deadbeat_gain(A, C) @ C
    steps = -(-states // outputs)
    size = np.linalg.norm(A) ** steps
    assert np.abs(np.linalg.matrix_power(observer, steps)).max() < 1e-8 * size
    assert steps == 1 or np.abs(np.linalg.matrix_power(observer, steps - 1)).max() > 1e-3


def test_deadbeat_gain_of_a_mode_that_is_not_seen() -> None:
    K = deadbeat_gain(np.diag([0.9, 0.5]), np.array([[1.0, 0.0]]))
    np.testing.assert_allclose(K, [[0.9], [0.0]], atol=1e-12)


def test_deadbeat_option() -> None:
    truth = multivariable()
    u = np.random.default_rng(0).standard_normal((600, 2))
    data = IOData(u, simulate(truth, u) + 1e-6 * np.random.default_rng(1).standard_normal((600, 2)), 0.02)
    model = okid(data, 4, p=4, deadbeat=True).model
    observer = model.A - model.gain @ model.C
    np.testing.assert_allclose(np.linalg.matrix_power(observer, 2), 0.0, atol=1e-8)
    np.testing.assert_allclose(model.markov(9), truth.markov(9), atol=1e-3)


@DEPENDENT
def test_a_start_at_rest_uses_every_sample() -> None:
    """22 samples determine 18 coefficients per output, which 17 samples behind the first five cannot."""
    truth = multivariable()
    u = np.random.default_rng(0).standard_normal((22, 2))
    data = IOData(u, simulate(truth, u), 0.02)
    refused("too many observer parameters", lambda: okid(data, 4, p=5))
    found = okid(data, 4, p=4, at_rest=True)
    np.testing.assert_allclose(found.model.markov(20), truth.markov(20), atol=1e-8)
    # from the middle the same claim is wrong, and the fit shows it
    late = IOData(np.vstack((u, u)), simulate(truth, np.vstack((u, u))), 0.02)[22:]
    assert np.abs(okid(late, 4, p=4, at_rest=True).model.markov(20) - truth.markov(20)).max() > 1e-3
