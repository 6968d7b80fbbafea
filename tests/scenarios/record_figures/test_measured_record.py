"""Channels as figures name them, and spectra of records whose inputs repeat."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from scenarios.record_figures.measured_record import Channels, MeasuredRecord
from sysid import IOData, spa

PERIOD, DT = 120, 0.02


def repeating(inputs, pole, noise=1e-3, periods=20):
    """Inputs that repeat and drive one output by a pole, the second twice as much as the first, with noise."""
    rng = np.random.default_rng(2)
    u = np.tile(rng.standard_normal((PERIOD, inputs)), (periods, 1))
    gains = np.arange(1.0, inputs + 1.0)
    y = lfilter([1.0 - pole], [1.0, -pole], u @ gains) + noise * rng.standard_normal(len(u))
    return MeasuredRecord("robot", Path("robot.csv"), (IOData(u, y, DT).detrend(),))


def test_joints_have_paths_of_their_own_and_milliradians():
    names = [f"{joint} {side}" for side in ("commanded", "measured") for joint in ("shoulder_yaw", "elbow_pitch")]
    record = IOData(
        np.zeros((9, 2)),
        np.zeros((9, 2)),
        DT,
        input_names=names[:2],
        output_names=names[2:],
        input_units=("rad", "rad"),
        output_units=("rad", "rad"),
    )
    channels = Channels.of(record)
    assert channels.paths == {
        "shoulder yaw": (0, 0),
        "elbow pitch → shoulder yaw": (0, 1),
        "shoulder yaw → elbow pitch": (1, 0),
        "elbow pitch": (1, 1),
    }
    assert channels.output_axis(0, "residual") == "residual / mrad"
    assert channels.output_scales == (1000.0, 1000.0)
    assert channels.gain_axis(0, 1) == "gain / (rad/rad)"


def test_channels_without_units_have_none_and_others_keep_theirs():
    bare = Channels.of(IOData(np.zeros(9), np.zeros(9), DT))
    assert (bare.output_axis(0), bare.gain_axis(0, 0), bare.density_units(0, 0)) == ("y1", "gain", ("", "", ""))
    volts = Channels.of(IOData(np.zeros(9), np.zeros(9), DT, input_units=("V",), output_units=("deg",)))
    assert volts.gain_axis(0, 0) == "gain / (deg/V)"
    assert volts.density_units(0, 0) == ("deg²/Hz", "V²/Hz", "deg·V/Hz")


def test_the_lines_of_an_input_that_repeats_lie_on_the_frequencies():
    measured = repeating(1, 0.9)
    assert measured.period == PERIOD
    lines = np.arange(1, 10) / (PERIOD * DT)
    frequencies = measured.windowed.frequencies
    assert np.abs(frequencies[:, None] - lines).min(axis=0) == pytest.approx(np.zeros(9), abs=1e-9)
    response = measured.repeated.reliable_response()
    true = 0.1 / (1.0 - 0.9 * np.exp(-2j * np.pi * response.frequencies * DT))
    np.testing.assert_allclose(response.response[:, 0, 0], true, rtol=0.06)


def test_windows_of_several_inputs_that_repeat_tell_them_apart():
    # On a line of their period two inputs are one: only several lines together tell two responses apart.
    measured = repeating(2, 0.5, noise=0.1)
    assert measured.lag <= PERIOD // 4
    assert measured.repeated is None
    lines = np.arange(1, 20) / (PERIOD * DT)
    errors = []
    for lag in (measured.lag, len(measured.longest) // 10):
        response = spa(measured.parts, lag=lag, frequencies=lines).response[:, 0]
        true = np.abs(0.5 / (1.0 - 0.5 * np.exp(-2j * np.pi * lines * DT)))
        errors.append(np.nanmedian(np.abs(np.abs(response) - true[:, None] * [1.0, 2.0])))
    assert errors[0] < 0.2
    assert errors[0] < 0.5 * errors[1], errors
