"""Fast state recursions against the plain loop."""

import numpy as np
import pytest

from sysid.models.recursion import free_response, state_trajectory


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
