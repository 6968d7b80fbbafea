import numpy as np
import pytest
import scipy.linalg
from scipy.signal import lfilter

from sysid import InitialConditions, IOData, armax, bj, oe, residuals
from sysid.polynomial.error_jacobian import error_jacobian, free_transients
from sysid.polynomial.gram_matrices import lagged_solution
from sysid.polynomial.least_squares import solve
from sysid.polynomial.orders import Orders, make_orders
from sysid.polynomial.prediction_error import InitialEstimate, admissible, linearise, minimise, search
from sysid.polynomial.stability_limit import constrained_step
from tests.refusals import refused
from tests.sysid.systems import A, B, second_order

STRUCTURES = {
    "armax": make_orders(1, na=2, nb=2, nc=2, nk=1),
    "oe": make_orders(1, nb=2, nf=3, nk=0),
    "bj": make_orders(1, nb=1, nc=2, nd=1, nf=2, nk=2),
    "all": make_orders(1, na=1, nb=2, nc=1, nd=2, nf=1, nk=1),
    "two inputs": make_orders(2, nb=(1, 2), nf=(2, 1), nk=(1, 0), nc=1, nd=1),
}


def noise_record(orders, samples=120, seed=0):
    rng = np.random.default_rng(seed)
    return IOData(rng.standard_normal((samples, len(orders.nb))), rng.standard_normal(samples) + 3.0, 0.1)


def some_parameters(orders):
    rng = np.random.default_rng(4)
    return 0.3 * rng.standard_normal(orders.count)


@pytest.mark.parametrize("initial_conditions", InitialConditions)
@pytest.mark.parametrize("name", STRUCTURES)
def test_gradient_is_that_of_the_projected_criterion(name, initial_conditions):
    orders = STRUCTURES[name]
    data = [noise_record(orders), noise_record(orders, 80, 1)]
    theta = some_parameters(orders)
    assert admissible(orders, theta)
    at = linearise(data, orders, theta, initial_conditions)
    gradient = 2.0 * at.scale * (at.triangle.T @ at.target)

    def cost(step):
        return linearise(data, orders, theta + 1e-6 * step, initial_conditions).cost

    numeric = [(cost(step) - cost(-step)) / 2e-6 for step in np.eye(orders.count)]
    np.testing.assert_allclose(gradient, numeric, rtol=1e-5, atol=1e-5 * np.abs(gradient).max())


@pytest.mark.parametrize("name", STRUCTURES)
def test_every_accepted_step_keeps_the_predictor_stable(name):
    orders = STRUCTURES[name]
    # pure noise pushes C and F wherever it likes
    minimum = minimise([noise_record(orders)], orders, some_parameters(orders))
    assert admissible(orders, minimum.at.theta)
    assert minimum.at.cost < linearise([noise_record(orders)], orders, some_parameters(orders)).cost


@pytest.mark.filterwarnings("ignore:the parameters are poorly determined", "ignore:[CD] has a root")
@pytest.mark.parametrize(
    ("estimator", "orders"), [(armax, (2, 2, 2)), (oe, (2, 2)), (bj, (2, 1, 1, 2))], ids=["armax", "oe", "bj"]
)
def test_zero_is_exact_from_rest_from_the_first_sample_on(estimator, orders):
    estimate = estimator(second_order(0, 60, noise=0.0), *orders, initial_conditions=InitialConditions.ZERO)
    np.testing.assert_allclose(estimate.model.markov(20)[:, 0, 0], lfilter(B, A, np.eye(20)[0]))
    assert estimate.diagnostics["rows"] == 60
    assert estimate.diagnostics["initial_conditions"] == 0


def test_zero_biases_a_record_from_the_middle(p2):
    """With a free past, records that begin anywhere give the parameters exactly."""
    system, u = p2.polynomials, p2.reference[:, 0]
    whole = IOData(u, lfilter(system.B, system.F, u), 0.02)
    data = whole[777:1777]
    at_rest = oe(data, 2, 2, initial_conditions=InitialConditions.ZERO)
    rest = at_rest.parameters
    assert at_rest.loss == pytest.approx(at_rest.diagnostics["sum_of_squares"] / at_rest.diagnostics["rows"], rel=1e-9)
    for free in (oe(data, 2, 2), oe([whole[100:400], whole[2000:2600]], 2, 2)):
        np.testing.assert_allclose(free.parameters, p2.bound.parameters, rtol=1e-9)
    assert np.abs(rest - p2.bound.parameters).max() > 1e-3


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize("inputs", [1, 2])
@pytest.mark.parametrize(
    ("estimator", "orders"),
    [
        (armax, (2, 2, 2, 1)),
        (armax, (5, 3, 2, 2)),
        (armax, (1, 4, 1, 3)),
        (armax, (2, 1, 4, 0)),
        (oe, (2, 2, 1)),
        (oe, (2, 2, 3)),
        (oe, (4, 1, 2)),
        (bj, (2, 2, 2, 2, 1)),
        (bj, (3, 1, 2, 1, 2)),
        (bj, (3, 2, 1, 1, 2)),
    ],
)
def test_free_past_uses_every_sample_that_a_free_initial_state_does(estimator, orders, inputs):
    """The least sum of squares is that of the innovations form with its initial state fitted to the whole record."""
    rng = np.random.default_rng(3)
    u = rng.standard_normal((250, inputs))
    v = lfilter([1, -0.5], [1, -0.8, 0.3], rng.standard_normal(250))
    y = lfilter([0, 1, 0.5], [1, -1.2, 0.5], u, axis=0).sum(axis=1) + v
    data = IOData(u, y, 0.1)[50:]
    estimate = estimator(data, *orders)
    total = float(np.sum(residuals(estimate.model, data) ** 2))
    assert estimate.diagnostics["sum_of_squares"] == pytest.approx(total, rel=1e-12)


