"""Initial estimates and the long ARX models behind them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData
from sysid.polynomial.gram_matrices import lagged_products
from sysid.polynomial.initial_estimates import (
    armax_initial_estimates,
    bj_initial_estimates,
    oe_initial_estimates,
    reduced_denominator,
    reduced_path,
)
from sysid.polynomial.long_arx import arx_solution, long_arx_family, long_arx_order
from sysid.polynomial.orders import make_orders
from sysid.polynomial.prediction_error import admissible, linearise, search
from sysid.polynomial.regressors import lagged


def test_reduction_finds_the_dynamics_of_exact_responses() -> None:
    f = np.poly([0.9, 0.5 + 0.4j, 0.5 - 0.4j]).real
    pulse = np.eye(1, 90)[0]
    responses = [lfilter([0, 1.0, 0.3], f, pulse)[1:], lfilter([1.0], f, pulse)[1:]]
    np.testing.assert_allclose(reduced_denominator(responses, 3, 40), f, atol=1e-9)


def test_reduction_of_a_delayed_path(exact_system: Callable[[int, int], Any]) -> None:
    truth = exact_system(3, 3)
    orders = make_orders(1, nb=3, nf=3, nk=3)
    model = long_arx_family([truth.data], orders, 9).model(9)
    theta = reduced_path([truth.data], orders, model)
    np.testing.assert_allclose(theta[3:], truth.A[1:], atol=1e-8)
    # B bears the unknown past, which the minimisation takes out
    np.testing.assert_allclose(theta[:3], truth.B[3:], atol=1e-2)


@pytest.mark.parametrize(
    ("problem", "structure", "beginnings"),
    [
        ("p3", {"na": 2, "nb": 2, "nc": 2, "nk": 1}, armax_initial_estimates),
        ("p2", {"nb": 2, "nf": 2, "nk": 1}, oe_initial_estimates),
        ("p4", {"nb": 2, "nc": 2, "nd": 2, "nf": 2, "nk": 1}, bj_initial_estimates),
    ],
)
def test_the_first_beginnings_lie_in_the_valley(
    problem: str, structure: dict[str, int], beginnings: Any, request: pytest.FixtureRequest
) -> None:
    truth = request.getfixturevalue(problem)
    data, orders = [truth.draw(5)], make_orders(1, **structure)
    at_truth = linearise(data, orders, truth.parameters).cost
    initial_estimates = list(beginnings(data, orders))
    assert len({start.name for start in initial_estimates}) == len(initial_estimates) >= 5
    assert all(admissible(orders, start.theta) for start in initial_estimates)
    assert all(linearise(data, orders, start.theta).cost < 1.5 * at_truth for start in initial_estimates[:2])


def test_two_that_agree_end_the_search(p3: Any) -> None:
    data, orders = [p3.draw(5)], make_orders(1, na=2, nb=2, nc=2, nk=1)
    found = search(data, orders, armax_initial_estimates(data, orders))
    assert len(found.costs) == 2
    assert found.best.converged
    # a search that may take no step cannot be content, and tries everything
    assert len(search(data, orders, armax_initial_estimates(data, orders), max_iterations=0).costs) >= 2


def test_products_of_lagged_signals() -> None:
    signals = np.random.default_rng(0).standard_normal((60, 3))
    columns = np.stack([lagged(signals[:, s], range(6), 7) for s in range(3)], axis=1)
    expected = np.einsum("tsi,trj->sirj", columns, columns)
    np.testing.assert_allclose(lagged_products(signals, 5, 7), expected, atol=1e-12)


@pytest.mark.parametrize("n", [4, 12])
def test_models_are_least_squares(p1: Any, n: int) -> None:
    data = [p1.draw(0)[:3000], p1.draw(1)[:500]]
    orders = make_orders(1, na=2, nb=2, nk=2)
    found = long_arx_family(data, orders, 12).model(n)
    # the family begins every fit where its largest model can
    rows = [14] * 2
    theta = arx_solution([e.y[:, 0] for e in data], [e.u for e in data], n, [n], [2], rows)
    np.testing.assert_allclose(found.a[1:], theta[:n], atol=1e-6)
    np.testing.assert_allclose(found.b[0], np.concatenate(([0, 0], theta[n:])), atol=1e-6)


def test_dependent_columns_go_the_safe_way(p2: Any) -> None:
    """Without noise a long model is not unique; the one of least norm explains all the same."""
    data = IOData(p2.input, p2.noise_free, 0.02)[300:900]
    orders = make_orders(1, nb=2, nf=2, nk=1)
    model = long_arx_family([data], orders, 10).model(10)
    assert np.abs(model.errors(data)[model.skip :]).max() < 1e-9


def test_order_is_bounded_by_the_data(p2: Any) -> None:
    orders = make_orders(1, nb=2, nf=2, nk=1)
    assert long_arx_order([p2.draw(0)], orders, 5) == 10
    assert long_arx_order([p2.draw(0)[:40]], orders, 5) == 5
