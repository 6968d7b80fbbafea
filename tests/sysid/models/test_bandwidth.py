import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from hmtb_twin import STUDIED_JOINTS, linearize, load_arm
from scenarios.commands.cli import main
from sysid import FrequencyResponse, IOData, arx, oe
from sysid.models.bandwidth import bandwidth_claim, lowest_excited, response_bandwidth

DT = 0.02


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


def claimed(record, fit=oe):
    return bandwidth_claim(fit(record, 1, 1), record)


def assert_withheld(claim, reason):
    assert np.isnan([claim.hz, claim.low, claim.high]).all()
    assert claim.refused
    assert reason in claim.warnings[0]


def test_an_interval_over_decades_is_no_interval():
    rng = np.random.default_rng(1)
    u = rng.standard_normal(2000)
    record = IOData(u, lfilter([0, 0.1], [1, -0.9], u) + 0.01 * rng.standard_normal(2000), DT).detrend()
    estimate = oe(record, 1, 1, 1)
    assert bandwidth_claim(estimate, record).hz == estimate.bandwidth().hz[0, 0]
    assert bandwidth_claim(estimate, record).warnings == ()
    vague = bandwidth_claim(replace(estimate, covariance=1e7 * estimate.covariance), record)
    assert_withheld(vague, "spans more than a factor of 100")


def test_a_record_shorter_than_a_period_of_the_bandwidth_does_not_tell_it():
    u = np.random.default_rng(5).standard_normal(400)
    y = lfilter([0, 0.1], [1, -0.9], u)
    assert claimed(IOData(u, y, DT), arx).hz == pytest.approx(0.839, rel=0.01)
    for samples in (8, 40):
        length, lowest = f"{samples * DT:.3g} s", f"{1 / samples / DT:.2g} Hz"
        reason = f"the record of {length} holds no full period of frequencies below {lowest}"
        assert_withheld(claimed(IOData(u[:samples], y[:samples], DT), arx), reason)


def test_a_bandwidth_below_the_excitation_is_not_claimed():
    rng = np.random.default_rng(2)
    u = np.sin(2 * np.pi * 5.0 * DT * np.arange(4000)) + np.sin(2 * np.pi * 8.0 * DT * np.arange(4000))
    y = lfilter([0, 0.1], [1, -0.9], u) + 1e-3 * rng.standard_normal(4000)
    assert_withheld(claimed(IOData(u, y, DT).detrend()), "excites nothing below 5 Hz")


@pytest.mark.parametrize("skip", [0, 37])
def test_a_periodic_record_extrapolates_to_zero(skip):
    rng = np.random.default_rng(3)
    period = np.repeat(rng.choice([-1.0, 1.0], 50), 2)
    u = np.tile(period, 42)[skip:] + 1e-3 * rng.standard_normal(4200 - skip)
    y = lfilter([0, 0.1], [1, -0.9], u) + 1e-3 * rng.standard_normal(len(u))
    claim = claimed(IOData(u, y, DT).detrend())
    assert claim.hz == pytest.approx(0.839, rel=0.02)
    expected = "nothing below 0.5 Hz is excited; the gain at 0 Hz, and with it the bandwidth, is extrapolated"
    assert claim.warnings == (expected,)


def test_broad_excitation_reaches_down_to_zero():
    rng = np.random.default_rng(4)
    white = rng.standard_normal(2000)
    tone = np.sin(2 * np.pi * 3.0 * DT * np.arange(2000))
    for u in (white, lfilter([1], [1, -0.95], white), tone + 0.3 * white):
        assert lowest_excited(IOData(u, u, DT).detrend()) == 0.0
    assert lowest_excited(IOData(tone, tone, DT)) == pytest.approx(3.0)
    assert lowest_excited(IOData(tone + 1.0, tone, DT)) == 0.0  # a mean that is left in excites 0 Hz


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
