import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

from sysid import FrequencyResponse, IOData, StateSpace, arx, band, n4sid, oe, okid, residuals, structure_scan
from sysid.models import poles_band, sampled_band, zeros_band
from sysid.models.confidence_bands import sample_models
from tests.refusals import refused


def test_response_of_a_first_order_model_by_hand(p2):
    """G = b z / (1 + f z): the textbook derivative."""
    estimate = oe(p2.draw(0), 1, 1)
    b, f1 = estimate.parameters
    z = np.exp(-2j * np.pi * 1.0 * 0.02)
    gradient = np.array([z / (1 + f1 * z), -b * z**2 / (1 + f1 * z) ** 2])
    j = np.stack((gradient.real, gradient.imag))
    response = estimate.frequency_response([1.0])
    np.testing.assert_allclose(response.covariance[0, 0, 0], j @ estimate.covariance @ j.T, rtol=1e-4)


@pytest.mark.thorough
def test_bandwidth_interval_is_the_spread_of_the_bandwidth(p2):
    """The implicit derivative agrees with bandwidths solved for at parameters drawn from the covariance."""
    estimate = oe(p2.draw(3), 2, 2)
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal(estimate.parameters, estimate.covariance, 400)
    logs = [np.log(estimate.realise(theta).bandwidth()[0, 0]) for theta in draws]
    bandwidth = estimate.bandwidth()
    deviation = np.log(bandwidth.ci95[1][0, 0] / bandwidth.hz[0, 0]) / 1.96
    assert deviation == pytest.approx(np.std(logs), rel=0.15)
    assert bandwidth.covers(bandwidth.hz).all()
    assert not bandwidth.covers(2 * bandwidth.hz).any()


def test_no_bandwidth_has_no_interval():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(200)
    estimate = arx(IOData(u, 2 * u + 0.01 * rng.standard_normal(200), 0.1), 0, 1, 0)
    bandwidth = estimate.bandwidth()
    assert np.isnan(bandwidth.hz).all()
    assert np.isnan(bandwidth.ci95[0]).all()
    assert not bandwidth.covers(1.0).any()
    refused("complex", band, estimate, lambda model: model.frequency_response([1.0]))


def test_residuals_are_those_of_the_model_and_copies_have_its_bandwidth(p3):
    data = p3.draw(0)
    for estimate in (arx(data, 2, 2), oe(data, 2, 2), okid(data, 2, p=6)):
        np.testing.assert_array_equal(estimate.residuals, residuals(estimate, data))
        for twin in (pickle.loads(pickle.dumps(estimate)), copy.deepcopy(estimate)):
            np.testing.assert_array_equal(twin.bandwidth().hz, estimate.bandwidth().hz)


def test_data_are_described_not_kept(p3):
    data = p3.draw(0)
    named = IOData(data.u, data.y, data.dt, input_names=("command",), output_names=("angle",), name="run 1")
    estimate = arx(named, 2, 2)
    assert estimate.data.samples == (2000,)
    assert estimate.data.names == ("run 1",)
    assert estimate.model.input_names == ("command",)
    assert estimate.frequency_response([1.0]).output_names == ("angle",)


def test_magnitude_and_phase_deviation_by_hand():
    covariance = np.array([[4e-4, 0.0], [0.0, 1e-4]])[None, None, None]
    response = FrequencyResponse(np.array([1.0]), np.full((1, 1, 1), 2.0 + 0j), 0.1, "test", covariance)
    assert response.magnitude_deviation()[0, 0, 0] == pytest.approx(0.02)
    assert response.phase_deviation()[0, 0, 0] == pytest.approx(0.005)
    low, high = response.magnitude_ci95()
    assert low[0, 0, 0] == pytest.approx(2.0 - 1.96 * 0.02, rel=1e-5)
    assert high[0, 0, 0] == pytest.approx(2.0 + 1.96 * 0.02, rel=1e-5)
    bare = FrequencyResponse(np.array([1.0]), np.ones((1, 1, 1), dtype=complex), 0.1, "etfe")
    refused("etfe gives no covariance", bare.magnitude_deviation)
    refused("expected shape", FrequencyResponse, [1.0, 2.0], np.ones((1, 1, 1), dtype=complex), 0.1, "etfe")


def test_criteria_are_those_of_the_structure_table(p2):
    data = p2.draw(0)
    estimate = oe(data, 2, 2)
    table = structure_scan(oe, data, ("nb", "nf"), [(2, 2)])
    assert estimate.loss == pytest.approx(table.loss[0], rel=1e-3)
    assert estimate.aic == pytest.approx(table.aic[0], abs=1e-3)
    assert estimate.bic == pytest.approx(table.bic[0], abs=1e-3)
    assert estimate.fpe == pytest.approx(table.fpe[0], rel=1e-3)


