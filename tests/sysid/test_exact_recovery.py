"""Every parametric estimator recovers a random system, delays included, exactly from data without noise."""

import numpy as np
import pytest

import sysid
from sysid import StateSpace
from tests.sysid.systems import exact_system

GRID = np.linspace(0.1, 24.0, 40)


def states(order, nk):
    return max(order, order + nk - 1)


def refined(data, order, nk, gain):
    """`pem_ss` from a start that is a little off."""
    model = sysid.n4sid(data, states(order, nk)).model
    rng = np.random.default_rng(order)
    B, C, D = (m * (1 + 1e-3 * rng.standard_normal(m.shape)) for m in (model.B, model.C, model.D))
    # without noise nothing determines the gain: some directions are nearly flat, and take many steps
    start = StateSpace(0.999 * model.A, B, C, D, None, model.dt)
    return sysid.pem_ss(data, start, gain=gain, max_iterations=1000)


def observer(data, order, nk, realiser):
    return sysid.okid(data, states(order, nk), p=states(order, nk) + 2, realiser=realiser)


METHODS = {
    "arx": lambda d, n, nk: sysid.arx(d, n, n, nk),
    "armax": lambda d, n, nk: sysid.armax(d, n, n, n, nk),
    "oe": lambda d, n, nk: sysid.oe(d, n, n, nk),
    "bj": lambda d, n, nk: sysid.bj(d, n, 1, 1, n, nk),
    "iv4": lambda d, n, nk: sysid.iv4(d, n, n, nk),
    "n4sid": lambda d, n, nk: sysid.n4sid(d, states(n, nk)),
    "okid, era": lambda d, n, nk: observer(d, n, nk, sysid.era),
    "okid, era_dc": lambda d, n, nk: observer(d, n, nk, sysid.era_dc),
    "pem_ss": lambda d, n, nk: refined(d, n, nk, True),
    "pem_ss, K = 0": lambda d, n, nk: refined(d, n, nk, False),
}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize("nk", range(4))
@pytest.mark.parametrize("order", range(1, 7))
@pytest.mark.parametrize("method", METHODS)
def test_exact_without_noise(method, order, nk):
    truth, data = exact_system(order, nk)
    estimate = METHODS[method](data, order, nk)
    g = sysid.models.innovations_form(truth, data.dt).frequency_response(GRID)[:, 0, 0]
    tolerance = (1e-9 if method == "arx" else 1e-8) * np.abs(g).max()
    np.testing.assert_allclose(estimate.model.frequency_response(GRID)[:, 0, 0], g, atol=tolerance)
    if estimate.polynomials is not None:
        np.testing.assert_array_equal(estimate.polynomials.B[:nk], np.zeros(nk))
    if method in ("armax", "oe", "bj"):
        assert estimate.diagnostics["converged"]
    if method == "arx":
        np.testing.assert_allclose(estimate.parameters[:order], truth.A[1:], atol=1e-9)
        np.testing.assert_allclose(estimate.polynomials.B, truth.B, atol=1e-9)
