"""Nested structures: a larger one fits no worse than a smaller one, also where roots are at the stability limit."""

import itertools

import numpy as np
import pytest
import scipy

from sysid import IOData, Polynomials, armax, oe, structure_scan
from sysid.polynomial.orders import make_orders
from sysid.polynomial.stability_limit import admissible, constrained_step, move_roots_inside, outward
from tests.refusals import refused


def drifting(seed, samples=150):
    """A slow system of order 5 on a short record of steps, with a random walk: several minima, roots at the limit."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.standard_normal(samples // 25), 25)
    t = np.arange(200)
    pulse = sum(w * p**t for w, p in zip(rng.standard_normal(5), rng.uniform(0.3, 0.99, 5), strict=True))
    walk = np.cumsum(rng.standard_normal(samples))
    y = np.convolve(u, pulse)[:samples] + 0.05 * walk
    return IOData(u - u.mean(), y - y.mean(), 1.0)


def cost(estimate):
    return estimate.diagnostics["sum_of_squares"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize(
    "seed", [pytest.param(0, marks=pytest.mark.thorough), 2, pytest.param(5, marks=pytest.mark.thorough)]
)
def test_larger_structures_fit_no_worse(seed):
    data = drifting(seed)
    fits = {n: cost(oe(data, *n, 0)) for n in itertools.product((1, 2, 3, 4), (1, 2, 3, 4))}
    pairs = [(a, b) for a in fits for b in fits if a != b and a[0] <= b[0] <= a[0] + 1 and a[1] <= b[1] <= a[1] + 1]
    assert {(a, b): fits[b] / fits[a] for a, b in pairs if fits[b] > 1.01 * fits[a]} == {}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize(("seed", "order"), [pytest.param(3, 5, marks=pytest.mark.thorough), (4, 4)])
def test_one_degree_more_of_everything_fits_no_worse(seed, order):
    """Minima of the smaller structures are initial estimates, each with its own smaller ones."""
    data = drifting(seed)
    assert cost(armax(data, *[order] * 3, 1)) <= cost(armax(data, *[order - 1] * 3, 1)) * (1.0 + 1e-9)


def test_a_start_is_never_left_for_a_worse_fit():
    data = drifting(4)
    small = oe(data, 2, 2, 0)
    large = oe(data, 3, 3, 0, start=small.polynomials)
    assert cost(large) <= cost(small) * (1.0 + 1e-9)
    assert "start" in large.diagnostics["initial_estimates"]
    refused("F has 3 coefficients, expected at most 2", lambda: oe(data, 2, 1, 0, start=small.polynomials))
    refused("expected nk = 1 zeros", lambda: oe(data, 2, 2, 1, start=small.polynomials))
    refused(r"polynomials of 1 input\(s\), got 2", lambda: armax(data, 1, 1, 1, start=Polynomials(B=np.eye(2))))


@pytest.mark.slow
def test_scans_are_monotonic():
    data = drifting(5)
    table = structure_scan(oe, data, ("nb", "nf", "nk"), itertools.product((3, 1, 2), (3, 2, 1), (0,)))
    loss = dict(zip(table.orders, table.loss, strict=True))
    for (nb, nf, nk), value in loss.items():
        for smaller in ((nb - 1, nf, nk), (nb, nf - 1, nk)):
            assert value <= 1.01 * loss.get(smaller, np.inf)


@pytest.mark.parametrize(
    ("roots", "count"), [([1.0], 1), ([-1.0, 0.5], 1), ([1j, -1j], 1), ([1.0, 1.0], 2), ([0.5], 0)]
)
def test_ways_out_of_the_stable_region(roots, count):
    """Every direction leads out of the region, and the opposite of all does not."""
    limit = 1.0 - 2e-7
    orders = make_orders(1, na=0, nb=1, nc=len(roots), nk=1)
    theta = orders.join(np.ones(1), [np.array([0.0, 1.0])], np.poly(limit * np.array(roots)).real)
    rows, reach = outward(orders, theta)
    rows = rows[reach < 1e-9]
    assert len(rows) == count
    for row in rows:
        assert not admissible(orders, theta + 1e-3 * row)
        assert admissible(orders, move_roots_inside(orders, theta + 1e-3 * row, theta))
    if count == 1:
        assert admissible(orders, theta - 1e-3 * rows[0] / np.linalg.norm(rows[0]))


def test_constrained_steps_are_least():
    rng = np.random.default_rng(1)
    for _ in range(20):
        values, g, rows = rng.uniform(0.1, 10.0, 5), rng.standard_normal(5), rng.standard_normal((4, 5))
        reach = np.array([0.0, *rng.uniform(0.0, 0.1, 3)])
        step = constrained_step(values, g, rows, reach)
        assert (rows @ step <= reach + 1e-12).all()
        limits = scipy.optimize.LinearConstraint(rows, ub=reach)
        best = scipy.optimize.minimize(
            lambda s, v=values, g=g: v @ s**2 / 2.0 - g @ s,
            np.zeros(5),
            jac=lambda s, v=values, g=g: v * s - g,
            method="SLSQP",
            constraints=limits,
            options={"ftol": 1e-14},
        )
        np.testing.assert_allclose(step, best.x, atol=1e-6)
