"""Known delays of inputs in `n4sid` and `pem_ss`."""

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, SysidError

DENOMINATOR = [1.0, -1.5, 0.7]
DELAYS = (15, 3)
NUMERATORS = ([0.5, 0.2], [0.3, 0.0])


def _record(samples=1500, noise=0.0, seed=1):
    """Two inputs with delays of 15 and 3 samples and one resonance."""
    rng = np.random.default_rng(seed)
    u = np.sign(rng.standard_normal((samples, 2)))
    y = noise * rng.standard_normal(samples)
    for j, (delay, numerator) in enumerate(zip(DELAYS, NUMERATORS, strict=True)):
        y = y + lfilter(np.append(np.zeros(delay), numerator), DENOMINATOR, u[:, j])
    return IOData(u, y, 0.1)


def _true_pulses(samples):
    pulse = np.zeros(samples)
    pulse[0] = 1.0
    columns = []
    for delay, numerator in zip(DELAYS, NUMERATORS, strict=True):
        columns.append(lfilter(np.append(np.zeros(delay), numerator), DENOMINATOR, pulse))
    return np.column_stack(columns)


def _n4sid(data, **options):
    return sysid.n4sid(data, 2, nk=DELAYS, **options)


def _pem_ss(data, **options):
    return sysid.pem_ss(data, 2, nk=DELAYS, **options)


@pytest.mark.parametrize("estimate", [_n4sid, _pem_ss])
def test_exact_data_give_the_exact_delayed_response(estimate):
    # from rest: the record before its beginning is zero, which the model cannot know
    data = _record()
    model = estimate(data).model
    assert model.order == 2 + sum(DELAYS)
    np.testing.assert_allclose(model.markov(40)[:, 0, :], _true_pulses(40), atol=1e-9)
    np.testing.assert_allclose(sysid.simulate(model, data), data.y, atol=1e-8)
    assert sysid.compare({"model": model}, data)[0].simulation[0] > 99.9999


def test_bandwidth_is_that_of_the_undelayed_path():
    true = sysid.models.innovations_form(sysid.Polynomials(B=NUMERATORS, F=[DENOMINATOR] * 2), 0.1)
    np.testing.assert_allclose(_n4sid(_record()).bandwidth().hz, true.bandwidth(), rtol=1e-8)


def test_uncertainty_is_that_of_the_fit_to_shifted_inputs():
    data = _record(noise=0.3)
    u = np.column_stack((data.u[:-15, 0], data.u[12:-3, 1]))
    by_hand = sysid.pem_ss(IOData(u, data.y[15:], 0.1), 2)
    estimate = _pem_ss(data)
    np.testing.assert_array_equal(estimate.covariance, by_hand.covariance)
    np.testing.assert_allclose(estimate.bandwidth().ci95, by_hand.bandwidth().ci95, rtol=1e-6)
    assert np.isnan(estimate.residuals[:15]).all()
    np.testing.assert_array_equal(estimate.residuals[15:], by_hand.residuals)
    assert sysid.resid(estimate, _record(noise=0.3, seed=2)).passed


def test_variance_of_noise():
    np.testing.assert_allclose(_pem_ss(_record(noise=0.3)).noise_variance, 0.09, rtol=0.1)


def test_without_direct_term_the_response_begins_a_sample_later():
    model = sysid.n4sid(_record(), 2, nk=(14, 2), direct=False).model
    np.testing.assert_allclose(model.markov(40)[:, 0, :], _true_pulses(40), atol=1e-9)


def test_refinement_takes_the_delays_of_its_start():
    data = _record(noise=0.3)
    start = _n4sid(data)
    estimate = sysid.pem_ss(data, start)
    assert estimate.orders["nk"] == DELAYS
    np.testing.assert_allclose(estimate.model.markov(40), _pem_ss(data).model.markov(40), atol=1e-6)
    with pytest.raises(SysidError, match=r"estimated with nk = \[15, 3\], expected \[14, 3\]"):
        sysid.pem_ss(data, start, nk=(14, 3))
    with pytest.raises(SysidError, match="different delays"):
        sysid.pem_ss(data, [start, sysid.n4sid(data, 2, stable=True)])


def test_several_experiments_and_gaps():
    experiments = [_record(400, 0.3, 3), _record(500, 0.3, 4)]
    gaps = experiments[0].y.copy()
    gaps[200:203] = np.nan
    experiments[0] = IOData(experiments[0].u, gaps, 0.1, missing=True)
    estimate = _n4sid(experiments)
    assert len(estimate.residuals) == 900
    assert np.isnan(estimate.residuals[[0, 14, 400, 414]]).all()
    np.testing.assert_allclose(estimate.dc_gain(), [[3.5, 1.5]], rtol=0.05)


def test_model_file_keeps_a_delayed_estimate(tmp_path):
    estimate = _pem_ss(_record(noise=0.3))
    again = sysid.read_model(sysid.write_model(estimate, tmp_path / "model.json"))
    np.testing.assert_array_equal(again.model.A, estimate.model.A)
    np.testing.assert_allclose(again.bandwidth().ci95, estimate.bandwidth().ci95, rtol=1e-3)


@pytest.mark.parametrize("nk", [-1, 1.5, (1, 2, 3), "15", (1, True)])
def test_delays_that_are_none(nk):
    with pytest.raises(SysidError, match="nk"):
        sysid.n4sid(_record(), 2, nk=nk)


def test_delay_longer_than_an_experiment():
    with pytest.raises(SysidError, match="leaves nothing of an experiment of 40"):
        sysid.pem_ss([_record(), _record(40)], 2, nk=40)


def test_time_series_have_no_delay():
    with pytest.raises(SysidError, match="0 input"):
        sysid.n4sid(IOData(None, np.random.default_rng(1).standard_normal(200), 0.1), 1, nk=2)
