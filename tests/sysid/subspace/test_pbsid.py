import numpy as np
import pytest

import sysid
from sysid import IOData, Polynomials, SysidWarning, n4sid, pbsid
from sysid.models import innovations_form
from tests.refusals import refused
from tests.sysid.systems import in_feedback, losing, multivariable, record_in_motion

HZ = np.linspace(0.1, 4.9, 20)
TRUTH = Polynomials(A=[1, -1.5, 0.7], B=[0, 1.0, 0.5], C=[1, -0.6, 0.3])


def error(model, truth, hz=HZ):
    """Largest error of the response, relative to its largest value."""
    g = truth.frequency_response(hz)
    return np.abs(model.frequency_response(hz) - g).max() / np.abs(g).max()


@pytest.mark.parametrize("direct", [False, True])
def test_exact_without_noise(direct):
    truth = multivariable(direct)
    data = record_in_motion(truth, 500)
    assert error(pbsid(data, 4, direct=direct).model, truth) < 1e-9
    assert error(pbsid([data[:300], data[300:]], 4, direct=direct).model, truth) < 1e-9


def test_exact_in_a_loop_about_an_unstable_system():
    truth = Polynomials(A=[1, -1.1], B=[0, 1.0])
    data, _ = in_feedback(noise=0.0, samples=200, truth=truth)
    with pytest.warns(SysidWarning, match="its largest pole has modulus 1.1"):
        estimate = pbsid(data, 1)
    assert error(estimate.model, innovations_form(truth, 0.1)) < 1e-9
    m = estimate.model
    assert np.abs(np.linalg.eigvals(m.A - m.gain @ m.C)).max() < 1.0


def test_close_to_the_likelihood_under_feedback_where_n4sid_is_biased():
    data, _ = in_feedback(samples=10_000, truth=TRUTH)
    truth, best = innovations_form(TRUTH, 0.1, 1.0), sysid.armax(data, 2, 2, 2).model
    estimate = pbsid(data, 2)
    assert error(estimate.model, best) < 0.02
    assert error(estimate.model, truth) < 0.08
    assert error(sysid.n4sid(data, 2, direct=False).model, truth) > 0.4
    np.testing.assert_allclose(estimate.noise_variance, 1.0, rtol=0.05)
    refined = sysid.pem_ss(data, estimate, direct=False)
    assert error(refined.model, best) < 0.01


@pytest.mark.thorough
def test_error_falls_with_the_root_of_the_samples():
    truth = innovations_form(TRUTH, 0.1, 1.0)

    def spread(samples):
        errors = [error(pbsid(in_feedback(seed, samples, truth=TRUTH)[0], 2).model, truth) for seed in range(10)]
        return np.sqrt(np.mean(np.square(errors)))

    assert np.log(spread(8000) / spread(500)) / np.log(16) == pytest.approx(-0.5, abs=0.15)


def test_missing_outputs():
    data, _ = in_feedback(samples=3000, truth=TRUTH)
    estimate = pbsid(losing(data, np.random.default_rng(0).random(3000) < 0.1), 2)
    assert error(estimate.model, pbsid(data, 2).model) < 0.15


def test_refusals():
    data, _ = in_feedback(samples=100)
    refused("p must be a whole number >= 4", pbsid, data, 4, p=3)
    refused("block_rows must be a whole number from 2 to 5", pbsid, data, 2, p=5, block_rows=6)
    refused("too many observer parameters", pbsid, data, 2, p=40)
    refused("expected an input", pbsid, IOData(None, data.y, 0.1), 2)


def test_missing_outputs_do_not_count_as_samples():
    """18 samples, of which 12 of each output are missing, leave fewer equations than an order of 2 has unknowns."""
    rng = np.random.default_rng(0)
    u, y = rng.standard_normal(18), rng.standard_normal((18, 2))
    y[4:16] = np.nan
    record = IOData(u, y, 0.1, missing=True)
    for estimator in (pbsid, n4sid):
        refused("6 usable samples of 2 output", estimator, record, 2)
