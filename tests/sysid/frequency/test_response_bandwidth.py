"""Bandwidths of measured responses."""

import numpy as np
import pytest

from hmtb_twin import STUDIED_JOINTS, linearize, load_arm
from sysid import FrequencyResponse, StateSpace
from sysid.models.bandwidth import response_bandwidth


def measured(model: StateSpace, deviation: float, f: np.ndarray, rng: np.random.Generator | None) -> FrequencyResponse:
    g = model.frequency_response(f)
    if rng is not None:
        g = g + deviation * np.sqrt(0.5) * (rng.standard_normal(g.shape) + 1j * rng.standard_normal(g.shape))
    covariance = 0.5 * deviation**2 * np.ones((*g.shape, 1, 1)) * np.eye(2)
    return FrequencyResponse(f, g, 0.02, "test", covariance=covariance, degrees_of_freedom=30.0)


def test_it_is_that_of_the_model() -> None:
    truth = linearize(load_arm(), amplitudes=())
    for joint in STUDIED_JOINTS:
        response = measured(truth.channel(joint, joint), 1e-6, np.arange(1, 52) / 10.24, None)
        assert response_bandwidth(response).hz.item() == pytest.approx(truth.joint(joint).bandwidth_hz, rel=2e-4)


def test_intervals_hold_it_as_often_as_they_say() -> None:
    truth = linearize(load_arm(), amplitudes=()).joint("shoulder_pitch")
    rng = np.random.default_rng(0)
    f = np.arange(1, 52) / 10.24
    found = [response_bandwidth(measured(truth.model, 0.01, f, rng)) for _ in range(400)]
    held = np.mean([entry.covers(truth.bandwidth_hz).item() for entry in found])
    assert abs(held - 0.95) < 3 * np.sqrt(0.95 * 0.05 / 400)


def test_no_bandwidth_where_the_response_does_not_tell() -> None:
    joint = linearize(load_arm(), amplitudes=()).channel("shoulder_yaw", "shoulder_yaw")
    low = measured(joint, 1e-3, np.arange(1, 10) / 10.24, None)
    sparse = measured(joint, 1e-3, np.arange(1, 6) / 2.0, None)
    for response in (low, sparse):
        found = response_bandwidth(response)
        assert np.isnan(found.hz).all()
        assert np.isnan(found.ci95[0]).all()
