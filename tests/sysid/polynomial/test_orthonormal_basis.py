"""All-pass cascades and the equations solved with them."""

import numpy as np
import pytest

from sysid.polynomial.orthonormal_basis import all_pass, gramian, stein

POLES = np.array([0.97 + 0.1j, 0.97 - 0.1j, 0.5, 0.0, -0.8, 0.3 + 0.9j, 0.3 - 0.9j])


@pytest.mark.parametrize("poles", [POLES, POLES[2:3], POLES[:2], np.array([0.9, 0.9, 0.9 + 0j])])
def test_cascades_are_orthogonal_and_have_their_poles(poles: np.ndarray) -> None:
    basis = all_pass(poles.astype(complex)).then(all_pass(poles.astype(complex)))
    whole = np.block([[basis.F, basis.b[:, None]], [basis.c, np.array([basis.d])]])
    np.testing.assert_allclose(whole @ whole.T, np.eye(len(whole)), atol=1e-13)
    expected = np.poly(np.concatenate((poles, poles))).real
    np.testing.assert_allclose(np.poly(basis.F).real, expected, atol=1e-12)


def test_equations_hold() -> None:
    rng = np.random.default_rng(0)
    A, F = all_pass(POLES).F, all_pass(POLES[:3]).F
    q = rng.standard_normal((7, 2, 3))
    s = stein(A, F, q)
    np.testing.assert_allclose(s, np.einsum("ij,jcb,ab->ica", A, s, F) + q, atol=1e-12)
    q = rng.standard_normal((4, 7, 7))
    p = gramian(A, q)
    np.testing.assert_allclose(p, A @ p @ A.T + q, atol=1e-12)
