"""Least squares against numpy, where it is easy and where it is not."""

import numpy as np
import pytest
from scipy.linalg import lstsq

from sysid.polynomial.least_squares import solve, tall_least_squares, triangular_factor


@pytest.mark.parametrize("noise", [1.0, 1e-12])
def test_agrees_with_lstsq(noise: float) -> None:
    rng = np.random.default_rng(0)
    phi = rng.standard_normal((200, 6)) * np.geomspace(1e-6, 1e6, 6)
    target = phi @ rng.standard_normal((6, 2)) + noise * rng.standard_normal((200, 2))
    fit = solve(phi, target)
    lengths = np.linalg.norm(phi, axis=0)
    expected = np.linalg.lstsq(phi / lengths, target, rcond=None)[0]
    np.testing.assert_allclose(fit.solution * lengths[:, None], expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    errors = target - phi @ fit.solution
    # residuals at rounding level of the target can agree in size only
    np.testing.assert_allclose(fit.residual_gram, errors.T @ errors, rtol=1e-8, atol=1e-28 * np.sum(target**2))
    assert fit.rank == 6


def test_inverse_gram() -> None:
    phi = np.random.default_rng(1).standard_normal((50, 4))
    np.testing.assert_allclose(solve(phi, phi[:, :1]).inverse_gram, np.linalg.inv(phi.T @ phi), rtol=1e-9)


def test_rank_deficiency_is_seen_and_the_solution_small() -> None:
    phi = np.random.default_rng(2).standard_normal((50, 3))
    double = np.hstack((phi, phi))
    fit = solve(double, phi @ np.ones((3, 1)))
    assert fit.rank == 3
    np.testing.assert_allclose(fit.solution[:, 0], np.full(6, 0.5), rtol=1e-10)


@pytest.mark.parametrize("angle", [1.0, 1e-9])
def test_triangle_keeps_its_digits(angle: float) -> None:
    """Nearly parallel columns: the small pivot is right to many digits, not to the square root of rounding."""
    rng = np.random.default_rng(3)
    q, _ = np.linalg.qr(rng.standard_normal((100, 2)))
    columns = np.column_stack((q[:, 0], np.cos(angle) * q[:, 0] + np.sin(angle) * q[:, 1]))
    assert abs(triangular_factor(columns)[1, 1]) == pytest.approx(np.sin(angle), rel=1e-6)


@pytest.mark.parametrize("dependent", [False, True])
def test_it_is_least_squares(dependent: bool) -> None:
    rng = np.random.default_rng(0)
    columns, target = rng.standard_normal((200, 20)), rng.standard_normal(200)
    if dependent:
        columns[:, 7] = columns[:, 3] - columns[:, 5]
    expected = lstsq(columns, target, cond=1e-12)[0]
    before = columns.copy(), target.copy()
    np.testing.assert_allclose(tall_least_squares(columns, target, cond=1e-12), expected, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(columns, before[0])
    np.testing.assert_array_equal(target, before[1])
