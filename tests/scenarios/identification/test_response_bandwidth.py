"""Bandwidths of systems that integrate, and of frequency responses of the arm's joints."""

import json

import numpy as np
import pytest
from scipy.signal import lfilter

from hmtb_twin import STUDIED_JOINTS, linearize, load_arm
from scenarios.commands.cli import main
from sysid import FrequencyResponse
from sysid.models.bandwidth import response_bandwidth

DT = 0.02


@pytest.mark.slow
def test_an_integrator_has_none(capsys, tmp_path):
    u, path = np.random.default_rng(0).standard_normal(2000), tmp_path / "i.csv"
    y = lfilter([0, 0.1], [1, -1], u)
    np.savetxt(path, np.column_stack([DT * np.arange(len(u)), u, y]), delimiter=",", header="t,u,y", comments="")
    words = ("identify", str(path), "--method", "arx", "--orders", "1", "1", "--keep-mean")
    assert main([*words, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["bandwidth_hz"] is None
    assert result["ci95"] == [None, None]
    assert any("integrates" in text for text in result["warnings"])
    assert main([*words]) == 0
    (line,) = (line for line in capsys.readouterr().out.splitlines() if "bandwidth (-3 dB)" in line)
    assert line.rstrip().endswith("—")


LINES = np.arange(1, 52) / 10.24


@pytest.fixture(scope="module")
def truth():
    return linearize(load_arm(), amplitudes=())


def measured(model, deviation, f, rng):
    g = model.frequency_response(f)
    if rng is not None:
        g = g + deviation * np.sqrt(0.5) * (rng.standard_normal(g.shape) + 1j * rng.standard_normal(g.shape))
    covariance = 0.5 * deviation**2 * np.ones((*g.shape, 1, 1)) * np.eye(2)
    return FrequencyResponse(f, g, 0.02, "test", covariance=covariance, degrees_of_freedom=30.0)


def test_bandwidth_of_a_response_is_that_of_the_model(truth):
    for joint in STUDIED_JOINTS:
        response = measured(truth.channel(joint, joint), 1e-6, LINES, None)
        # Neighbours of the pitches answer between the lines, which no polynomial in squared frequency holds exactly.
        near = 2e-4 if joint == "shoulder_yaw" else 4e-3
        assert response_bandwidth(response).hz.item() == pytest.approx(truth.joint(joint).bandwidth_hz, rel=near)


def test_intervals_hold_it_as_often_as_they_say(truth):
    joint, rng = truth.joint("shoulder_pitch"), np.random.default_rng(0)
    estimates = [response_bandwidth(measured(joint.model, 0.01, LINES, rng)) for _ in range(400)]
    held = np.mean([estimate.covers(joint.bandwidth_hz).item() for estimate in estimates])
    assert abs(held - 0.95) < 3 * np.sqrt(0.95 * 0.05 / 400)


@pytest.mark.parametrize("f", [LINES[:9], np.arange(1, 6) / 2.0], ids=["low", "sparse"])
def test_no_bandwidth_where_the_response_does_not_tell(truth, f):
    estimate = response_bandwidth(measured(truth.channel("shoulder_yaw", "shoulder_yaw"), 1e-3, f, None))
    assert np.isnan(estimate.hz).all()
    assert np.isnan(estimate.ci95[0]).all()
