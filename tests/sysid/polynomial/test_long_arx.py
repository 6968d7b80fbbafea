"""Long ARX models: the fast sums are the plain ones."""

from typing import Any

import numpy as np
import pytest

from sysid import IOData
from sysid.polynomial.gram_matrices import lagged_products
from sysid.polynomial.long_arx import arx_solution, long_arx_family, long_arx_order
from sysid.polynomial.orders import make_orders
from sysid.polynomial.regressors import lagged


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
