"""Transmission zeros against constructions with known answers."""

import control
import numpy as np
import pytest

from sysid import Polynomials, StateSpace
from sysid.models import innovations_form
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
