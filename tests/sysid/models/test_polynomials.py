import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.signal import lfilter

from sysid import Polynomials, simulate
from sysid.models import innovations_form
from sysid.models.polynomials import is_stable, stabilised
from sysid.models.recursion import state_trajectory
from tests.refusals import refused

ONE = np.ones(1)


def test_published_yaw_model_in_the_published_form():
    """Equation 4.9 of the thesis: companion matrix, K = c - a."""
    a = np.array([1, -2.5420, 2.3667, -0.8523, -0.0804, 0.1103])
    c = np.array([1, -0.395, -0.0656, 0.3074, 0, 0])
    model = innovations_form(Polynomials(a, [0, 0, 0.0038, 0.0035, -0.0043], c, ONE, ONE), 0.02)
    np.testing.assert_allclose(model.A[:, 0], [2.5420, -2.3667, 0.8523, 0.0804, -0.1103])
    np.testing.assert_allclose(model.A[:-1, 1:], np.eye(4))
    np.testing.assert_allclose(model.B[:, 0], [0, 0.0038, 0.0035, -0.0043, 0])
    np.testing.assert_allclose(model.gain[:, 0], [2.1470, -2.4323, 1.1597, 0.0804, -0.1103], atol=1e-12)
    np.testing.assert_array_equal(model.C, [[1, 0, 0, 0, 0]])


@pytest.mark.parametrize(
    ("a", "c", "d", "f"),
    [
        ([1, -0.7], [1, 0.3], [1.0], [1.0]),
        ([1.0], [1.0], [1.0], [1, -1.2, 0.5]),
        ([1.0], [1, 0.4], [1, -0.9], [1, -0.6]),
        ([1, -0.5], [1, 0.2, 0.1], [1, -0.3], [1, -0.6, 0.2]),
    ],
)
def test_state_space_answers_like_the_filters(a, c, d, f):
    rng = np.random.default_rng(0)
    b = np.array([0.5, 0.0, 1.0, -0.3])
    u, e = rng.standard_normal((2, 60))
    model = innovations_form(Polynomials(a, b, c, d, f), 0.1, 2.0)
    expected = lfilter(b, np.convolve(a, f), u)
    np.testing.assert_allclose(simulate(model, u)[:, 0], expected, atol=1e-12)
    noise = state_trajectory(model.A, e[:, None] @ model.gain.T, np.zeros(model.order)) @ model.C.T + e[:, None]
    np.testing.assert_allclose(noise[:, 0], lfilter(c, np.convolve(a, d), e), atol=1e-12)
    np.testing.assert_array_equal(model.innovation_covariance, [[2.0]])


def test_two_inputs_have_their_own_paths():
    p = Polynomials([1.0], [[0, 1, 0], [0, 0, 2]], [1.0], [1.0], [[1, -0.5], [1, -0.8]])
    model = innovations_form(p, 1.0)
    h = model.markov(5)[:, 0]
    np.testing.assert_allclose(h[:, 0], [0, 1, 0.5, 0.25, 0.125])
    np.testing.assert_allclose(h[:, 1], [0, 0, 2, 1.6, 1.28])


def test_what_is_not_given_is_one():
    short, full = Polynomials(B=[0, 0.1], F=[1, -0.9]), Polynomials([1], [0, 0.1], [1], [1], [1, -0.9])
    for name in "ABCDF":
        np.testing.assert_array_equal(getattr(short, name), getattr(full, name))
    assert Polynomials(A=[1, -0.5], B=[[0, 1], [0, 2]]).F.shape == (2, 1)
    noise = innovations_form(Polynomials(C=[1, 0.5]), 0.1)
    np.testing.assert_array_equal(noise.markov(3), np.zeros((3, 1, 1)))
    np.testing.assert_allclose(noise.noise_response(5.0).ravel(), [0.5], atol=1e-12)


def test_monic_polynomials_begin_with_one():
    refused("C must begin with 1", lambda: Polynomials(ONE, ONE, [2.0, 1.0], ONE, ONE))
    refused("row per input", lambda: Polynomials(ONE, [[1.0], [1.0]], ONE, ONE, [[1.0]]))


@given(st.lists(st.floats(-1.2, 1.2), min_size=1, max_size=4), st.sampled_from([0.0, 1e-7, 0.1]))
def test_stability_is_that_of_the_roots(roots, margin):
    assume(all(abs(1.0 - margin - abs(root)) > 1e-3 for root in roots))
    assert is_stable(np.poly(roots), margin) == (max(map(abs, roots)) < 1.0 - margin)


@given(st.lists(st.floats(-3, 3).filter(lambda x: abs(x) > 1e-3), min_size=1, max_size=5))
def test_stabilised_polynomials_are_stable(coefficients):
    polynomial = np.array([1.0, *coefficients])
    safe = stabilised(polynomial)
    assert is_stable(safe)
    assert len(safe) == len(polynomial)
    if (np.abs(np.roots(polynomial)) < 0.99).all():
        np.testing.assert_array_equal(safe, polynomial)
