import warnings

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import lfilter

import sysid
from sysid import IOData, SysidError

B, F = [0.0, 1.0, 0.4], [1.0, -1.2, 0.5]


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def record(rng, samples=500, outliers=10.0, offset=0.0):
    u = rng.standard_normal(samples)
    errors = 0.3 * rng.standard_normal(samples)
    errors[rng.choice(samples, samples // 100, replace=False)] += 0.3 * outliers
    return IOData(u, offset + lfilter(B, F, u) + errors, dt=0.1)


def quiet(estimator, *args, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return estimator(*args, **options)


def simulation_errors(theta, data, states):
    """Errors from rest, with pulses at the first samples as free initial conditions, and a constant."""
    f = np.concatenate(([1.0], theta[2:4]))
    response = lfilter(np.concatenate(([0.0], theta[:2])), f, data.u[:, 0])
    pulses = np.zeros(len(data))
    pulses[:states] = theta[4 : 4 + states]
    return data.y[:, 0] - response - lfilter([1.0], f, pulses) - theta[4 + states :].sum()


def assert_same(fit, theta):
    """Searches end at a thousandth of a standard deviation."""
    deviations = np.sqrt(np.diag(fit.covariance))
    assert np.abs((fit.parameters - theta) / deviations).max() < 2e-3


@pytest.mark.parametrize(
    ("conditions", "states", "offset"), [("zero", 0, False), ("estimated", 2, False), ("estimated", 2, True)]
)
def test_the_estimate_minimises_hubers_loss_as_scipy_does(conditions, states, offset, rng):
    data = record(rng, offset=2.0 * offset)
    fit = quiet(sysid.oe, data, 2, 2, error_threshold=1.6, initial_conditions=conditions, offset=offset)
    limit = 1.6 * fit.diagnostics["error_scale"]
    start = np.concatenate((fit.parameters, np.zeros(states), *fit.diagnostics.get("offsets", [])))
    expected = least_squares(
        simulation_errors, start, args=(data, states), loss="huber", f_scale=limit, xtol=1e-14, ftol=1e-14, gtol=1e-12
    )
    assert_same(fit, expected.x[:4])
    if offset:
        assert fit.diagnostics["offsets"][0][0] == pytest.approx(expected.x[-1], rel=1e-3)
    assert fit.diagnostics["errors_beyond_threshold"] == np.sum(np.abs(expected.fun) > limit)


def test_gross_outliers_move_the_squares_and_not_the_threshold():
    poles = {0.0: [], 1.6: []}
    inside = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        u = rng.standard_normal(1000)
        y = lfilter([0.0, 1.0], [1.0, -0.75], u) + 0.1 * rng.standard_normal(1000)
        # ten standard deviations of the output
        y[rng.choice(1000, 10, replace=False)] += 10.0 * y.std()
        for threshold, estimates in poles.items():
            fit = quiet(sysid.oe, IOData(u, y, dt=0.1), 1, 1, error_threshold=threshold)
            estimates.append(-fit.parameters[1])
        inside.append(abs(poles[1.6][-1] - 0.75) < 1.96 * np.sqrt(fit.covariance[1, 1]))
    assert np.std(poles[0.0]) > 10.0 * np.std(poles[1.6])
    # 95 % of 40, give or take four binomial deviations
    assert sum(inside) >= 32


@pytest.mark.parametrize(
    ("estimator", "orders"),
    [(sysid.arx, (2, 2)), (sysid.armax, (2, 2, 1)), (sysid.bj, (2, 1, 1, 2)), (sysid.polyest, (1, 2, 0, 0, 1))],
)
def test_all_methods_take_a_threshold_that_hardly_matters_without_outliers(estimator, orders, rng):
    u = rng.standard_normal(2000)
    y = lfilter([0.0, 1.0], [1.0, -0.75], u) + lfilter([1.0], [1.0, -0.75], 0.2 * rng.standard_normal(2000))
    plain = quiet(estimator, IOData(u, y, dt=0.1), *orders)
    robust = quiet(estimator, IOData(u, y, dt=0.1), *orders, error_threshold=1.6)
    deviations = np.sqrt(np.diag(plain.covariance))
    difference = np.abs(robust.model.dc_gain() - plain.model.dc_gain())[0, 0]
    assert 0.0 < difference < 0.05
    assert np.isfinite(robust.covariance).all()
    # a threshold that no error reaches leaves least squares
    limit = 20.0
    same = quiet(estimator, IOData(u, y, dt=0.1), *orders, error_threshold=limit)
    assert np.abs((same.parameters - plain.parameters) / deviations).max() < 1e-3
    np.testing.assert_allclose(np.sqrt(np.diag(same.covariance)) / deviations, 1.0, rtol=0.02)


def test_the_known_outputs_alone_count(rng):
    data = record(rng)
    y = data.y.copy()
    y[200:260] = np.nan
    gapped = IOData(data.u, y, dt=0.1, missing=True)
    fit = quiet(sysid.oe, gapped, 2, 2, error_threshold=1.6, initial_conditions="zero")
    limit = 1.6 * fit.diagnostics["error_scale"]

    def known_errors(theta):
        return simulation_errors(theta, gapped, 0)[gapped.known[:, 0]]

    expected = least_squares(known_errors, fit.parameters, loss="huber", f_scale=limit, xtol=1e-14, ftol=1e-14)
    assert_same(fit, expected.x)
    regression = quiet(sysid.arx, gapped, 2, 2, error_threshold=1.6)
    assert np.isfinite(regression.parameters).all()


def test_errors_that_are_all_zero_need_no_threshold(rng):
    u = rng.standard_normal(300)
    fit = quiet(sysid.oe, IOData(u, lfilter(B, F, u), dt=0.1), 2, 2, error_threshold=1.6)
    np.testing.assert_allclose(fit.parameters, [*B[1:], *F[1:]], rtol=1e-8)


def test_thresholds_that_do_not_go_are_refused(rng):
    data = record(rng)
    for value in (-1.0, True, "huber", np.nan):
        with pytest.raises(SysidError, match="error_threshold"):
            sysid.oe(data, 2, 2, error_threshold=value)
    with pytest.raises(SysidError, match="coloured"):
        sysid.armax(data, 2, 2, 2, error_threshold=1.6, coloured=True)
    with pytest.raises(SysidError, match="regularisation"):
        sysid.arx(data, 2, 2, error_threshold=1.6, regularisation="tc")
    with pytest.raises(SysidError, match="backcast"):
        sysid.bj(data, 2, 1, 1, 2, error_threshold=1.6, initial_conditions="backcast")
    y = data.y.copy()
    y[100] = np.nan
    with pytest.raises(SysidError, match="complete outputs"):
        sysid.armax(IOData(data.u, y, dt=0.1, missing=True), 2, 2, 2, error_threshold=1.6)