def test_backcasting_is_unconditional_least_squares():
    """Of a pure disturbance: y' R^-1 y, with R the covariance matrix of the whole record."""
    c, d = np.array([1, 0.9, 0.3]), np.array([1, -0.7])
    rng = np.random.default_rng(0)
    y = lfilter(c, d, rng.standard_normal(60))[20:]
    data = IOData(rng.standard_normal(40), y, 0.1)
    orders = make_orders(1, nb=1, nk=0, nc=2, nd=1)
    theta = orders.join(np.ones(1), [np.zeros(1)], c, d)
    cost = float(np.sum(error_jacobian(data, orders, theta, InitialConditions.BACKCAST).columns[:, -1] ** 2))
    h = lfilter(c, d, np.eye(500)[0])
    covariance = scipy.linalg.toeplitz([h[k:] @ h[: len(h) - k] for k in range(40)])
    assert cost == pytest.approx(float(y @ np.linalg.solve(covariance, y)), rel=1e-5)


@pytest.mark.parametrize("initial_conditions", InitialConditions)
def test_long_records_do_not_care(p3, initial_conditions):
    data = p3.draw(3)
    plain, other = armax(data, 2, 2, 2), armax(data, 2, 2, 2, initial_conditions=initial_conditions)
    assert np.all(np.abs(other.parameters - plain.parameters) < 0.5 * np.sqrt(np.diag(plain.covariance)))
    np.testing.assert_allclose(other.covariance, plain.covariance, rtol=0.1, atol=1e-5)


@pytest.mark.parametrize("order", [100, 257, 300])
def test_transients_of_high_orders_lose_nothing(order):
    rng = np.random.default_rng(0)
    orders = make_orders(1, nb=1, nf=order, nk=1)
    # poles of modulus 0.8 die out within the first length, in copies that are delayed they do so later
    f = np.zeros(order)
    f[0], f[-1] = -0.8, 1e-3 * rng.standard_normal()
    theta = np.concatenate(([1.0], f))
    transients = free_transients(orders, orders.split(theta), 3000)
    pulse = np.zeros(3000)
    pulse[0] = 1.0
    response = lfilter([1.0], np.concatenate(([1.0], f)), pulse)
    last = np.concatenate((np.zeros(order - 1), response))[:3000]
    np.testing.assert_array_equal(transients[:, -1], last[: len(transients)])
    assert np.abs(last[len(transients) :]).max(initial=0.0) < 1e-15 * np.abs(response).max()


def test_a_structure_without_an_initial_estimate_is_refused():
    orders = STRUCTURES["oe"]
    outside = np.array([1.0, 1.0, -3.0, 0.0, 0.0])
    refused(
        "no initial estimate of na = 0, nc = 0, nd = 0, nf = 3 .*expected lower orders",
        lambda: search([noise_record(orders)], lambda _: [InitialEstimate("outside", outside)], orders),
    )


def test_smaller_structures_without_an_initial_estimate_are_left_out():
    orders = STRUCTURES["oe"]

    def estimates(structure):
        return [InitialEstimate("zero", np.zeros(orders.count))] if structure == orders else []

    found = search([noise_record(orders)], estimates, orders)
    assert found.start == "zero"
    assert len(found.costs) == 1


@pytest.mark.parametrize("largest", [np.inf, np.nan])
def test_regressors_that_overflow_are_refused(largest):
    rows = np.array([[1.0, 2.0], [2.0, 1.0], [1.0, largest]])
    with np.errstate(all="ignore"):
        refused("the regressors overflow", solve, rows, np.ones((3, 1)))
        products = np.full((2, 2, 2, 2), largest**2)
        refused("the regressors overflow", lagged_solution, products, [range(1), range(1)], [1.0, 0.0])


def test_a_limit_whose_slope_overflows_leaves_the_step_free():
    rows = np.array([[1.0, 0.0], [0.0, np.inf]])
    with np.errstate(all="ignore"):
        step = constrained_step(np.ones(2), np.array([2.0, 1.0]), rows, np.array([1.0, 1.0]))
    np.testing.assert_array_equal(step, [2.0, 1.0])


@pytest.mark.parametrize("trend", [-1, 0, 1])
def test_experiments_of_one_length_have_initial_conditions_of_their_own(trend):
    rng = np.random.default_rng(8)
    experiments = []
    for samples in (80, 80, 120, 80):
        u = rng.standard_normal(samples + 50)
        y = lfilter([0.0, 0.5], [1.0, -0.9], u) + 0.1 * rng.standard_normal(samples + 50)
        experiments.append(IOData(u[50:], y[50:], 1.0))
    orders = Orders(0, (1,), 1, 1, (1,), (1,), trend)
    theta = np.array([0.4, 0.3, -0.2, -0.8])
    together = linearise(experiments, orders, theta)
    apart = [linearise([experiment], orders, theta) for experiment in experiments]
    assert together.cost == pytest.approx(sum(at.cost for at in apart), rel=1e-12)
    assert together.gradient == pytest.approx(sum(at.gradient for at in apart), rel=1e-9)
    assert together.transients == sum(at.transients for at in apart)
