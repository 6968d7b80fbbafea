from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import Polynomials, SysidWarning, arx, iv4, ivx
from tests.refusals import refused
from tests.sysid.systems import A, B, in_feedback, losing, near, second_order

TRUTH = np.array([-1.5, 0.7, 1.0, 0.5])
COLOURED = Polynomials(A=A, B=B, C=[1, -0.8], D=[1, 0.5])


def delayed(r):
    """Instruments of a loop from its reference: for the output, samples that those for the input lack."""
    return np.column_stack((np.r_[0, 0, r[:-2]], r))


def test_is_the_solution_of_the_textbook():
    data = second_order(d=np.convolve(A, [1, 0.8]))
    x = lfilter(B, A, data.u[:, 0])
    u, y = data.u[:, 0], data.y[:, 0]
    z, phi = (np.column_stack((-s[1:-1], -s[:-2], u[1:-1], u[:-2])) for s in (x, y))
    estimate = ivx(data, 2, 2, 1, x)
    np.testing.assert_allclose(estimate.parameters, np.linalg.solve(z.T @ phi, z.T @ y[2:]), rtol=1e-9)
    parts = ivx([data[:150], data[150:]], 2, 2, 1, [x[:150], x[150:, None]])
    np.testing.assert_allclose(parts.parameters, estimate.parameters, atol=0.1)


def test_exact_under_feedback_without_noise():
    data, r = in_feedback(noise=0.0, samples=200)
    np.testing.assert_allclose(ivx(data, 2, 2, 1, delayed(r)).parameters, TRUTH, atol=1e-10)


@pytest.mark.filterwarnings("ignore:the model is not stable")
def test_consistent_under_feedback_where_others_are_biased():
    """The disturbance is no ARX model's; it reaches the input by the loop."""
    data, r = in_feedback(samples=20_000, truth=COLOURED)
    clean, _ = in_feedback(samples=20_000, noise=0.0, truth=COLOURED)
    for x in (delayed(r), np.hstack((clean.y, clean.u))):
        assert near(estimate := ivx(data, 2, 2, 1, x), TRUTH)
    for biased in (arx(data, 2, 2), iv4(data, 2, 2), ivx(data, 2, 2, 1, lfilter(B, A, r))):
        assert not near(replace(biased, covariance=estimate.covariance), TRUTH, 8.0)


def test_rows_with_a_missing_output_are_omitted():
    data, r = in_feedback(samples=3000)
    assert near(ivx(losing(data, slice(None, None, 11)), 2, 2, 1, delayed(r)), TRUTH)


def test_refusals_and_dependent_instruments():
    data, r = in_feedback(samples=200)
    refused(r"expected 200 samples, time first, got shape \(199, 1\)", ivx, data, 2, 2, 1, r[:-1])
    refused("expected 1 or 2 columns", ivx, data, 2, 2, 1, np.column_stack((r, r, r)))
    refused("one per experiment", ivx, [data, data], 2, 2, 1, r)
    with pytest.warns(SysidWarning, match="the instruments have rank 3 for 4 parameters"):
        ivx(data, 2, 2, 1, np.column_stack((np.r_[0, r[:-1]], r)))
