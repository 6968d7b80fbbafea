"""Excitation signals hold what their names promise."""

import numpy as np
import pytest

from sysid import idinput
from sysid.design import maximum_length_sequence, sum_of_sines
from sysid.design.multisine import crest_factor, low_crest_turns, schroeder_turns
from tests.refusals import refused


@pytest.mark.parametrize("register", [2, 5, 10])
def test_a_maximum_length_sequence_is_white_over_its_period(register):
    period = 2**register - 1
    x = maximum_length_sequence(2 * period, register)
    correlation = [x[:period] @ x[lag : lag + period] for lag in range(period)]
    np.testing.assert_allclose(correlation, [period] + [-1.0] * (period - 1))
    held = maximum_length_sequence(3 * period - 1, register, clock=3)
    np.testing.assert_array_equal(held, np.repeat(x[:period], 3)[:-1])


def test_prbs_of_several_inputs_is_one_sequence_shifted_and_keeps_its_clock():
    signal = idinput(3 * 127, "prbs", (0.0, 1 / 3), (1.0, 3.0), inputs=3, periods=2)
    assert (signal.register, signal.period, signal.u.shape) == (7, 381, (762, 3))
    assert set(np.unique(signal.u)) == {1.0, 3.0}
    assert np.all((np.flatnonzero(np.diff(signal.u[:, 0])) + 1) % 3 == 0)
    deviations = signal.u[:381] - signal.u[:381].mean(axis=0)
    correlation = np.corrcoef(deviations.T)
    assert np.abs(correlation - np.eye(3)).max() < 0.01
    np.testing.assert_array_equal(signal.u[:381], signal.u[381:])
    np.testing.assert_array_equal(idinput(381, "prbs", clock=3).u[:, 0], signal.u[:381, 0] - 2.0)


@pytest.mark.parametrize("kind", ["rgs", "rbs"])
def test_noise_lies_in_its_band_and_has_its_levels(kind):
    signal = idinput(2000, kind, (0.1, 0.3), (-1.0, 3.0), inputs=2, dt=0.02, seed=4)
    power = np.abs(np.fft.rfft(signal.u - 1.0, axis=0)) ** 2
    hz = np.fft.rfftfreq(2000, 0.02)
    inside = (hz > 2.49) & (hz < 7.51)
    assert (power[inside].sum(axis=0) / power.sum(axis=0) > (0.999999 if kind == "rgs" else 0.7)).all()
    np.testing.assert_allclose(signal.frequencies[0], hz[inside], rtol=1e-12)
    if kind == "rgs":
        np.testing.assert_allclose(signal.u.std(axis=0), 2.0)
        np.testing.assert_allclose(signal.u.mean(axis=0), 1.0)
    else:
        assert set(np.unique(signal.u)) == {-1.0, 3.0}
    assert abs(np.corrcoef(signal.u.T)[0, 1]) < 0.2
    np.testing.assert_array_equal(signal.u, idinput(2000, kind, (0.1, 0.3), (-1.0, 3.0), inputs=2, seed=4).u)


@pytest.mark.parametrize(("samples", "lines"), [(64, 15), (512, 31), (500, 60)])
def test_phases_lower_the_peak_below_that_of_schroeder_and_of_one_sine(samples, lines):
    numbers, ones = np.arange(1, lines + 1), np.ones(lines)
    start, best = (
        crest_factor(sum_of_sines(samples, numbers, turns))
        for turns in (schroeder_turns(numbers, ones), low_crest_turns(samples, numbers, ones))
    )
    assert best < np.sqrt(2.0) < start < 1.9


def test_sines_of_several_inputs_take_turns_with_the_lines():
    signal = idinput(200, "sine", (0.0, 0.5), (-2.0, 2.0), inputs=2, sines=8, skip=2, periods=3, dt=0.01)
    amplitudes = np.abs(np.fft.rfft(signal.u[:200], axis=0)) / 100
    for column, lines in zip(amplitudes.T, signal.frequencies, strict=True):
        excited = np.round(lines * 2.0).astype(int)
        assert (len(excited), set(excited % 2)) == (8, {1})
        np.testing.assert_allclose(column[excited], column[excited[0]])
        assert np.delete(column, excited).max() < 1e-12
    assert not set(signal.frequencies[0]) & set(signal.frequencies[1])
    assert np.abs(signal.u).max() == pytest.approx(2.0)
    np.testing.assert_allclose(signal.crest_factor, 2.0 / signal.u.std(axis=0))


@pytest.mark.parametrize("logarithmic", [False, True])
def test_a_sweep_passes_its_frequencies_at_the_times_of_the_law(logarithmic):
    u = idinput(20_000, "chirp", (0.01, 0.1), logarithmic=logarithmic).u[:, 0]
    middle = 0.005 * np.sqrt(10.0) if logarithmic else 0.0275
    crossings = np.flatnonzero(np.diff(np.sign(u)))
    local = crossings[np.abs(crossings - 10_000) < 600]
    assert 0.5 / np.mean(np.diff(local)) == pytest.approx(middle, rel=0.02)


@pytest.mark.parametrize(
    ("message", "arguments", "options"),
    [
        ("kind must be one of rgs, rbs, prbs, sine, chirp, got 'square'", (100, "square"), {}),
        ("band must be two rising fractions", (100, "rbs", (0.5, 0.2)), {}),
        ("levels must be two rising numbers", (100, "rbs", (0, 1), (1, 1)), {}),
        ("prbs does not take sines; it takes clock, register", (100, "prbs"), {"sines": 3}),
        ("band of prbs must be 0 and 1 / clock", (100, "prbs", (0.0, 0.4)), {}),
        ("register must be a whole number from 7 to 32", (100, "prbs"), {"register": 6}),
        ("4 lines for each of 3 input", (100, "sine", (0.0, 0.25)), {"inputs": 3, "sines": 5}),
        ("expected one input of chirp", (100, "chirp"), {"inputs": 2}),
        ("cannot begin at 0 Hz", (100, "chirp"), {"logarithmic": True}),
        ("expected two or more for noise", (100, "rgs", (0.501, 0.519)), {}),
        ("seed must be a whole number", (100,), {"seed": -1}),
    ],
)
def test_refusals(message, arguments, options):
    refused(message, idinput, *arguments, **options)
