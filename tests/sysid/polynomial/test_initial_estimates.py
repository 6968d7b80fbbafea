import warnings

import numpy as np
import pytest

from sysid import IOData, SysidWarning, arx, predict
from sysid.polynomial.initial_estimates import armax_initial_estimates, bj_initial_estimates, oe_initial_estimates
from sysid.polynomial.least_squares import triangular_factor
from sysid.polynomial.long_arx import long_arx_simulation
from sysid.polynomial.orders import make_orders
from sysid.polynomial.prediction_error import admissible, linearise


@pytest.mark.parametrize(
    ("problem", "structure", "beginnings"),
    [
        ("p3", {"na": 2, "nb": 2, "nc": 2, "nk": 1}, armax_initial_estimates),
        ("p2", {"nb": 2, "nf": 2, "nk": 1}, oe_initial_estimates),
        ("p4", {"nb": 2, "nc": 2, "nd": 2, "nf": 2, "nk": 1}, bj_initial_estimates),
    ],
)
def test_the_first_beginnings_lie_in_the_valley(problem, structure, beginnings, request):
    truth = request.getfixturevalue(problem)
    data, orders = [truth.draw(5)], make_orders(1, **structure)
    at_truth = linearise(data, orders, truth.bound.parameters).cost
    initial_estimates = list(beginnings(data, orders))
    assert len({start.name for start in initial_estimates}) == len(initial_estimates) >= 5
    assert all(admissible(orders, start.theta) for start in initial_estimates)
    assert all(linearise(data, orders, start.theta).cost < 1.5 * at_truth for start in initial_estimates[:2])


@pytest.mark.parametrize("inputs", [1, 2])
def test_long_arx_by_filters_is_the_estimator_in_state_space(inputs):
    rng = np.random.default_rng(0)
    u = rng.standard_normal((500, inputs))
    y = np.zeros(500)
    for t in range(2, 500):
        y[t] = 1.5 * y[t - 1] - 0.7 * y[t - 2] + u[t - 1] @ [1.0, -0.5][:inputs]
    # The record begins in motion, with noise that an order of 20 takes up.
    data = IOData(u[100:], y[100:] + rng.standard_normal(400), 0.02)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        expected = predict(arx(data, 20, 20), data, steps=None)[:, 0]
    simulation = long_arx_simulation(data.u, data.y[:, 0], 20)
    np.testing.assert_allclose(simulation, expected, rtol=0.0, atol=1e-10)


def test_a_long_arx_simulation_beyond_all_numbers_is_none():
    y = 2.0 ** np.arange(600.0)
    assert long_arx_simulation(np.random.default_rng(0).standard_normal((600, 1)), y, 2) is None


@pytest.mark.parametrize("angle", [1.0, 1e-9])
def test_triangular_factor_keeps_its_digits(angle):
    """Nearly parallel columns: the small pivot is right to many digits, not to the square root of rounding."""
    rng = np.random.default_rng(3)
    q, _ = np.linalg.qr(rng.standard_normal((100, 2)))
    columns = np.column_stack((q[:, 0], np.cos(angle) * q[:, 0] + np.sin(angle) * q[:, 1]))
    assert abs(triangular_factor(columns)[1, 1]) == pytest.approx(np.sin(angle), rel=1e-6)
