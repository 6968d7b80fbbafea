"""The excitations hold what the thesis says of them."""

import numpy as np
import pytest

from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.excitation import (
    KINDS,
    bipolar_ramping_pulse,
    chirp,
    chirp_as_printed,
    chirp_franklin,
    multisine,
    points,
    prbs,
    record,
    sign_recursion,
    sine,
    two_sines,
    white_noise,
)
from scenarios.experiments.waveform import POINTS, Waveform
from tests.refusals import refused

EXAMPLES = [
    sine(frequency=5.0),
    two_sines(frequency=2.5),
    two_sines(frequency=1.25, amplitude=2.0),
    prbs(),
    chirp(f_start=5.0, f_end=10.0),
    chirp_as_printed(f_low=1.0, f_high=2.0, f_center=4.0),
    chirp_franklin(f_start=1.0, f_end=5.0),
    bipolar_ramping_pulse(),
    multisine(),
    white_noise(),
    sign_recursion(),
    points(points=tuple(np.linspace(-1.0, 1.0, 100))),
    record(samples=tuple(np.linspace(-1.0, 1.0, 332))),
    record(samples=tuple(np.linspace(-1.0, 0.0, 133)), sample_rate=25.0),
]


def tones(waveform):
    """Frequencies with power, and the amplitude of each."""
    lines = np.fft.rfft(waveform.points) / POINTS
    frequency = np.fft.rfftfreq(POINTS, 1 / waveform.update_rate)
    return {float(f): float(2 * a) for f, a in zip(frequency, np.abs(lines), strict=True) if a > 1e-9}


@pytest.mark.slow
@pytest.mark.parametrize("waveform", EXAMPLES, ids=lambda w: w.kind)
def test_parameters_make_the_same_file_again_and_it_repeats(waveform):
    again = KINDS[waveform.kind](**waveform.parameters)
    np.testing.assert_array_equal(again.points, waveform.points)
    assert np.abs(waveform.points).max() <= waveform.parameters.get("amplitude", 1.0) + 1e-12
    with pytest.raises(ValueError, match="read-only"):
        waveform.points[0] = 1.0
    # The density integrates to the mean square.
    np.testing.assert_allclose(waveform.psd().density.sum() / waveform.period, np.mean(waveform.points**2), rtol=1e-12)
    played = waveform.play(2.5 * waveform.period)
    period = round(SAMPLE_RATE * waveform.period)
    assert played.shape == (round(2.5 * SAMPLE_RATE * waveform.period), 1)
    np.testing.assert_array_equal(played[period : 2 * period], played[:period])
    assert set(np.unique(played)) == set(np.unique(waveform.points))


def test_every_kind_has_an_example_and_sinusoids_are_pure():
    assert {waveform.kind for waveform in EXAMPLES} == set(KINDS)
    assert tones(sine(frequency=5.0, amplitude=2.0)) == pytest.approx({5.0: 2.0})
    assert tones(two_sines(frequency=2.5)) == pytest.approx({2.5: 0.5, 10.0: 0.5})
    assert tones(chirp_as_printed(f_low=1.0, f_high=2.0, f_center=4.0)) == pytest.approx({5.0: 1.0})


def test_order_of_excitation_of_sinusoids_is_twice_their_number():
    waveforms = (sine(frequency=5.0), two_sines(frequency=2.5), Waveform(np.zeros(100), "silence"))
    assert [waveform.order_of_excitation() for waveform in waveforms] == [2, 4, 0]


def test_order_of_excitation_of_prbs_is_rich_and_at_most_the_file():
    assert 90 <= prbs(clock=1).order_of_excitation() <= 100
    # A bit of two samples puts zeros at multiples of 25 Hz: the Nyquist line falls out.
    held = prbs(clock=2)
    assert held.psd().density[-1] == pytest.approx(0.0, abs=1e-20)
    assert 90 <= held.order_of_excitation() <= 99


