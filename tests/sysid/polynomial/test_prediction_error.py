"""The engine: gradients, transients, stability."""

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import InitialConditions, IOData
from sysid.polynomial.orders import Orders, make_orders
from sysid.polynomial.prediction_error import admissible, linearise, minimise

STRUCTURES = {
    "armax": make_orders(1, na=2, nb=2, nc=2, nk=1),
    "oe": make_orders(1, nb=2, nf=3, nk=0),
    "bj": make_orders(1, nb=1, nc=2, nd=1, nf=2, nk=2),
    "all": make_orders(1, na=1, nb=2, nc=1, nd=2, nf=1, nk=1),
    "two inputs": make_orders(2, nb=(1, 2), nf=(2, 1), nk=(1, 0), nc=1, nd=1),
}


def noise_record(orders: Orders, samples: int = 120, seed: int = 0) -> IOData:
    rng = np.random.default_rng(seed)
    return IOData(rng.standard_normal((samples, len(orders.nb))), rng.standard_normal(samples) + 3.0, 0.1)


def some_parameters(orders: Orders) -> np.ndarray:
    rng = np.random.default_rng(4)
    return 0.3 * rng.standard_normal(orders.count)


@pytest.mark.parametrize("initial_conditions", InitialConditions)
@pytest.mark.parametrize("name", STRUCTURES)
def test_gradient_is_that_of_the_projected_criterion(name: str, initial_conditions: InitialConditions) -> None:
    orders = STRUCTURES[name]
    data = [noise_record(orders), noise_record(orders, 80, 1)]
    theta = some_parameters(orders)
    assert admissible(orders, theta)
    at = linearise(data, orders, theta, initial_conditions)
    gradient = 2.0 * at.scale * (at.triangle.T @ at.target)
    h = 1e-6
    numeric = [
        (
            linearise(data, orders, theta + h * step, initial_conditions).cost
            - linearise(data, orders, theta - h * step, initial_conditions).cost
        )
        / (2 * h)
        for step in np.eye(orders.count)
    ]
    np.testing.assert_allclose(gradient, numeric, rtol=1e-5, atol=1e-5 * np.abs(gradient).max())


@pytest.mark.parametrize("name", ["armax", "oe"])
def test_the_past_is_free(name: str) -> None:
    """Whatever happened before the record, without noise the criterion at the true parameters is zero."""
    orders = STRUCTURES[name]
    theta = np.array([-1.2, 0.5, 1.0, 0.4, -0.5, 0.2]) if name == "armax" else np.array([1.0, 0.4, -1.2, 0.5, -0.1])
    a, b, _, _, f = orders.split(theta)
    u = 50.0 * np.random.default_rng(0).standard_normal(500)
    y = lfilter(b[0], np.convolve(a, f[0]), u)
    data = IOData(u, y, 0.1)[200:]
    assert linearise([data], orders, theta).cost < 1e-20 * float(np.sum(data.y**2))


@pytest.mark.parametrize("name", STRUCTURES)
def test_every_accepted_step_keeps_the_predictor_stable(name: str) -> None:
    orders = STRUCTURES[name]
    # pure noise pushes C and F wherever it likes
    found = minimise([noise_record(orders)], orders, some_parameters(orders))
    assert admissible(orders, found.at.theta)
    assert found.at.cost < linearise([noise_record(orders)], orders, some_parameters(orders)).cost


def test_orders_split_and_join() -> None:
    orders = STRUCTURES["two inputs"]
    theta = np.arange(1.0, orders.count + 1)
    a, b, c, d, f = orders.split(theta)
    np.testing.assert_array_equal(orders.join(a, b, c, d, f), theta)
    assert orders.names == ("b1[1]", "b1[2]", "b2[2]", "c1", "d1", "f1[1]", "f2[1]", "f1[2]")
    np.testing.assert_array_equal(b[0], [0, 1])
    np.testing.assert_array_equal(f[1], [1, 8])
    assert orders.first_row(0) == 1
