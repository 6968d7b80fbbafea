"""Bandwidths of a system that is known, recovered by every method, or refused with the reason."""

import numpy as np
import pytest
from scipy.signal import lfilter

from scenarios.experiments.registry import load
from scenarios.files.errors import ScenarioError
from scenarios.identification.recovered_bandwidth import (
    METHODS,
    NONPARAMETRIC,
    Recording,
    RecoveredBandwidth,
    periodic,
    recover,
    structure,
)
from sysid import IOData, StateSpace

DT = 0.02
JOINT = "shoulder_pitch"


def system(pole: float) -> tuple[list[float], list[float], float]:
    """A servo of one slow and one fast pole with a gain of one at 0 Hz, and its bandwidth, Hz."""
    a = np.poly([pole, 0.3])
    b = [0.0, 0.6 * a.sum(), 0.4 * a.sum()]
    A = np.array([[-a[1], 1.0], [-a[2], 0.0]])
    model = StateSpace(A, np.array([[b[1]], [b[2]]]), np.array([[1.0, 0.0]]), np.zeros((1, 1)), None, DT)
    return b, list(a), float(model.bandwidth()[0, 0])


def recovered(
    method: str, *, pole: float = 0.88, periodic: bool = True, seed: int = 1, noise: float = 0.01
) -> RecoveredBandwidth:
    rng = np.random.default_rng(seed)
    b, a, true = system(pole)
    u = np.repeat(rng.choice([-1.0, 1.0], 50 if periodic else 6000), 2)
    u = np.tile(u, 120) if periodic else u
    y = lfilter(b, a, u) + noise * rng.standard_normal(len(u))
    record = IOData(u, y, DT)[200:].detrend()
    return recover(Recording(JOINT, "5", seed, record, load("siso-5-shoulder_pitch")), method, true)


@pytest.mark.parametrize("method", [name for name in METHODS if name not in NONPARAMETRIC])
def test_every_method_recovers_a_known_bandwidth(method: str) -> None:
    found = recovered(method, noise=0.001)  # with more of it, ARX is biased, as it must be
    assert found.hz == pytest.approx(found.true_hz, rel=0.03)
    assert found.half_power_hz == pytest.approx(found.true_hz, rel=0.03)
    assert found.dc_gain == pytest.approx(1.0, abs=0.02)
    assert found.near
    assert not found.refused
    assert found.lowest_excited_hz == 0.5
    assert any("extrapolated" in text for text in found.reasons)


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    held = sum(recovered("oe", seed=seed).covers for seed in range(20))
    assert held >= 16  # of 20 at 95 %: fewer in one of 400 such tests


def test_a_noisy_command_repeats_all_the_same() -> None:
    rng = np.random.default_rng(1)
    u = np.tile(np.repeat(rng.choice([-1.0, 1.0], 50), 2), 40)
    noisy = u + 0.1 * rng.standard_normal(len(u))
    lone = np.repeat(rng.choice([-1.0, 1.0], 2000), 2)
    assert periodic(IOData(u, u, DT))
    assert periodic(IOData(noisy, noisy, DT))
    assert not periodic(IOData(lone, lone, DT))
    assert not periodic(IOData(u[:150], u[:150], DT)), "less than two periods tell nothing"


@pytest.mark.parametrize("method", NONPARAMETRIC)
def test_lines_of_a_short_file_do_not_tell_the_gain_at_0_hz(method: str) -> None:
    found = recovered(method)
    assert found.refused
    assert np.isnan(found.hz)
    assert found.half_power_hz == pytest.approx(found.true_hz, rel=0.05)
    assert "excites a line every 0.5 Hz" in found.reasons[0]


def test_spectra_of_a_long_sequence_do() -> None:
    found = recovered("spa", periodic=False)
    assert found.hz == pytest.approx(found.true_hz, rel=0.05)
    assert found.covers
    assert "does not repeat every 100 samples" in recovered("etfe", periodic=False).reasons[0]


def test_a_bandwidth_below_the_excitation_is_not_claimed_but_told() -> None:
    found = recovered("oe", pole=0.98)
    assert found.true_hz < 0.2
    assert (found.refused, found.near, found.covers) == (True, False, False)
    assert found.model_hz == pytest.approx(found.true_hz, rel=0.05)
    assert found.record()["model_hz"] == found.model_hz
    assert "excites nothing below 0.5 Hz" in found.reasons[0]


def test_what_an_estimator_refuses_is_a_row_with_the_reason() -> None:
    record = IOData(np.arange(6.0) % 3, np.arange(6.0), DT)
    found = recover(Recording(JOINT, "5", None, record, load("siso-5-shoulder_pitch")), "okid", 1.0)
    assert found.refused
    assert "samples" in found.reasons[0]


def test_printed_models_stand_beside_the_same_method() -> None:
    assert recovered("oe").published_hz == pytest.approx(0.94, abs=0.005)
    assert np.isnan(recovered("armax").published_hz)


def test_unknown_names() -> None:
    with pytest.raises(ScenarioError, match="did you mean 'elbow_pitch'"):
        structure("elbow", "oe")
    with pytest.raises(ScenarioError, match="did you mean 'okid'"):
        structure(JOINT, "okit")
