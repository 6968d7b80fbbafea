import warnings

import numpy as np
import pytest
from numpy import nan
from scipy.optimize import least_squares
from scipy.signal import lfilter

import sysid
from sysid import IOData, SysidError

B, F = [0.0, 1.0, 0.4], [1.0, -1.2, 0.5]


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def record(rng, samples=600, offset=0.0):
    u = rng.standard_normal(samples)
    return IOData(u, offset + lfilter(B, F, u) + 0.3 * rng.standard_normal(samples), dt=0.1)


def quiet(estimator, *args, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return estimator(*args, **options)


def test_arx_with_known_coefficients_is_least_squares_of_the_others(rng):
    data = record(rng)
    y, u = data.y[:, 0], data.u[:, 0]
    fit = sysid.arx(data, 2, 2, fixed={"A": [1, nan, 0.5], "B": [0, 1.0, nan]})
    phi = np.column_stack((-y[1:-1], u[:-2]))
    target = y[2:] + 0.5 * y[:-2] - 1.0 * u[1:-1]
    expected, squares, *_ = np.linalg.lstsq(phi, target, rcond=None)
    np.testing.assert_allclose(fit.parameters, [expected[0], 0.5, 1.0, expected[1]], rtol=1e-12)
    covariance = np.zeros((4, 4))
    covariance[np.ix_([0, 3], [0, 3])] = squares[0] / (598 - 2) * np.linalg.inv(phi.T @ phi)
    np.testing.assert_allclose(fit.covariance, covariance, rtol=1e-9)
    # two parameters count, not four
    assert fit.bic == pytest.approx(np.log(fit.loss) + 2 * np.log(600) / 600)


@pytest.mark.parametrize("conditions", ["zero", "estimated"])
def test_oe_with_a_known_coefficient_is_the_minimum_over_the_others(conditions, rng):
    data = record(rng)
    fit = sysid.oe(data, 2, 2, fixed={"F": [1, nan, 0.5]}, initial_conditions=conditions, coloured=False)

    def errors(theta):
        f = [1.0, theta[2], 0.5]
        pulses = np.zeros(len(data))
        pulses[: len(theta) - 3] = theta[3:]
        return data.y[:, 0] - lfilter([0.0, *theta[:2]], f, data.u[:, 0]) - lfilter([1.0], f, pulses)

    states = 0 if conditions == "zero" else 2
    expected = least_squares(errors, [*fit.parameters[:3], *np.zeros(states)], xtol=1e-14, ftol=1e-14, gtol=1e-14)
    deviations = np.sqrt(np.diag(fit.covariance))
    assert fit.parameters[3] == 0.5
    assert deviations[3] == 0.0
    assert np.abs((fit.parameters[:3] - expected.x[:3]) / deviations[:3]).max() < 1e-3
    variance = 2.0 * expected.cost / (600 - 3 - states)
    covariance = variance * np.linalg.inv(expected.jac.T @ expected.jac)[:3, :3]
    np.testing.assert_allclose(fit.covariance[:3, :3], covariance, rtol=1e-4)


def test_intervals_of_the_others_hold_the_truth():
    inside = []
    for seed in range(100):
        fit = quiet(sysid.bj, record(np.random.default_rng(seed), 300), 2, 1, 1, 2, fixed={"F": [1, nan, 0.5]})
        deviations = np.sqrt(np.diag(fit.covariance))
        inside.append(np.abs(fit.parameters[[0, 1, 4]] - [1.0, 0.4, -1.2]) < 1.96 * deviations[[0, 1, 4]])
    # 285 of 300 are expected, correlated ones
    assert np.sum(inside) >= 265


def test_a_known_integrator(rng):
    u = rng.standard_normal(500)
    y = lfilter([0.0, 0.5], [1.0, -1.0], u) + 0.3 * rng.standard_normal(500)
    fit = quiet(sysid.oe, IOData(u, y, dt=0.1), 1, 1, fixed={"F": [1, -1]})
    # a line through the sums of the input, with a constant as the free state
    sums = np.concatenate(([0.0], np.cumsum(u)[:-1]))
    slope = np.polyfit(sums, y, 1)[0]
    assert fit.parameters[0] == pytest.approx(slope, rel=1e-9)


def test_an_integrator_beside_other_poles_is_a_sum_of_the_input(rng):
    u = rng.standard_normal(1000)
    y = lfilter(B, np.convolve(F, [1.0, -1.0]), u) + 0.2 * rng.standard_normal(1000)
    fit = sysid.oe(IOData(np.cumsum(u), y, dt=0.1), 2, 2, offset=True)
    deviations = np.sqrt(np.diag(fit.covariance))
    assert (np.abs(fit.parameters - [*B[1:], *F[1:]]) < 4.0 * deviations).all()


@pytest.mark.parametrize(
    ("estimator", "orders", "fixed", "known"),
    [
        (sysid.arx, (2, 2), {"a": [1, -1.2, 0.5]}, {0: -1.2, 1: 0.5}),
        (sysid.armax, (2, 2, 2), {"c": [1, nan, 0.5], "a": [1, nan, 0.5]}, {1: 0.5, 5: 0.5}),
        (sysid.bj, (2, 1, 1, 2), {"d": [1, -0.3], "b": [0, nan, 0.4]}, {1: 0.4, 3: -0.3}),
        (sysid.polyest, (1, 2, 1, 0, 1), {"A": [1, -0.5]}, {0: -0.5}),
        (sysid.oe, (2, 2), {"F": [1, -1.2, nan]}, {2: -1.2}),
    ],
)
def test_experiments_gaps_offsets_and_thresholds_go_with_known_coefficients(estimator, orders, fixed, known, rng):
    first, second = record(rng, offset=3.0), record(rng, 400, offset=-1.0)
    y = second.y.copy()
    y[100:110] = nan
    gapped = IOData(second.u, y, dt=0.1, missing=True)
    places = list(known)
    others = [k for k in range(sum(orders)) if k not in known]
    for threshold in (0.0, 1.6):
        # beside C or D a threshold needs complete outputs
        last = second if threshold and estimator not in (sysid.arx, sysid.oe) else gapped
        fit = quiet(estimator, [first, last], *orders, fixed=fixed, offset=True, error_threshold=threshold)
        np.testing.assert_array_equal(fit.parameters[places], list(known.values()))
        variances = np.diag(fit.covariance)
        assert (variances[places] == 0.0).all()
        assert (variances[others] > 0.0).all()
        np.testing.assert_allclose(fit.diagnostics["offsets"], [[3.0], [-1.0]], atol=0.5)


def test_inputs_have_rows_of_their_own(rng):
    u = rng.standard_normal((800, 2))
    y = lfilter(B, F, u[:, 0]) + lfilter([0.0, 0.7], [1.0, -0.5], u[:, 1]) + 0.1 * rng.standard_normal(800)
    fit = sysid.oe(IOData(u, y, dt=0.1), (2, 1), (2, 1), fixed={"F": [None, [1, -0.5]]})
    assert fit.parameter_names[-1] == "f1[2]"
    assert fit.parameters[-1] == -0.5
    deviations = np.sqrt(np.diag(fit.covariance))
    assert (np.abs(fit.parameters - [1.0, 0.4, 0.7, -1.2, 0.5, -0.5])[:-1] < 4.0 * deviations[:-1]).all()


def test_nothing_fixed_changes_no_bit(rng):
    data = record(rng)
    for estimator, orders in ((sysid.oe, (2, 2)), (sysid.arx, (2, 2))):
        plain = estimator(data, *orders)
        free = estimator(data, *orders, fixed={"B": [0, nan, nan]})
        assert plain.parameters.tobytes() == free.parameters.tobytes()
        assert plain.covariance.tobytes() == free.covariance.tobytes()


@pytest.mark.parametrize(
    ("fixed", "message"),
    [
        ({"F": [1, nan]}, "expected 3 finite numbers or NaN in F"),
        ({"F": [nan, 0.5, nan]}, "expected F to begin with 1 leading 1"),
        ({"B": [1.0, nan, nan]}, "expected B to begin with 1 leading zeros of nk"),
        ({"A": [1, nan]}, "expected polynomials among B, F, got 'A'"),
        ({"F": [1, -2.5, 1.0]}, "root of modulus 2"),
        ({"F": [1, np.inf, nan]}, "finite"),
        ({"f": [1, 0.5, nan], "F": [1, nan, 0.1]}, "F given twice"),
        ({"F": "text"}, "numbers or NaN"),
        ({"F": [1, 0.1, 0.1], "B": [0, 1, 1]}, "every coefficient"),
        ([1, nan], "expected polynomials by letter"),
    ],
)
def test_wrong_coefficients_are_refused(fixed, message, rng):
    with pytest.raises(SysidError, match=message):
        sysid.oe(record(rng), 2, 2, fixed=fixed)


def test_a_prior_and_too_few_rows_are_refused(rng):
    with pytest.raises(SysidError, match="regularisation"):
        sysid.arx(record(rng), 2, 2, fixed={"A": [1, nan, 0.5]}, regularisation="tc")
    u = rng.standard_normal((100, 2))
    with pytest.raises(SysidError, match="expected 2 rows of F"):
        sysid.oe(IOData(u, u[:, 0], dt=0.1), 1, 1, fixed={"F": [[1, 0.5]]})
