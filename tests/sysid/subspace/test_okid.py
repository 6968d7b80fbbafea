import pickle
import tracemalloc
from functools import partial

import numpy as np
import pytest

import sysid
from sysid import IOData, StateSpace, SysidWarning, era, era_dc, okid, simulate
from sysid.subspace import observer_regression
from sysid.subspace.observer_gain import stable_gain
from tests.refusals import refused
from tests.sysid.systems import A, B, covered, multivariable, second_order

# Second-order system whose predictor is exactly of length two: K = -a.
record = partial(second_order, samples=4000, noise=0.3)
DEPENDENT = pytest.mark.filterwarnings("ignore:the regressors have rank")


@DEPENDENT
@pytest.mark.parametrize("normalise", [True, False])
def test_multivariable_in_unlike_units(normalise):
    truth = multivariable()
    u = np.random.default_rng(0).standard_normal((1500, 2)) * [1.0, 1e3]
    y = simulate(truth, u)
    estimate = okid(IOData(u, y, 0.02)[100:], 4, p=4, normalise=normalise)
    np.testing.assert_allclose(estimate.model.markov(20), truth.markov(20), atol=1e-8)


def test_observer_parameters_are_least_squares():
    """With p = 2 the regression is ARX(2, 3) with direct term, and K the predictor's gain."""
    data = record(0)
    observer = okid(data, 2, p=2)
    arx = sysid.arx(data, 2, 3, 0)
    a1, a2, b0, b1, b2 = arx.parameters
    np.testing.assert_allclose(observer.parameters, [b0, b1, -a1, b2, -a2], atol=1e-10)
    deviations = np.sqrt(np.diag(arx.covariance))[[2, 3, 0, 4, 1]]
    np.testing.assert_allclose(np.sqrt(np.diag(observer.covariance)), deviations, rtol=1e-6)
    np.testing.assert_allclose(observer.noise_variance, arx.noise_variance, rtol=1e-8)
    bare = okid(data, 2, p=3, direct=False)
    np.testing.assert_array_equal(bare.model.D, [[0.0]])
    assert len(bare.parameters) == 6
    assert observer.parameter_names == ("y1: u1(t)", "y1: u1(t-1)", "y1: y1(t-1)", "y1: u1(t-2)", "y1: y1(t-2)")


def test_the_gain_is_the_innovation_gain():
    """K = c - a = (1.5, -0.7) in companion form: compare the noise responses, whatever the basis."""
    model = okid(record(2, samples=20_000), 2, p=4).model
    f = np.linspace(0.05, 4.9, 20)
    z = np.exp(-2j * np.pi * f * 0.1)
    truth = 1.0 / (1 - 1.5 * z + 0.7 * z**2)
    np.testing.assert_allclose(model.noise_response(f)[:, 0, 0], truth, atol=0.1 * np.abs(truth).max())
    errors = sysid.residuals(model, record(3))
    assert np.std(errors) == pytest.approx(0.3, rel=0.05)


@pytest.mark.thorough
def test_intervals_cover():
    truth = sysid.models.innovations_form(sysid.Polynomials(A, B), 0.1)
    hz, f = truth.bandwidth()[0, 0], np.array([0.2, 1.0, 3.0])
    g = np.abs(truth.frequency_response(f))
    bandwidths, responses = [], []
    for seed in range(100):
        estimate = okid(record(seed, samples=2000), 2, p=3)
        bandwidths.append(bool(estimate.bandwidth().covers(hz)[0, 0]))
        responses.append(covered(estimate.frequency_response(f).magnitude_ci95(), g))
    # three binomial standard deviations below 95 % of 100
    assert np.mean(bandwidths) > 0.88
    assert np.mean(responses, axis=0).min() > 0.88


def test_unstable_gains_are_replaced_by_the_factor_of_the_same_spectrum():
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
        (2, 250, "too many observer parameters"),
    ],
)
def test_refusals(order, p, message):
    refused(message, lambda: okid(record(0, samples=400), order, p=p))


def test_deadbeat_option():
    truth = multivariable()
    u = np.random.default_rng(0).standard_normal((600, 2))
    data = IOData(u, simulate(truth, u) + 1e-6 * np.random.default_rng(1).standard_normal((600, 2)), 0.02)
    model = okid(data, 4, p=4, deadbeat=True).model
    observer = model.A - model.gain @ model.C
    np.testing.assert_allclose(np.linalg.matrix_power(observer, 2), 0.0, atol=1e-8)
    np.testing.assert_allclose(model.markov(9), truth.markov(9), atol=1e-3)


