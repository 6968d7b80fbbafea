"""Outputs by products of blocks against the plain recursion."""

import numpy as np
import pytest

from sysid.models.block_response import FEWEST, block_output, chained
from sysid.models.recursion import driven_output
from tests.sysid.systems import CORRELATED_OUTPUTS


def recursion(A, B, C, D, u, x0):
    """y = C x + D u sample by sample."""
    state, rows = x0, []
    for inputs in u:
        rows.append(C @ state + D @ inputs)
        state = A @ state + B @ inputs
    return np.array(rows)


def random_system(rng, n, nu, ny, radius):
    A = rng.standard_normal((n, n))
    A *= radius / np.abs(np.linalg.eigvals(A)).max()
    return A, rng.standard_normal((n, nu)), rng.standard_normal((ny, n)), rng.standard_normal((ny, nu))


@pytest.mark.parametrize("samples", [FEWEST, 1000, 8192 + 8192 + 77])
@pytest.mark.parametrize("radius", [0.5, 0.999, 1.002])
def test_outputs_are_those_of_the_recursion(samples, radius):
    rng = np.random.default_rng(samples)
    for n, nu, ny in ((1, 1, 1), (4, 2, 3), (8, 3, 1)):
        system = random_system(rng, n, nu, ny, radius)
        u, x0 = rng.standard_normal((samples, nu)), rng.standard_normal(n)
        expected = recursion(*system, u, x0)
        by_blocks = block_output(*system, u, x0)
        assert by_blocks is not None
        np.testing.assert_allclose(by_blocks, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_inputs_need_not_be_contiguous():
    model = CORRELATED_OUTPUTS
    rng = np.random.default_rng(0)
    u = np.asfortranarray(rng.standard_normal((2, 500)).T)[:, :1]
    expected = recursion(model.A, model.B, model.C, model.D, u, np.ones(2))
    np.testing.assert_allclose(block_output(model.A, model.B, model.C, model.D, u, np.ones(2)), expected, atol=1e-12)


def test_powers_that_grow_are_left_to_filters():
    """A matrix far from normal, whose powers reach 1e6 before they die out, and one that overflows."""
    A = np.array([[0.5, 1e6], [0.0, 0.5]])
    u = np.random.default_rng(0).standard_normal((500, 1))
    matrices = (A, np.ones((2, 1)), np.ones((1, 2)), np.zeros((1, 1)))
    assert block_output(*matrices, u, np.zeros(2)) is None
    expected = recursion(*matrices, u, np.zeros(2))
    np.testing.assert_allclose(driven_output(*matrices, u, np.zeros(2)), expected, atol=1e-9 * np.abs(expected).max())
    unstable = (np.diag([1.1, 0.3]), *matrices[1:])
    long = np.ones((8000, 1))
    assert block_output(*unstable, long, np.zeros(2)) is None
    assert np.isinf(driven_output(*unstable, long, np.zeros(2))[-1, 0])


def test_states_are_chained_from_the_first():
    rng = np.random.default_rng(1)
    transition, drive, first = 0.4 * rng.standard_normal((3, 3)), rng.standard_normal((21, 2, 3)), np.ones((2, 3))
    states = chained(transition, drive, first)
    np.testing.assert_array_equal(states[0], first)
    np.testing.assert_allclose(states[1:], states[:-1] @ transition + drive, atol=1e-12)
