import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, StateSpace, SysidWarning, n4sid, okid, residuals, simulate
from sysid.models.predict import predict
from sysid.validation import fit_percent
from tests.refusals import refused
from tests.sysid.systems import exact_system, multivariable, record_in_motion

U = np.random.default_rng(0).standard_normal(300)
GROWING = IOData(U, lfilter([0, 1.0], [1, -1.02], U), 0.1)


def test_multivariable_in_unlike_units_and_two_experiments():
    truth = multivariable()
    scaled = StateSpace(truth.A, truth.B / [1.0, 1e3], truth.C, truth.D / [1.0, 1e3], None, 0.02)
    parts = [record_in_motion(scaled, n, seed, scale=1e3) for n, seed in ((300, 0), (500, 1))]
    for data in (parts, parts[::-1]):
        for weighting in ("cva", "moesp"):
            estimate = n4sid(data, 4, weighting=weighting)
            np.testing.assert_allclose(estimate.model.markov(20), scaled.markov(20), atol=1e-9)


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


@pytest.mark.slow
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


SLOW = StateSpace(
    np.diag([0.999, 0.6, 0.3, -0.4]), [[0.1], [1.0], [1.0], [1.0]], [[1.0, 0.5, -0.4, 0.3]], [[0.0]], None, 1.0
)
"""A pole with a time constant of 1,000 samples beside three fast ones."""


def slow_record(seed, samples=300):
    """A record shorter than the slow time constant, with noise at the output."""
    rng = np.random.default_rng(seed)
    u = rng.choice([-1.0, 1.0], (samples, 1))
    return IOData(u, simulate(SLOW, u) + 0.3 * rng.standard_normal((samples, 1)), 1.0)


def simulated_fit(estimate, data):
    return float(fit_percent(data.y, predict(estimate.model, data, steps=None))[0])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 5, 7, 10])
@pytest.mark.parametrize("block_rows", [10, None])
def test_stability_costs_no_fit_on_slow_data(seed, block_rows):
    """An observability matrix continued by zeros moves the slow pole to 0.8, at a cost of up to 88 points of fit."""
    data = slow_record(seed)
    with pytest.warns(SysidWarning, match="unstable"):
        free = n4sid(data, 4, block_rows=10)
    stable = n4sid(data, 4, block_rows=block_rows, stable=True)
    assert 0.997 < np.abs(stable.poles()).max() < 1.0
    assert simulated_fit(stable, data) > simulated_fit(free, data) - 0.5


def test_only_the_unstable_pole_is_moved():
    data = slow_record(7)
    with pytest.warns(SysidWarning, match="unstable"):
        free = n4sid(data, 4, block_rows=10)
    stable = n4sid(data, 4, block_rows=10, stable=True)
    np.testing.assert_allclose(stable.poles()[1:], free.poles()[1:], atol=1e-8)
    assert stable.diagnostics["moved_poles"] == pytest.approx((np.abs(free.poles()[0]),))
    assert free.diagnostics["moved_poles"] == ()


def test_the_horizon_grows_with_the_slowest_time_constant():
    assert n4sid(record_in_motion(multivariable(), 1000, noise=0.1), 4).orders["block_rows"] == 10
    data = [slow_record(seed, samples=2000) for seed in range(6)]
    by_default, short = ([n4sid(d, 4, block_rows=s) for d in data] for s in (None, 10))
    assert {e.orders["block_rows"] for e in by_default} == {30}
    f = np.geomspace(1e-3, 0.5, 40)
    truth = SLOW.frequency_response(f)
    errors = [[np.linalg.norm(e.model.frequency_response(f) - truth) for e in one] for one in (by_default, short)]
    assert np.mean(errors[0]) < 0.6 * np.mean(errors[1])


def test_refusals():
    data = record_in_motion(multivariable(), 200, noise=0.1)
    refused("order must be a whole number", lambda: n4sid(data, 0))
    refused("block_rows must be a whole number from 3", lambda: n4sid(data, 4, block_rows=2))
    refused("block_rows", lambda: n4sid(data, 4, block_rows=40))
    refused("too many states for the data", lambda: n4sid(data[:20], 15))
    refused("weighting must be one of cva, moesp, got 'n4sid'", lambda: n4sid(data, 4, weighting="n4sid"))
    refused("constant", lambda: n4sid(IOData(np.ones(100), np.arange(100.0), 0.1), 1))
