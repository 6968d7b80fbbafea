"""Bandwidths of a system that is known, recovered by every method, or refused with the reason."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from hmtb_twin.parameters.values import LARGE_MOTION
from scenarios.experiments.registry import load
from scenarios.identification.recovered_bandwidth import METHODS, NONPARAMETRIC, Recording, periodic, recover
from sysid import IOData, Polynomials
from sysid.models import innovations_form

DT = 0.02
JOINT = "shoulder_pitch"
SETTING = replace(load("siso-5-shoulder_pitch"), hand_controller=LARGE_MOTION)  # which holds no sample


def recovered(method, *, pole=0.88, periodic=True, seed=1, noise=0.01):
    """Of a servo of one slow and one fast pole with a gain of one at 0 Hz."""
    rng = np.random.default_rng(seed)
    a = np.poly([pole, 0.3])
    b = np.array([0.0, 0.6, 0.4]) * a.sum()
    true = innovations_form(Polynomials(B=b, F=a), DT).bandwidth()[0, 0]
    u = np.repeat(rng.choice([-1.0, 1.0], 50 if periodic else 6000), 2)
    u = np.tile(u, 120) if periodic else u
    y = lfilter(b, a, u) + noise * rng.standard_normal(len(u))
    record = IOData(u, y, DT)[200:].detrend()
    return recover(Recording(JOINT, "5", seed, record, SETTING), method, true)


@pytest.mark.slow
@pytest.mark.parametrize("method", [name for name in METHODS if name not in NONPARAMETRIC])
def test_every_method_recovers_a_known_bandwidth(method):
    estimate = recovered(method, noise=0.001)  # with more of it, ARX is biased, as it must be
    assert estimate.hz == pytest.approx(estimate.true_hz, rel=0.03)
    assert estimate.half_power_hz == pytest.approx(estimate.true_hz, rel=0.03)
    assert estimate.dc_gain == pytest.approx(1.0, abs=0.02)
    assert estimate.near and not estimate.refused
    assert estimate.lowest_excited_hz == 0.5
    assert any("extrapolated" in text for text in estimate.reasons)


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say():
    held = sum(recovered("oe", seed=seed).covers for seed in range(20))
    assert held >= 16  # of 20 at 95 %: fewer in one of 400 such tests


@pytest.mark.slow
def test_a_noisy_command_repeats_all_the_same():
    rng = np.random.default_rng(1)
    u = np.tile(np.repeat(rng.choice([-1.0, 1.0], 50), 2), 40)
    noisy = u + 0.1 * rng.standard_normal(len(u))
    lone = np.repeat(rng.choice([-1.0, 1.0], 2000), 2)
    assert periodic(IOData(u, u, DT), 100)
    assert periodic(IOData(noisy, noisy, DT), 100)
    assert not periodic(IOData(lone, lone, DT), 100)
    assert not periodic(IOData(u[:150], u[:150], DT), 100), "less than two periods tell nothing"


@pytest.mark.parametrize("method", NONPARAMETRIC)
def test_lines_of_a_short_file_do_not_tell_the_gain_at_0_hz(method):
    estimate = recovered(method)
    assert estimate.refused and np.isnan(estimate.hz)
    assert estimate.half_power_hz == pytest.approx(estimate.true_hz, rel=0.05)
    assert "excites a line every 0.5 Hz" in estimate.reasons[0]


def test_spectra_of_a_long_sequence_do():
    estimate = recovered("spa", periodic=False)
    assert estimate.hz == pytest.approx(estimate.true_hz, rel=0.05)
    assert estimate.covers
    assert "does not repeat every 100 samples" in recovered("etfe", periodic=False).reasons[0]


def test_a_bandwidth_below_the_excitation_is_not_claimed_but_told():
    estimate = recovered("oe", pole=0.98)
    assert estimate.true_hz < 0.2
    assert (estimate.refused, estimate.near, estimate.covers) == (True, False, False)
    assert estimate.model_hz == pytest.approx(estimate.true_hz, rel=0.05)
    assert estimate.record()["model_hz"] == estimate.model_hz
    assert "excites nothing below 0.5 Hz" in estimate.reasons[0]


def test_what_an_estimator_refuses_is_a_row_with_the_reason():
    record = IOData(np.arange(6.0) % 3, np.arange(6.0), DT)
    estimate = recover(Recording(JOINT, "5", None, record, SETTING), "okid", 1.0)
    assert estimate.refused and "samples" in estimate.reasons[0]


def test_printed_models_stand_beside_the_same_method():
    assert recovered("oe").published_hz == pytest.approx(0.94, abs=0.005)
    assert np.isnan(recovered("armax").published_hz)
