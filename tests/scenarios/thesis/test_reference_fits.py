"""What the truth follows of records whose every part is known."""

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

import sysid
from hmtb_twin import JOINTS, STUDIED_JOINTS
from hmtb_twin.bus.recorder import delayed
from scenarios.experiments.campaign import NOMINAL
from scenarios.thesis import reference_fits as references
from scenarios.thesis.campaign import Campaign
from scenarios.thesis.reference_fits import COLUMNS, COUPLED, DIAGONAL, NOISELESS
from sysid import FrequencyResponse, StateSpace
from tests.scenarios.thesis.conftest import joint_log

YAW, SHOULDER, ELBOW = STUDIED_JOINTS


def _truth(push):
    """Lags of a tenth of a second; the elbow pushes the shoulder."""
    B = 0.2 * np.eye(3)
    B[1, 2] = push
    return StateSpace(0.8 * np.eye(3), B, np.eye(3), np.zeros((3, 3)), None, 0.02)


def _campaign(truth, *, noise=0.0, late=0):
    """A record of independent commands around a pose, read so many times as late as by the bus."""
    rng = np.random.default_rng(5)
    samples, offset = 3000, 0.3
    moved = np.cumsum(rng.standard_normal((samples, 3)), axis=0) * 1e-3
    moved -= moved[0]
    true = sysid.simulate(truth, moved)
    commanded, measured, angles = (np.zeros((samples, len(JOINTS))) for _ in range(3))
    commanded[:, COLUMNS], angles[:, COLUMNS] = offset + moved, offset + true
    measured[:, COLUMNS] = delayed(offset + true, late * NOMINAL.arm().delays[COLUMNS]) + noise * rng.standard_normal(
        (samples, 3)
    )
    log = joint_log("mimo-1", commanded, measured, angles)
    return Campaign(NOMINAL, None, MappingProxyType({"mimo-1": log}), {})


def _fits(truth, campaign):
    return {
        kind: dict(fits["mimo-1"]) for kind, fits in references.reference_fits(campaign, ("mimo-1",), truth).items()
    }


def test_the_impulse_response_is_the_model():
    pulses = references.impulse_response(_truth(0.1))
    np.testing.assert_allclose(pulses[1:4, 1, 2], [0.1, 0.08, 0.064])
    assert np.abs(pulses[-1]).max() < 1e-6


def test_only_the_joint_that_is_pushed_loses_by_leaving_the_coupling_out():
    truth = _truth(0.1)
    fits = _fits(truth, _campaign(truth))
    assert list(fits[COUPLED].values()) == pytest.approx([100.0] * 3, abs=1e-3)
    assert [fits[DIAGONAL][joint] for joint in (YAW, ELBOW)] == pytest.approx([100.0] * 2, abs=1e-3)
    assert fits[DIAGONAL][SHOULDER] < 80.0


def test_what_friction_takes_of_the_gain_the_best_linear_truth_lacks_too():
    truth, f = _truth(0.0), np.geomspace(0.1, 10.0, 50)
    rubbed = replace(truth, B=truth.B * [0.8, 1.0, 1.0])
    response = rubbed.frequency_response(f)
    own = [FrequencyResponse(f, response[:, i, i, None, None], truth.dt, "model") for i in range(3)]
    fits = references.best_linear_fits(_campaign(rubbed), "mimo-1", truth, dict(zip(STUDIED_JOINTS, own, strict=True)))
    assert list(fits.values()) == pytest.approx([100.0] * 3, abs=1e-3)
    assert _fits(truth, _campaign(rubbed))[DIAGONAL][YAW] == pytest.approx(75.0, abs=1.0)


def test_noise_caps_what_the_true_angles_follow_and_reading_late_does_not():
    truth = _truth(0.0)
    clean = _campaign(truth)
    spread = clean.several("mimo-1").y.std(axis=0)
    fits = _fits(truth, _campaign(truth, noise=0.1 * float(spread[0]), late=1))
    assert fits[NOISELESS][YAW] == pytest.approx(90.0, abs=0.5)
    assert fits[COUPLED][YAW] < fits[NOISELESS][YAW]