@pytest.mark.parametrize("clock", [1, 2, 3, 5])
def test_prbs_has_two_levels_and_bits_of_the_clock(clock):
    points = prbs(amplitude=2.0, clock=clock, seed=7).points
    assert set(points) == {-2.0, 2.0}
    assert all(set(prbs(clock=held, seed=seed).points) == {-1.0, 1.0} for held in (clock, 33) for seed in range(20))
    changes = np.flatnonzero(np.diff(points)) + 1
    assert np.all(changes % clock == 0)
    # A whole maximum-length sequence sums to one level; the cut file cannot miss by more than the bits cut off.
    bits = -(-POINTS // clock)
    dropped = 2 ** int(np.ceil(np.log2(bits + 1))) - 1 - bits
    assert abs(points[::clock].sum()) / 2.0 <= dropped + 1


def test_prbs_of_a_longer_register_is_another_sequence_and_the_shortest_is_the_default():
    assert np.array_equal(prbs(seed=3, register=6).points, prbs(seed=3).points)
    assert "register" not in prbs(seed=3).parameters
    longer = prbs(seed=3, register=20)
    assert longer.parameters["register"] == 20
    assert set(np.unique(longer.points)) == {-1.0, 1.0}
    for register in (5, 33):
        refused(rf"register must be 6 to 32 bits at 2 samples .* given {register}", prbs, register=register)


@pytest.mark.parametrize(("memory", "changes"), [(-0.8, (60, 90)), (0.0, (35, 65)), (0.8, (10, 40))])
def test_the_sign_recursion_is_the_equation_to_the_letter(memory, changes):
    own = {"amplitude": 1.5, "memory": memory, "seed": 4}
    points, printed = (sign_recursion(**own, as_printed=as_printed).points for as_printed in (False, True))
    c1, c2 = 1.5, -1.5
    level = c1
    for t, noise in enumerate(np.random.default_rng(4).standard_normal(POINTS)):
        sign = np.sign(memory * level / c1 + noise)
        level = (c1 + c2) / 2 + (c1 - c2) / 2 * sign
        # As printed, without the halves, both levels are twice as large.
        assert (points[t], printed[t]) == (level, (c1 + c2) + (c1 - c2) * sign)
    assert changes[0] <= np.count_nonzero(np.diff(points)) <= changes[1]
    refused("never changes its level", sign_recursion, memory=9.0)


def test_franklins_chirp_is_equations_2_12_to_2_14():
    waveform = chirp_franklin(f_start=1.0, f_end=5.0, amplitude=2.0, ramp=0.2, offset=0.5)
    for k, point in enumerate(waveform.points):
        height = 2.0 * min(k / (0.2 * 100), 1.0) * min((100 - k) / (0.2 * 100), 1.0)
        f_k = (1.0 + k / 100 * (5.0 - 1.0)) / 50.0  # in cycles per sample, as (2.12) counts
        assert point == pytest.approx(0.5 + height * np.sin(2 * np.pi * f_k * k), abs=1e-12)


@pytest.mark.parametrize(("f_start", "f_end"), [(0, 1), (0, 5), (5, 10), (5, 15)])
def test_chirps_of_both_tables_repeat_without_a_jump(f_start, f_end):
    played = chirp(f_start=f_start, f_end=f_end).play(4.0)[:, 0]
    t = np.arange(POINTS + 1) / SAMPLE_RATE
    phase = 2 * np.pi * (f_start * t + (f_end - f_start) * t**2 / 4)
    assert played[POINTS] == pytest.approx(np.cos(phase[-1]), abs=1e-9)


def test_chirp_sweeps_the_band():
    psd = chirp(f_start=5.0, f_end=10.0).psd()
    inside = (psd.frequency >= 4.5) & (psd.frequency <= 10.5)
    assert psd.density[inside].sum() > 0.95 * psd.density.sum()
    assert (psd.density[inside] > 0.02 * psd.density.max()).sum() >= 9


def test_bipolar_ramping_pulse_alternates():
    points = bipolar_ramping_pulse(amplitude=4.0).points
    ramp = 4.0 * np.arange(1, 6) / 5
    np.testing.assert_allclose(points[:5], ramp)
    np.testing.assert_allclose(points[25:30], -ramp)
    np.testing.assert_allclose(points[50:55], ramp)
    assert np.count_nonzero(points) == 20
    growing = bipolar_ramping_pulse(amplitude=4.0, growing=True).points
    assert [abs(growing[start + 4]) for start in (0, 25, 50, 75)] == pytest.approx([1.0, 2.0, 3.0, 4.0])


def test_multisine_has_equal_lines_in_its_band_only():
    lines = tones(multisine(f_min=1.0, f_max=4.0, odd=True))
    assert sorted(lines) == [1.5, 2.5, 3.5]
    assert max(lines.values()) == pytest.approx(min(lines.values()))


@pytest.mark.parametrize(
    "bad",
    [
        lambda: sine(frequency=5.1),
        lambda: sine(frequency=0.0),
        lambda: sine(frequency=25.0),  # sampled at its zeros
        lambda: sine(frequency=5.0, amplitude=1e308),
        lambda: two_sines(frequency=5.0).play(float("nan")),
        lambda: two_sines(frequency=20.0),
        lambda: prbs(clock=0),
        lambda: prbs(clock=50),
        lambda: prbs(seed=-1),
        lambda: multisine(seed=2**63),
        lambda: white_noise(seed=-1),
        lambda: chirp(f_start=-1.0, f_end=5.0),
        lambda: chirp_franklin(f_start=1.0, f_end=5.0, ramp=0.9),
        lambda: bipolar_ramping_pulse(pulse_width=1e308),
        lambda: multisine(f_min=5.0, f_max=4.0),
        lambda: prbs().play(-1.0),
        lambda: points(points=(0.0, 1.0)),
        lambda: points(points=(float("nan"),) * 100),
        lambda: sign_recursion(seed=-1),
        lambda: Waveform(np.zeros(100), "sine", update_rate=0.0),
    ],
)
def test_bad_values_are_refused(bad):
    refused("given|expected|does not", bad)


@pytest.mark.parametrize(("clock", "largest"), [(1, 0.12), (2, 0.16), (3, 0.28)])
def test_the_mean_that_a_cut_sequence_keeps(clock, largest):
    """As the docstring says; every start state of the register is among so many seeds."""
    means = [abs(prbs(clock=clock, seed=seed).points.mean()) for seed in range(1000)]
    assert max(means) == pytest.approx(largest, abs=1e-12)
