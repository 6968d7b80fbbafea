import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, Polynomials, polyest
from sysid.design import maximum_length_sequence
from sysid.models import innovations_form
from sysid.polynomial.orders import Orders, make_orders
from sysid.polynomial.prediction_error import minimise
from sysid.validation import cramer_rao_bound
from tests.refusals import refused
from tests.sysid.systems import in_feedback, losing, near, random_polynomial, second_order

TRUTH = Polynomials(A=[1, -1.2, 0.6], B=[0, 1, 0.5], C=[1, 0.4], D=[1, 0.7], F=[1, -0.8])
PARAMETERS = Orders.of(TRUTH).parameters(TRUTH)


def record(seed=0, samples=2000, noise=1.0, inputs=1):
    """Simulate `TRUTH`; a second input acts through 2 q^-1 / (1 - 0.3 q^-1) before A."""
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal((samples + 200, inputs)), noise * rng.standard_normal(samples + 200)
    y = lfilter(TRUTH.B, TRUTH.F, u[:, 0]) + lfilter(TRUTH.C, TRUTH.D, e)
    y += lfilter([0, 2.0], [1, -0.3], u[:, 1]) if inputs == 2 else 0.0
    return IOData(u, lfilter([1.0], TRUTH.A, y), 0.1)[200:]


def test_exact_without_noise():
    found = polyest(record(noise=0.0, samples=400), 2, 2, 1, 1, 1).polynomials
    for name in "ABF":
        np.testing.assert_allclose(getattr(found, name), getattr(TRUTH, name), atol=1e-9)
    found = polyest(record(noise=0.0, samples=400, inputs=2), 2, (2, 1), 0, 0, (1, 1)).polynomials
    np.testing.assert_allclose(found.A, TRUTH.A, atol=1e-9)
    np.testing.assert_allclose(found.F, [[1, -0.8], [1, -0.3]], atol=1e-9)


def test_model_has_the_states_of_each_polynomial_once():
    model = innovations_form(TRUTH, 0.1, 1.0)
    assert model.order == 2 + 2 + 1
    observer = np.linalg.eigvals(model.A - model.gain @ model.C)
    np.testing.assert_allclose(np.sort(observer.real), [-0.4, 0.0, 0.0, 0.0, 0.8], atol=1e-7)


@pytest.mark.parametrize(
    ("orders", "special"),
    [
        ((2, 2, 0, 0, 0), lambda d: sysid.arx(d, 2, 2)),
        ((2, 2, 2, 0, 0), lambda d: sysid.armax(d, 2, 2, 2)),
        ((0, 2, 0, 0, 2), lambda d: sysid.oe(d, 2, 2)),
        ((0, 2, 1, 1, 2), lambda d: sysid.bj(d, 2, 1, 1, 2)),
    ],
)
def test_special_cases_are_the_other_estimators(orders, special):
    data = second_order(c=[1.0, 0.4])
    np.testing.assert_allclose(polyest(data, *orders).parameters, special(data).parameters, rtol=1e-4, atol=1e-5)


def test_covariance_is_the_bound_and_holds_the_error():
    data = record(samples=4000)
    estimate = polyest(data, 2, 2, 1, 1, 1)
    bound = cramer_rao_bound(TRUTH, Orders.of(TRUTH), data.u, dt=0.1, variance=1.0, frequencies=np.array([0.5]))
    np.testing.assert_allclose(np.diag(estimate.covariance), np.diag(bound.covariance), rtol=0.3)
    assert near(estimate, PARAMETERS)


def test_missing_outputs():
    data = record(samples=800)
    gapped = losing(data, np.random.default_rng(1).random(800) < 0.1)
    assert near(polyest(gapped, 2, 2, 1, 1, 1), PARAMETERS)


@pytest.mark.filterwarnings("ignore:the model is not stable")
def test_an_unstable_system_in_a_loop():
    """With A unstable the predictor is stable: output-error and Box-Jenkins models cannot hold the pole."""
    truth = Polynomials(A=[1, -1.1], B=[0, 1.0], F=[1, -0.5], C=[1, 0.3])
    data, _ = in_feedback(samples=3000, truth=truth)
    estimate = polyest(data, 1, 1, 1, 0, 1)
    assert near(estimate, Orders.of(truth).parameters(truth))
    assert abs(estimate.parameters[0] + 1.1) < 0.02
    assert sysid.compare(estimate, data)[0].one_step > 50.0


def test_refusals():
    data = record(samples=100)
    refused("expected an input", polyest, IOData(None, data.y, 0.1), 1, 1, 1, 1, 1)
    refused("too many orders for the data", polyest, data[:40], 6, 6, 6, 6, 6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [20, 68, 28, 390, 425, 571, 730])
def test_roots_of_a_and_f_are_not_exchanged(seed):
    """Random systems; a search that starts from A alone ends 100 information units above the minimum by the truth."""
    rng = np.random.default_rng(seed)
    n, nk, hold = int(rng.integers(2, 6)), int(rng.integers(1, 4)), int(rng.choice([1, 2, 5]))
    f, a, c = (random_polynomial(rng, degree, radius) for degree, radius in ((n, 0.985), (1, 0.985), (1, 0.9)))
    b = np.concatenate((np.zeros(nk), rng.standard_normal(n)))
    u = maximum_length_sequence(2500, 12, clock=hold)
    noise_free, noise = lfilter(b, np.convolve(a, f), u), lfilter(c, a, rng.standard_normal(2500))
    noise *= np.std(noise_free[500:]) / np.std(noise[500:]) / 10 ** (rng.uniform(5, 40) / 20)
    record = IOData(u[500:], (noise_free + noise)[500:], 1.0)
    estimate = polyest(record, 1, n, 1, 0, n, nk)
    orders = make_orders(1, na=1, nb=n, nc=1, nd=0, nf=n, nk=nk)
    by_truth = minimise([record], orders, orders.join(a, [b], c, np.ones(1), [f]), max_iterations=200)
    assert 2000 * (estimate.diagnostics["sum_of_squares"] / by_truth.at.cost - 1.0) < 1.0
