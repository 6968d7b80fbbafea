import warnings

import numpy as np
import pytest
from scipy.signal import freqz, lfilter

import sysid
from sysid import FrequencyResponse, IOData, SysidError

B, F = [0.0, 1.0, 0.4], [1.0, -1.2, 0.5]
HZ = np.linspace(0.1, 4.9, 80)


def response(seed=0, deviation=0.05, with_variance=True):
    rng = np.random.default_rng(seed)
    truth = freqz(B, F, HZ, fs=10.0)[1]
    noise = deviation / np.sqrt(2.0) * (rng.standard_normal(80) + 1j * rng.standard_normal(80))
    variance = np.full(80, deviation**2) if with_variance else None
    return FrequencyResponse.from_data(HZ, truth + noise, dt=0.1, variance=variance)


def test_oe_and_arx_find_the_system_behind_an_exact_response():
    oe = sysid.oe(response(deviation=1e-9), 2, 2)
    np.testing.assert_allclose(oe.parameters, [*B[1:], *F[1:]], rtol=1e-7)
    arx = sysid.arx(response(deviation=1e-9), 2, 2)
    np.testing.assert_allclose(arx.parameters, [*F[1:], *B[1:]], rtol=1e-7)
    assert (oe.method, arx.method) == ("oe", "arx")
    assert arx.parameter_names == ("a1", "a2", "b1", "b2")
    np.testing.assert_allclose(arx.polynomials.A, F, rtol=1e-7)
    np.testing.assert_allclose(arx.covariance[2:, 2:], oe.covariance[:2, :2], rtol=1e-6)
    assert np.isnan(arx.noise_variance).all()


def test_intervals_follow_from_the_variance_of_the_response():
    errors, inside = [], []
    for seed in range(100):
        fit = sysid.arx(response(seed), 2, 2)
        errors.append(fit.parameters - [*F[1:], *B[1:]])
        inside.append(np.abs(errors[-1]) < 1.96 * np.sqrt(np.diag(fit.covariance)))
    # 380 of 400 correlated ones are expected
    assert np.sum(inside) >= 355
    np.testing.assert_allclose(np.std(errors, axis=0), np.sqrt(np.diag(fit.covariance)), rtol=0.3)


def test_a_spectral_estimate_leads_to_the_model_of_its_record():
    rng = np.random.default_rng(3)
    u = rng.standard_normal(20_000)
    data = IOData(u, lfilter(B, F, u) + 0.1 * rng.standard_normal(20_000), dt=0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = sysid.oe(sysid.etfe(data, smoothing=10), 2, 2)
    np.testing.assert_allclose(fit.parameters, sysid.oe(data, 2, 2).parameters, atol=0.02)


def test_oe_has_a_denominator_per_input():
    second = freqz([0.0, 0.7], [1.0, -0.5], HZ, fs=10.0)[1]
    both = np.stack((freqz(B, F, HZ, fs=10.0)[1], second), axis=-1)[:, None]
    measured = FrequencyResponse.from_data(HZ, both, dt=0.1, variance=np.full((80, 1, 2), 1e-10))
    fit = sysid.oe(measured, (2, 1), (2, 1))
    np.testing.assert_allclose(fit.parameters, [1.0, 0.4, 0.7, -1.2, 0.5, -0.5], rtol=1e-6)
    with pytest.raises(SysidError, match="one input, got 2"):
        sysid.arx(measured, 2, 2)


def test_what_a_response_does_not_tell_is_refused():
    measured = response()
    for fit in (
        lambda: sysid.armax(measured, 2, 2, 1),
        lambda: sysid.bj(measured, 2, 1, 1, 2),
        lambda: sysid.polyest(measured, 1, 2, 0, 0, 1),
    ):
        with pytest.raises(SysidError, match="noise model, of which a frequency response tells nothing"):
            fit()
    for fit in (sysid.oe, sysid.arx):
        with pytest.raises(SysidError, match="no variance"):
            fit(response(with_variance=False), 2, 2)
        with pytest.raises(SysidError, match=r"offset of (oe|arx): expected the defaults"):
            fit(measured, 2, 2, offset=True)
        with pytest.raises(SysidError, match="sampling interval"):
            fit(FrequencyResponse.from_data(HZ, measured.response, variance=np.full(80, 1.0)), 2, 2)