def test_response_and_bandwidth_at_once_are_those_one_by_one(p2):
    """Each model is realised once; so much is saved where that takes long."""
    estimate, f = oe(p2.draw(3), 2, 2), [0.1, 1.0, 3.0]
    realised = []

    def counted(theta):
        realised.append(theta)
        return estimate.realise(theta)

    response, bandwidth = replace(estimate, realise=counted).response_and_bandwidth(f)
    assert len(realised) == 2 * len(estimate.parameters)
    np.testing.assert_array_equal(response.covariance, estimate.frequency_response(f).covariance)
    np.testing.assert_array_equal(response.response, estimate.frequency_response(f).response)
    np.testing.assert_array_equal(bandwidth.ci95, estimate.bandwidth().ci95)


def step(model):
    return model.step_response(60)[:, 0, 0]


def test_pole_and_gain_of_a_first_order_model_by_hand(p2):
    """G = b / (z + f): pole -f, gain b / (1 + f)."""
    estimate = oe(p2.draw(0), 1, 1)
    b, f = estimate.parameters
    poles = poles_band(estimate)
    np.testing.assert_allclose(poles.roots, [-f])
    np.testing.assert_allclose(poles.covariance[0], [[estimate.covariance[1, 1], 0], [0, 0]], rtol=1e-6, atol=1e-20)
    np.testing.assert_allclose(poles.modulus_deviation(), np.sqrt(estimate.covariance[1, 1]), rtol=1e-6)
    gradient = np.array([1 / (1 + f), -b / (1 + f) ** 2])
    expected = np.sqrt(gradient @ estimate.covariance @ gradient)
    gain = band(estimate, StateSpace.dc_gain)
    np.testing.assert_allclose(gain.deviation, [[expected]], rtol=1e-4)
    np.testing.assert_allclose(gain.ci95[1] - gain.value, 1.959964 * gain.deviation, rtol=1e-6)


def test_zero_of_a_second_order_model_by_hand(p2):
    """B = b1 z + b2: the zero is -b2 / b1."""
    estimate = oe(p2.draw(0), 2, 2)
    b1, b2 = estimate.parameters[:2]
    gradient = np.array([b2 / b1**2, -1 / b1, 0, 0])
    zeros = zeros_band(estimate)
    np.testing.assert_allclose(zeros.roots, [-b2 / b1], rtol=1e-9)
    np.testing.assert_allclose(zeros.covariance[0, 0, 0], gradient @ estimate.covariance @ gradient, rtol=1e-3)


@pytest.mark.thorough
def test_draws_agree_with_the_delta_method(p2):
    estimate = oe(p2.draw(1), 2, 2)
    first = band(estimate, step)
    drawn = sampled_band(estimate, step, np.random.default_rng(0), draws=1000)
    # a standard deviation from 1000 draws has one of 2.2 %
    np.testing.assert_allclose(drawn.deviation[5:], first.deviation[5:], rtol=0.1)
    np.testing.assert_allclose(drawn.ci95, first.ci95, atol=0.3 * first.deviation.max())
    poles = np.array([m.poles() for m in sample_models(estimate, np.random.default_rng(1), draws=1000)])
    np.testing.assert_allclose(poles.real.std(axis=0), np.sqrt(poles_band(estimate).covariance[:, 0, 0]), rtol=0.1)


def test_ellipses_hold_95_percent_of_draws(p3):
    estimate = oe(p3.draw(0), 2, 2)
    poles = poles_band(estimate)
    root, outline = poles.roots[0], poles.ellipses(200)
    assert root.imag != 0.0
    models = sample_models(estimate, np.random.default_rng(0), draws=800)
    near = np.array([m.poles()[np.argmin(np.abs(m.poles() - root))] for m in models]) - root
    edge = outline[0] - root
    sector = np.argmin(np.abs(np.angle(near[:, None] / edge)), axis=1)
    assert np.mean(np.abs(near) <= np.abs(edge[sector])) == pytest.approx(0.95, abs=0.03)


def test_what_is_not_known_stays_so(p3):
    estimate = n4sid(p3.draw(0), 2)
    assert np.isnan(band(estimate, StateSpace.dc_gain).deviation).all()
    assert np.isnan(poles_band(estimate).covariance).all()
    assert np.isnan(poles_band(estimate).ellipses()).all()
    refused("n4sid gives no covariance", lambda: sample_models(estimate, np.random.default_rng(0)))
    refused("draws must be", lambda: sample_models(estimate, np.random.default_rng(0), draws=1))