@DEPENDENT
def test_a_start_at_rest_uses_every_sample():
    """22 samples determine 18 coefficients per output, which 17 samples behind the first five cannot."""
    truth = multivariable()
    u = np.random.default_rng(0).standard_normal((22, 2))
    data = IOData(u, simulate(truth, u), 0.02)
    refused("too many observer parameters", lambda: okid(data, 4, p=5))
    estimate = okid(data, 4, p=4, at_rest=True)
    np.testing.assert_allclose(estimate.model.markov(20), truth.markov(20), atol=1e-8)
    # from the middle the same claim is wrong, and the fit shows it
    late = IOData(np.vstack((u, u)), simulate(truth, np.vstack((u, u))), 0.02)[22:]
    assert np.abs(okid(late, 4, p=4, at_rest=True).model.markov(20) - truth.markov(20)).max() > 1e-3


def flexible(samples, outputs=28, noise=0.05):
    """Three lightly damped modes, two inputs and many outputs: the truth and a record of it."""
    rng = np.random.default_rng(0)
    A = np.zeros((6, 6))
    for k, pole in enumerate((0.99 * np.exp(0.1j), 0.97 * np.exp(0.45j), 0.95 * np.exp(1.2j))):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
    B, C = rng.standard_normal((6, 2)), rng.standard_normal((outputs, 6))
    truth = StateSpace(A, B, C, np.zeros((outputs, 2)), None, 0.02)
    u = rng.standard_normal((samples, 2))
    y = simulate(truth, u)
    return truth, IOData(u, y + noise * y.std(axis=0) * rng.standard_normal(y.shape), 0.02)


def peak(data, p):
    """Peak memory of a fit, bytes."""
    tracemalloc.start()
    try:
        okid(data, 6, p=p)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.filterwarnings("ignore:28 outputs")
def test_memory_grows_with_p_and_not_with_its_square():
    """The covariance of all observer parameters would take 0.6 GB with p = 10, and 5 GB with p = 30."""
    data = flexible(800)[1]
    small, large = peak(data, 5), peak(data, 10)
    assert large < 2.2 * small
    assert large < 50e6


@pytest.mark.slow
def test_memory_per_sample_does_not_depend_on_p():
    data = flexible(80_000, outputs=4)[1]
    for p in (5, 20):
        per_sample = (peak(data, p) - peak(data[:40_000], p)) / 40_000
        # six channels of 8 bytes; a row of regressors alone would take 122 values with p = 20
        assert per_sample < 12 * 6 * 8


@pytest.mark.filterwarnings("ignore:28 outputs")
def test_many_outputs_have_a_model_without_intervals():
    truth, data = flexible(1000)
    with pytest.warns(SysidWarning, match="make 8456 observer parameters.* p = 4 keeps them"):
        estimate = okid(data, 6, p=10)
    assert not np.isfinite(estimate.covariance).any()
    assert estimate.frequency_response([1.0]).covariance is None
    assert np.isnan(estimate.bandwidth().ci95[0]).all()
    same = pickle.loads(pickle.dumps(estimate)).realise(estimate.parameters)
    np.testing.assert_allclose(same.markov(30), estimate.model.markov(30), atol=1e-10)
    np.testing.assert_allclose(same.gain, estimate.model.gain, atol=1e-10)
    error = np.linalg.norm(estimate.model.markov(60) - truth.markov(60)) / np.linalg.norm(truth.markov(60))
    assert error < 0.02


@pytest.mark.filterwarnings("ignore:28 outputs")
def test_advice_on_an_unstable_model_helps():
    """With 362 coefficients per output and 388 samples, a larger p is impossible, and half of p helps."""
    truth, data = flexible(400)
    with pytest.warns(SysidWarning, match=r"unstable: .*; p = 6 gives a stable one \(p = 12 leaves 1.1 samples"):
        unstable = okid(data, 6, p=12)
    advised = okid(data, 6, p=6)
    assert not unstable.model.is_stable()
    assert advised.model.is_stable()
    errors = [np.linalg.norm(e.model.markov(60) - truth.markov(60)) for e in (unstable, advised)]
    assert errors[1] < 0.1 * errors[0]
    growing = simulate(StateSpace([[1.02]], [[1.0]], [[1.0]], [[0.0]], None, 0.1), data.u[:, :1])
    with pytest.warns(SysidWarning, match=r"try a larger p, another order or n4sid\(data, order, stable=True\)"):
        okid(IOData(data.u[:, 0], growing + 0.01 * data.y[:, :1], 0.1), 1, p=4)


