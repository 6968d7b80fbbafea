import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, Polynomials, two_stage
from tests.refusals import refused
from tests.sysid.systems import in_feedback, losing, near

TRUTH = Polynomials(B=[0, 0.5, 0.3], F=[1, -1.2, 0.5], C=[1, 0.3], D=[1, -0.8])
PARAMETERS = np.array([0.5, 0.3, -1.2, 0.5])


def test_exact_without_noise():
    data, r = in_feedback(noise=0.0, samples=300, truth=TRUTH)
    np.testing.assert_allclose(two_stage(data, 2, 2, 1, r).parameters, PARAMETERS, atol=1e-9)
    parts = two_stage([data[:150], data[150:]], 2, 2, 1, [r[:150], r[150:, None]])
    np.testing.assert_allclose(parts.parameters, PARAMETERS, atol=1e-9)


def test_without_feedback_it_is_output_error():
    """The reference is the input: the first stage is exact, and the second is oe."""
    data, r = in_feedback(samples=1000, gain=0.0, truth=TRUTH)
    estimate, expected = two_stage(data, 2, 2, 1, r), sysid.oe(data, 2, 2)
    np.testing.assert_allclose(estimate.parameters, expected.parameters, atol=1e-6)
    deviations = [np.sqrt(np.diag(one.covariance)) for one in (estimate, expected)]
    np.testing.assert_allclose(*deviations, rtol=0.25)
    np.testing.assert_allclose(estimate.residuals, expected.residuals, atol=1e-5)


@pytest.mark.slow
def test_consistent_under_feedback_where_oe_is_biased():
    data, r = in_feedback(samples=5000, noise=0.5, truth=TRUTH)
    estimate = two_stage(data, 2, 2, 1, r)
    assert near(estimate, PARAMETERS)
    assert not near(sysid.oe(data, 2, 2), PARAMETERS, 8.0)


def test_two_inputs_of_which_one_is_in_the_loop():
    rng = np.random.default_rng(0)
    (r, w), e = rng.standard_normal((2, 3000)), lfilter([0.5], [1, -0.8], rng.standard_normal(3000))
    # y = 0.5 q^-1 / (1 - 0.6 q^-1) u + 0.3 q^-1 w + v with u = r - 0.5 y
    loop = [1, -0.35]
    y = lfilter([0, 0.5], loop, r) + lfilter([1, -0.6], loop, e + np.r_[0, 0.3 * w[:-1]])
    data = IOData(np.column_stack((r - 0.5 * y, w)), y, 0.1)
    estimate = two_stage(data, 1, (1, 0), 1, np.column_stack((r, w)))
    assert near(estimate, [0.5, 0.3, -0.6])


def test_refusals():
    data, r = in_feedback(samples=200)
    refused("expected 200 samples, time first", two_stage, data, 2, 2, 1, r[:-1])
    refused("one per experiment", two_stage, [data, data], 2, 2, 1, r)
    refused("order must be a whole number >= 1", two_stage, data, 2, 2, 1, r, order=0)
    refused("lacks 1 of 200 output samples", two_stage, losing(data, 50), 2, 2, 1, r)
    refused("constant", two_stage, data, 2, 2, 1, np.ones(200))
