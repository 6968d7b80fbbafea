"""Transmission zeros and state recursions against constructions with known answers."""

import control
import numpy as np
import pytest

from sysid import Polynomials, StateSpace
from sysid.models import innovations_form
from sysid.models.recursion import free_response, state_trajectory
from sysid.models.system_matrices import transmission_zeros


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_delays_leave_no_spurious_zeros(delay: int) -> None:
    zeros = np.array([1.4, 0.3 + 0.5j, 0.3 - 0.5j])
    b = np.concatenate((np.zeros(delay), 2e-3 * np.poly(zeros).real))
    a = np.poly([0.9, 0.8, 0.5, 0.2]).real
    model = innovations_form(Polynomials(a, b, [1.0], [1.0], [1.0]), 0.02)
    found = model.zeros()
    # states of pure delay cancel at the origin and are no zeros of the input-output path
    nonzero = found[np.abs(found) > 1e-6]
    np.testing.assert_allclose(np.sort_complex(nonzero), np.sort_complex(zeros), atol=1e-9)


def test_square_multivariable_matches_the_pencil() -> None:
    rng = np.random.default_rng(0)
    A, B, C, D = rng.standard_normal((5, 5)), rng.standard_normal((5, 2)), rng.standard_normal((2, 5)), np.eye(2)
    expected = np.linalg.eigvals(A - B @ C)
    np.testing.assert_allclose(np.sort_complex(transmission_zeros(A, B, C, D)), np.sort_complex(expected), atol=1e-9)


def test_common_zero_of_a_tall_system_is_found() -> None:
    """Two outputs that share the factor (z - 0.4) are both silent there."""
    shared = np.array([1.0, -0.4])
    a = np.poly([0.9, 0.5, 0.1]).real
    tall = StateSpace.from_control(
        control.ss(
            innovations_form(Polynomials(a, np.r_[0, shared], [1.0], [1.0], [1.0]), 1.0).A,
            innovations_form(Polynomials(a, np.r_[0, shared], [1.0], [1.0], [1.0]), 1.0).B,
            np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
            np.zeros((2, 1)),
            1.0,
        )
    )
    for z in tall.zeros():
        system = np.block([[tall.A - z * np.eye(3), tall.B], [tall.C, tall.D]])
        assert np.linalg.svd(system, compute_uv=False)[-1] < 1e-9


def test_scaling_of_channels_changes_nothing() -> None:
    rng = np.random.default_rng(3)
    A, B, C, D = rng.standard_normal((4, 4)), rng.standard_normal((4, 1)), rng.standard_normal((1, 4)), np.zeros((1, 1))
    plain = transmission_zeros(A, B, C, D)
    assert len(plain) == 3
    np.testing.assert_allclose(transmission_zeros(A, 1e-6 * B, 1e5 * C, 0.1 * D), plain, rtol=1e-8)


@pytest.mark.parametrize("radius", [0.5, 0.999, 1.05])
def test_trajectory_is_the_loop(radius: float) -> None:
    rng = np.random.default_rng(0)
    A = rng.standard_normal((5, 5))
    A *= radius / np.abs(np.linalg.eigvals(A)).max()
    w, x = rng.standard_normal((80, 5)), rng.standard_normal(5)
    expected = np.empty((80, 5))
    state = x
    for t in range(80):
        expected[t] = state
        state = A @ state + w[t]
    np.testing.assert_allclose(state_trajectory(A, w, x), expected, rtol=1e-10, atol=1e-11)


def test_defective_matrices_are_no_problem() -> None:
    A = np.eye(4, k=1)
    x = np.array([0.0, 0.0, 0.0, 1.0])
    np.testing.assert_allclose(state_trajectory(A, np.zeros((6, 4)), x)[3], [1, 0, 0, 0], atol=1e-15)
    assert state_trajectory(np.zeros((0, 0)), np.zeros((6, 0)), np.zeros(0)).shape == (6, 0)


def test_free_response_stops_where_it_has_died_out() -> None:
    A, C = np.array([[0.5, 1.0], [0.0, 0.4]]), np.array([[1.0, 0.0]])
    rows = free_response(A, C, 1000)
    assert 50 < len(rows) < 200
    np.testing.assert_allclose(rows[7], C @ np.linalg.matrix_power(A, 7), rtol=1e-12)
    assert len(free_response(np.eye(2), C, 13)) == 13
