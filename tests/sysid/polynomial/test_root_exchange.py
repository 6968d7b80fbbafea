"""Starts of a search in which a root of A and a root of F change places: B/(A F) stays the same."""

import numpy as np
import pytest

from sysid.polynomial.orders import make_orders
from sysid.polynomial.root_exchange import exchanged_roots


def _exchanges(a_roots, *f_roots):
    """A and F of all exchanges, with B, C and D that are any."""
    a, f = np.poly(a_roots).real, [np.atleast_1d(np.poly(roots).real) for roots in f_roots]
    orders = make_orders(len(f), na=len(a) - 1, nb=2, nc=1, nd=1, nf=[len(fj) - 1 for fj in f], nk=1)
    b, c, d = [np.array([0.0, 1.0, 0.3])] * len(f), np.array([1.0, 0.2]), np.array([1.0, -0.1])
    exchanges = []
    for theta in exchanged_roots(orders, orders.join(a, b, c, d, f)):
        new_a, new_b, new_c, new_d, new_f = orders.split(theta)
        np.testing.assert_array_equal(np.concatenate((*new_b, new_c, new_d)), np.concatenate((*b, c, d)))
        exchanges.append((new_a, new_f))
    return np.convolve(a, f[0]), exchanges


@pytest.mark.parametrize(
    ("a_roots", "f_roots", "count"),
    [
        ([0.9], [0.5, -0.3, 0.4 + 0.2j, 0.4 - 0.2j], 2),
        ([0.6 + 0.3j, 0.6 - 0.3j], [0.1 + 0.8j, 0.1 - 0.8j], 1),
        ([0.9, -0.7], [0.5], 2),
    ],
)
def test_the_path_stays_the_same(a_roots, f_roots, count):
    product, exchanges = _exchanges(a_roots, f_roots)
    same = [np.allclose(np.convolve(a, f[0]), product, atol=1e-9) for a, f in exchanges]
    assert sum(same) == count
    assert not any(np.allclose(a, np.poly(a_roots).real) for a, _ in exchanges)


def test_a_pair_that_gives_a_root_to_a_becomes_two_real_roots():
    _, ((a, (f,)),) = _exchanges([0.9], [0.5 + 0.1j, 0.5 - 0.1j])
    np.testing.assert_allclose(a, [1.0, -0.5], atol=1e-12)
    np.testing.assert_allclose(np.sort(np.roots(f)), [0.5, 0.9], atol=1e-9)


def test_every_input_takes_the_root_for_its_nearest():
    """The root 0.7 is one of both inputs: both paths stay the same."""
    _, exchanges = _exchanges([0.9], [0.7, 0.2], [0.7, -0.4])
    first, second = next(f for a, f in exchanges if np.allclose(a, [1.0, -0.7]))
    np.testing.assert_allclose(first, np.poly([0.9, 0.2]), atol=1e-12)
    np.testing.assert_allclose(second, np.poly([0.9, -0.4]), atol=1e-12)


def test_without_f_of_an_input_the_others_alone_change():
    _, exchanges = _exchanges([0.9], [0.7], [])
    ((_, (first, second)),) = exchanges
    np.testing.assert_allclose(first, [1.0, -0.9], atol=1e-12)
    np.testing.assert_array_equal(second, [1.0])
