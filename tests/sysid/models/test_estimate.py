"""Uncertainty of what is made of the parameters."""

import copy
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sysid import FrequencyResponse, IOData, StateSpace, SysidError, arx, band, oe, okid, residuals, structure_scan
from sysid.models.delta_method import spread, standard_directions
from sysid.records.arrays import FloatArray
from tests.sysid.refusals import refused


def test_directions_are_a_root_of_the_covariance() -> None:
    rng = np.random.default_rng(0)
    m = rng.standard_normal((5, 3)) * np.geomspace(1e-8, 1e8, 5)[:, None]
    covariance = m @ m.T
    root = standard_directions(covariance)
    np.testing.assert_allclose(root @ root.T, covariance, atol=0, rtol=1e-6)


def test_linear_functions_are_propagated_exactly() -> None:
    rng = np.random.default_rng(1)
    m, g = rng.standard_normal((4, 4)), rng.standard_normal((2, 4))
    moves = spread(lambda theta: g @ theta, np.ones(4), m @ m.T)
    np.testing.assert_allclose(moves.T @ moves, g @ m @ m.T @ g.T, rtol=1e-9)


def test_response_of_a_first_order_model_by_hand(p2: Any) -> None:
    """G = b z / (1 + f z): the textbook derivative."""
    estimate = oe(p2.draw(0), 1, 1)
    b, f1 = estimate.parameters
    z = np.exp(-2j * np.pi * 1.0 * 0.02)
    gradient = np.array([z / (1 + f1 * z), -b * z**2 / (1 + f1 * z) ** 2])
    j = np.stack((gradient.real, gradient.imag))
    found = estimate.frequency_response([1.0])
    np.testing.assert_allclose(found.covariance[0, 0, 0], j @ estimate.covariance @ j.T, rtol=1e-4)


def test_bandwidth_interval_is_the_spread_of_the_bandwidth(p2: Any) -> None:
    """The implicit derivative agrees with bandwidths solved for at parameters drawn from the covariance."""
    estimate = oe(p2.draw(3), 2, 2)
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal(estimate.parameters, estimate.covariance, 400)
    logs = [np.log(estimate.realise(theta).bandwidth()[0, 0]) for theta in draws]
    found = estimate.bandwidth()
    deviation = np.log(found.ci95[1][0, 0] / found.hz[0, 0]) / 1.96
    assert deviation == pytest.approx(np.std(logs), rel=0.15)
    assert found.covers(found.hz).all()
    assert not found.covers(2 * found.hz).any()


def test_no_bandwidth_has_no_interval() -> None:
    rng = np.random.default_rng(0)
    u = rng.standard_normal(200)
    found = arx(IOData(u, 2 * u + 0.01 * rng.standard_normal(200), 0.1), 0, 1, 0).bandwidth()
    assert np.isnan(found.hz).all()
    assert np.isnan(found.ci95[0]).all()
    assert not found.covers(1.0).any()


def test_residuals_are_those_of_the_model(p3: Any) -> None:
    data = p3.draw(0)
    for estimate in (arx(data, 2, 2), oe(data, 2, 2), okid(data, 2, p=6)):
        np.testing.assert_array_equal(estimate.residuals, residuals(estimate, data))


def test_estimates_are_locked_and_can_be_copied(p3: Any) -> None:
    for estimate in (oe(p3.draw(0), 2, 2), okid(p3.draw(0), 2, p=4)):
        with pytest.raises(ValueError, match="read-only"):
            estimate.parameters[0] = 0.0
        for twin in (pickle.loads(pickle.dumps(estimate)), copy.deepcopy(estimate)):
            np.testing.assert_array_equal(twin.bandwidth().hz, estimate.bandwidth().hz)


def test_data_are_described_not_kept(p3: Any) -> None:
    data = p3.draw(0)
    named = IOData(data.u, data.y, data.dt, input_names=("command",), output_names=("angle",), name="run 1")
    estimate = arx(named, 2, 2)
    assert estimate.data.samples == (2000,)
    assert estimate.data.names == ("run 1",)
    assert estimate.model.input_names == ("command",)
    assert estimate.frequency_response([1.0]).output_names == ("angle",)


def test_responses_without_covariance_say_so() -> None:
    bare = FrequencyResponse(np.array([1.0]), np.ones((1, 1, 1), dtype=complex), 0.1, "etfe")
    refused("etfe gives no covariance", lambda: bare.magnitude_deviation())
    with pytest.raises(SysidError, match="expected shape"):
        FrequencyResponse(np.array([1.0, 2.0]), np.ones((1, 1, 1), dtype=complex), 0.1, "etfe")


def test_magnitude_and_phase_deviation_by_hand() -> None:
    covariance = np.array([[4e-4, 0.0], [0.0, 1e-4]])[None, None, None]
    response = FrequencyResponse(np.array([1.0]), np.full((1, 1, 1), 2.0 + 0j), 0.1, "test", covariance)
    assert response.magnitude_deviation()[0, 0, 0] == pytest.approx(0.02)
    assert response.phase_deviation()[0, 0, 0] == pytest.approx(0.005)
    low, high = response.magnitude_ci95()
    assert low[0, 0, 0] == pytest.approx(2.0 - 1.96 * 0.02, rel=1e-5)
    assert high[0, 0, 0] == pytest.approx(2.0 + 1.96 * 0.02, rel=1e-5)


def test_criteria_are_those_of_the_structure_table(p2: Any) -> None:
    data = p2.draw(0)
    estimate = oe(data, 2, 2)
    table = structure_scan(oe, data, ("nb", "nf"), [(2, 2)])
    assert estimate.loss == pytest.approx(table.loss[0], rel=1e-3)
    assert estimate.aic == pytest.approx(table.aic[0], abs=1e-3)
    assert estimate.bic == pytest.approx(table.bic[0], abs=1e-3)
    assert estimate.fpe == pytest.approx(table.fpe[0], rel=1e-3)


def test_a_complex_quantity_has_no_interval(p2: Any) -> None:
    refused("complex", lambda: band(oe(p2.draw(0), 2, 2), lambda model: model.frequency_response([1.0])))


def test_response_and_bandwidth_at_once_are_those_one_by_one(p2: Any) -> None:
    """Each model is realised once; so much is saved where that takes long."""
    estimate, f = oe(p2.draw(3), 2, 2), [0.1, 1.0, 3.0]
    realised = []

    def counted(theta: FloatArray) -> StateSpace:
        realised.append(theta)
        return estimate.realise(theta)

    response, bandwidth = replace(estimate, realise=counted).response_and_bandwidth(f)
    assert len(realised) == 2 * len(estimate.parameters)
    np.testing.assert_array_equal(response.covariance, estimate.frequency_response(f).covariance)
    np.testing.assert_array_equal(response.response, estimate.frequency_response(f).response)
    np.testing.assert_array_equal(bandwidth.ci95, estimate.bandwidth().ci95)