@DEPENDENT
@pytest.mark.parametrize("noise", [0.0, 0.3])
@pytest.mark.parametrize("at_rest", [False, True])
def test_blocks_of_samples_give_the_same_estimate(monkeypatch, noise, at_rest):
    """Without noise the regressors depend on each other, and QR updates replace the normal equations."""
    parts = [second_order(seed, 500, noise, lost=lost) for seed, lost in ((0, 0.0), (1, 0.05))]
    whole = okid(parts, 2, p=4, at_rest=at_rest)
    monkeypatch.setattr(observer_regression, "BLOCK", 200)
    blocks = okid(parts, 2, p=4, at_rest=at_rest)
    np.testing.assert_allclose(blocks.parameters, whole.parameters, atol=1e-9)
    np.testing.assert_allclose(blocks.covariance, whole.covariance, rtol=1e-6, atol=1e-20)
    np.testing.assert_allclose(blocks.noise_variance, whole.noise_variance, rtol=1e-6, atol=1e-20)


METHODS = {
    "era": era,
    "era_dc": era_dc,
    "era_dc, four lags": partial(era_dc, lags=4),
}
GRID = np.linspace(0.0, 25.0, 30)


@pytest.mark.parametrize("method", METHODS)
def test_exact_from_exact_markov_parameters(method):
    truth = multivariable()
    realisation = METHODS[method](truth.markov(41), 4, dt=0.02)
    response = realisation.model.frequency_response(GRID)
    np.testing.assert_allclose(response, truth.frequency_response(GRID), rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(np.sort_complex(realisation.model.poles()), np.sort_complex(truth.poles()), atol=1e-8)
    assert realisation.percent_described == pytest.approx(100.0, abs=1e-10)


def test_one_lag_is_era_in_other_words():
    noisy = multivariable().markov(41) + 0.01 * np.random.default_rng(1).standard_normal((41, 2, 2))
    plain, one = (method(noisy, 4, block_rows=20, block_columns=20) for method in (era, partial(era_dc, lags=1)))
    np.testing.assert_allclose(one.model.markov(30), plain.model.markov(30), atol=1e-9)


def test_singular_values_of_a_known_system():
    """One pole: H is b c [l^i l^j], of rank one, with singular value b c sum l^2i."""
    pole, gain = 0.8, 3.0
    realisation = era([0.0, *(gain * pole ** np.arange(20))], 1, block_rows=10, block_columns=10)
    expected = gain * np.sum(pole ** (2 * np.arange(10)))
    assert realisation.hankel_singular_values[0] == pytest.approx(expected, rel=1e-12)
    assert realisation.modal_singular_values[0] == pytest.approx(np.sqrt(gain / (1 - pole)), rel=1e-10)
    assert realisation.model.poles()[0] == pytest.approx(pole, rel=1e-12)


def test_percent_described_uses_squares():
    realisation = era(multivariable().markov(41), 2)
    xi = realisation.hankel_singular_values
    assert realisation.percent_described == pytest.approx(100 * np.sum(xi[:2] ** 2) / np.sum(xi**2))
    assert realisation.percent_described_unsquared == pytest.approx(100 * np.sum(xi[:2]) / np.sum(xi))
    assert realisation.percent_described > realisation.percent_described_unsquared


def test_orders_beyond_the_rank_are_reduced_with_a_warning():
    with pytest.warns(SysidWarning, match="numerical rank 4: the model has order 4 instead of 6"):
        assert era(multivariable().markov(41), 6).model.order == 4


def test_refusals_of_era():
    y = multivariable().markov(11)
    refused("block_rows", lambda: era(y, 2, block_rows=8, block_columns=8))
    refused("order must be", lambda: era(y, 0))
    refused("order must be", lambda: era(y, 500))
    refused("all zero", lambda: era([1.0, 0.0, 0.0, 0.0], 1))
    refused("at least 3", lambda: era([1.0, 2.0], 1))
    refused("lags", lambda: era_dc(y, 2, lags=0))
    refused("block_rows", lambda: era_dc(y, 2, lags=9))
