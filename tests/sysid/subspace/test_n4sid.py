import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, StateSpace, SysidWarning, n4sid, okid, residuals
from tests.refusals import refused
from tests.sysid.systems import exact_system, multivariable, record_in_motion

U = np.random.default_rng(0).standard_normal(300)
GROWING = IOData(U, lfilter([0, 1.0], [1, -1.02], U), 0.1)


def test_multivariable_in_unlike_units_and_two_experiments():
    truth = multivariable()
    scaled = StateSpace(truth.A, truth.B / [1.0, 1e3], truth.C, truth.D / [1.0, 1e3], None, 0.02)
    parts = [record_in_motion(scaled, n, seed, scale=1e3) for n, seed in ((300, 0), (500, 1))]
    for data in (parts, parts[::-1]):
        np.testing.assert_allclose(n4sid(data, 4).model.markov(20), scaled.markov(20), atol=1e-9)


def test_the_gain_is_the_innovation_gain():
    truth = multivariable()
    estimate = n4sid(record_in_motion(truth, 20_000, noise=1.0), 4)
    f = np.linspace(0.1, 24.0, 30)
    expected = truth.noise_response(f)
    error = np.abs(estimate.model.noise_response(f) - expected).max()
    assert error < 0.05 * np.abs(expected).max()
    np.testing.assert_allclose(estimate.noise_variance, np.eye(2), atol=0.05)
    fresh = residuals(estimate, record_in_motion(truth, 2000, 5, noise=1.0))
    assert np.mean(fresh**2) == pytest.approx(1.0, rel=0.06)


def test_error_falls_with_the_root_of_samples():
    truth = multivariable()
    expected = truth.markov(50)
    sizes = (1000, 16_000)
    errors = [
        np.mean(
            [np.linalg.norm(n4sid(record_in_motion(truth, n, s, 0.3), 4).model.markov(50) - expected) for s in range(8)]
        )
        for n in sizes
    ]
    slope = np.log(errors[1] / errors[0]) / np.log(sizes[1] / sizes[0])
    assert -0.65 < slope < -0.35


def test_options():
    data = record_in_motion(multivariable(direct=False), 1000, noise=0.1)
    bare = n4sid(data, 4, direct=False, gain=False, block_rows=8)
    assert not bare.model.D.any()
    assert not bare.model.gain.any()
    assert len(bare.parameters) == 4 * (2 + 2)
    assert len(n4sid(data, 4).parameters) == 4 * (2 + 2 * 2) + 4
    assert bare.orders == {"order": 4, "block_rows": 8}
    assert np.isnan(bare.bandwidth().ci95[0]).all()
    assert bare.frequency_response([1.0]).covariance is None


@pytest.mark.filterwarnings("ignore:the regressors have rank")
@pytest.mark.parametrize(
    ("estimator", "rank"),
    [(n4sid, "2 nonzero canonical correlations"), (lambda d, n: okid(d, n, p=n), "numerical rank 2")],
    ids=["n4sid", "okid"],
)
def test_superfluous_orders_are_reduced_and_unstable_systems_reported(estimator, rank):
    with pytest.warns(SysidWarning, match=rank):
        estimate = estimator(exact_system(2, 1)[1], 5)
    assert estimate.model.order == 2
    assert any(rank in text for text in estimate.diagnostics["warnings"])
    with pytest.warns(SysidWarning, match="unstable: largest pole modulus 1.02"):
        growing = estimator(GROWING, 1)
    np.testing.assert_allclose(growing.model.poles(), [1.02], atol=1e-8)


def test_unstable_systems_without_gain_or_forbidden():
    with pytest.warns(SysidWarning, match="unstable"):
        bare = n4sid(GROWING, 1, gain=False)
    assert not bare.model.gain.any()
    np.testing.assert_allclose(bare.model.markov(5)[:, 0, 0], [0.0, *1.02 ** np.arange(4)], atol=1e-8)
    assert n4sid(GROWING, 1, stable=True).model.is_stable()


def test_refusals():
    data = record_in_motion(multivariable(), 200, noise=0.1)
    refused("order must be a whole number", lambda: n4sid(data, 0))
    refused("block_rows must be a whole number from 3", lambda: n4sid(data, 4, block_rows=2))
    refused("block_rows", lambda: n4sid(data, 4, block_rows=40))
    refused("too many states for the data", lambda: n4sid(data[:20], 15))
    refused("constant", lambda: n4sid(IOData(np.ones(100), np.arange(100.0), 0.1), 1))
