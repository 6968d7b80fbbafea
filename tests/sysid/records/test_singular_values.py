"""Decompositions where LAPACK's fast driver gives up."""

import numpy as np
import pytest

import sysid
from sysid import IOData
from sysid.records.singular_values import singular_values, svd


@pytest.fixture
def fast_driver_fails(monkeypatch):
    def fail(*_, **__):
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(np.linalg, "svd", fail)


@pytest.mark.parametrize("shape", [(6, 3), (3, 6), (4, 4)])
@pytest.mark.parametrize("full_matrices", [True, False])
def test_the_slow_driver_takes_its_place(fast_driver_fails, shape, full_matrices):
    matrix = np.random.default_rng(1).standard_normal(shape)
    left, values, right = svd(matrix, full_matrices=full_matrices)
    least = min(shape)
    np.testing.assert_allclose((left[:, :least] * values) @ right[:least], matrix, atol=1e-14)
    # squares of singular values are the eigenvalues of the smaller Gram matrix
    gram = matrix @ matrix.T if shape[0] < shape[1] else matrix.T @ matrix
    np.testing.assert_allclose(values**2, np.linalg.eigvalsh(gram)[::-1], rtol=1e-12)
    np.testing.assert_allclose(singular_values(matrix), values, rtol=1e-14)


def test_what_is_not_finite_is_no_failure_of_the_driver(fast_driver_fails):
    for decompose in (svd, singular_values):
        with pytest.raises(np.linalg.LinAlgError):
            decompose(np.array([[1.0, np.nan], [0.0, 1.0]]))


def test_estimators_do_not_notice(monkeypatch):
    rng = np.random.default_rng(2)
    u = rng.choice([-1.0, 1.0], 300)
    y = np.convolve(u, 0.5 * 0.8 ** np.arange(40))[:300] + 0.01 * rng.standard_normal(300)
    data = IOData(u, y, 0.1)
    expected = sysid.oe(data, 1, 1, 0).parameters
    calls = iter(range(10_000))
    fast = np.linalg.svd

    def sometimes(*matrices, **options):
        if next(calls) % 3 == 0:
            raise np.linalg.LinAlgError("SVD did not converge")
        return fast(*matrices, **options)

    monkeypatch.setattr(np.linalg, "svd", sometimes)
    np.testing.assert_allclose(sysid.oe(data, 1, 1, 0).parameters, expected, rtol=1e-9)
