from functools import partial

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, arx, iv4
from tests.sysid.systems import A, near, parameters_covered, second_order

TRUTH = np.array([-1.5, 0.7, 1.0, 0.5])
# A y = B u + v with v autoregressive, which least squares is biased by
coloured = partial(second_order, d=np.convolve(A, [1, 0.5, 0.7]), settle=200)


@pytest.mark.thorough
def test_efficient_and_covered_where_least_squares_is_biased():
    """The whitened instruments, with the true model, give the asymptotic covariance of the method."""
    errors, normalised, hits, biased = [], [], [], []
    for seed in range(300):
        data = coloured(seed, 1000)
        estimate = iv4(data, 2, 2)
        error = estimate.parameters - TRUTH
        errors.append(error)
        normalised.append(error @ np.linalg.solve(estimate.covariance, error) / 4)
        hits.append(parameters_covered(estimate, TRUTH))
        biased.append(arx(data, 2, 2).parameters - TRUTH)
    deviation = np.std(errors, axis=0)
    assert np.all(np.abs(np.mean(errors, axis=0)) < 4 * deviation / np.sqrt(300))
    assert np.any(np.abs(np.mean(biased, axis=0)) > 2 * deviation)
    # three standard deviations of a mean of 300 chi-squares / 4, and of 1200 correlated hits
    assert 0.88 < np.mean(normalised) < 1.12
    assert 0.93 < np.mean(hits) < 0.97


def test_whitener_is_that_of_the_disturbance():
    np.testing.assert_allclose(iv4(coloured(0, 20_000), 2, 2).diagnostics["whitener"], [1, 0.5, 0.7, 0, 0], atol=0.03)


def test_two_inputs_two_experiments():
    rng = np.random.default_rng(0)
    u = rng.standard_normal((4000, 2))
    v = lfilter([1.0], [1, 0.8], rng.standard_normal(4000))
    y = lfilter([0, 2.0], [1, -0.8], u[:, 0]) + lfilter([0, 0, 0, 1.0, -0.5], [1, -0.8], u[:, 1])
    data = IOData(u, y + lfilter([1.0], [1, -0.8], v), 0.1)
    estimate = iv4([data[100:1500], data[1500:]], 1, [1, 2], [1, 3])
    assert near(estimate, [-0.8, 2.0, 1.0, -0.5])
    assert estimate.parameter_names == ("a1", "b1[1]", "b1[2]", "b2[2]")
