"""Excitation signals: noise, binary sequences, multisines and sweeps with what is known about them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.design.multisine import crest_factor, low_crest_turns, sum_of_sines
from sysid.records.arguments import one_of, sampling_interval, shown, truth_value, whole_number
from sysid.records.arrays import FloatArray, Locked, real_array
from sysid.records.errors import SysidError

KINDS = ("rgs", "rbs", "prbs", "sine", "chirp")
"""Random Gaussian, random binary, maximum-length binary, sum of sines, sweep: the names of MATLAB, and `chirp`."""

OPTIONS = {"prbs": ("clock", "register"), "sine": ("sines", "skip"), "chirp": ("logarithmic",)}
"""Options that only one kind takes."""

LONGEST_REGISTER = 32  # bits of the longest register that `scipy.signal.max_len_seq` has taps for
LARGEST = 10**8  # values of the largest signal, of all inputs


@dataclass(frozen=True, eq=False, repr=False)
class InputSignal(Locked):
    """An excitation signal.

    Attributes:
        u: Inputs (N, nu).
        dt: Sampling interval, s.
        kind: One of `KINDS`.
        period: Samples after which the signal repeats itself.
        frequencies: Excited multiples of 1 / (period dt), an array for each input, Hz: of `sine` its lines, of others
            those in the band.
        crest_factor: Largest distance from the middle of the levels over its root mean square, of each input (nu,).
        register: Bits of the shift register of `prbs`; None for others.
    """

    u: FloatArray
    dt: float
    kind: str
    period: int
    frequencies: tuple[FloatArray, ...]
    crest_factor: FloatArray
    register: int | None


def maximum_length_sequence(
    samples: int, register: int, *, clock: int = 1, state: Sequence[int] | np.ndarray | None = None
) -> FloatArray:
    """Levels -1 and +1 of a shift register whose sequence repeats after 2^register - 1 bits [Soderstrom1989, C5.3].

    Args:
        samples: Length N.
        register: Bits of the register, 2 to 32.
        clock: Samples per bit.
        state: First contents of the register, not all zero; ones by default.

    Returns:
        The sequence (N,).
    """
    bits, _ = scipy.signal.max_len_seq(register, state=state, length=-(-samples // clock))
    return np.repeat(2.0 * bits - 1.0, clock)[:samples]


def shortest_register(samples: int, clock: int = 1) -> int:
    """Bits of the shortest register whose sequence fills so many samples before it repeats itself."""
    return max(2, (-(-samples // clock)).bit_length())


def idinput(
    n: int,
    kind: str = "rbs",
    band: Sequence[float] = (0.0, 1.0),
    levels: Sequence[float] = (-1.0, 1.0),
    *,
    inputs: int = 1,
    periods: int = 1,
    clock: int | None = None,
    register: int | None = None,
    sines: int | None = None,
    skip: int = 1,
    logarithmic: bool = False,
    dt: float = 1.0,
    seed: int = 0,
) -> InputSignal:
    """Make an excitation signal, as MATLAB's function of this name.

    - `rgs`: normal noise in a band, of mean and standard deviation exactly as the levels say, one deviation about it.
    - `rbs`: its sign. The band holds most of the power, not all.
    - `prbs`: a maximum-length sequence, flat under the envelope of the held bits. Several inputs play it shifted
      by equal parts of the period, and are uncorrelated where the period is that of the sequence.
    - `sine`: equal lines whose phases keep the peak low, from Schroeder's start on [Schroeder1970; Guillaume1991].
      Several inputs take turns with the lines, and so are orthogonal.
    - `chirp`: a sweep from the lower to the upper end of the band.

    Args:
        n: Samples of a period.
        kind: One of the above.
        band: Ends as fractions of the Nyquist frequency; of `prbs` 0 and 1 / clock.
        levels: Lowest and highest value; `rgs`: mean less and plus a standard deviation.
        inputs: Number of inputs nu.
        periods: Number of periods.
        clock: Samples per bit of `prbs`; by default from the band.
        register: Bits of the shift register of `prbs`, 2 to 32; by default the shortest whose sequence fills a period.
        sines: Number of lines of each input of `sine`, spread over the band; by default all.
        skip: Distance of the lines of `sine`, in multiples of the lowest frequency: 2 for odd multiples alone.
        logarithmic: Whether a `chirp` takes equal times for equal ratios of frequencies.
        dt: Sampling interval, s.
        seed: Draws all that is random: noise, and the first contents of the register.

    Returns:
        The signal, N = n periods.

    Raises:
        SysidError: An unknown kind, an option of another kind, ends of the band or levels that do not rise or are out
            of range, no line in the band, fewer lines than asked for, or several inputs of `chirp`.
    """
    one_of("kind", kind, KINDS)
    n, skip = whole_number("n", n, 2, LARGEST), whole_number("skip", skip, 1)
    inputs = whole_number("inputs", inputs, 1, max(1, LARGEST // n))
    periods = whole_number("periods", periods, 1, max(1, LARGEST // (n * inputs)))
    dt, rng = sampling_interval(dt), np.random.default_rng(whole_number("seed", seed, 0))
    logarithmic = truth_value("logarithmic", logarithmic)
    # skip = 1 leaves no line out, as without the option
    chosen = {
        "clock": clock is not None,
        "register": register is not None,
        "sines": sines is not None,
        "skip": skip != 1,
        "logarithmic": logarithmic,
    }
    _refuse_foreign_options(kind, [name for name, is_chosen in chosen.items() if is_chosen])
    low, high = _rising("band", band, "two rising fractions of the Nyquist frequency, 0 to 1", 0.0, 1.0)
    bottom, top = _rising("levels", levels, "two rising numbers", -np.inf, np.inf)
    multiples = np.arange(n // 2 + 1)
    # 1e-9: the ends of the band belong to it whatever rounding says
    inside = multiples[(multiples >= low * n / 2 - 1e-9) & (multiples <= high * n / 2 + 1e-9)]
    lines = [inside] * inputs
    if kind == "rgs":
        noise = _noise(n, inputs, inside, rng)
        x = (noise - noise.mean(axis=0)) / noise.std(axis=0)
    elif kind == "rbs":
        x = np.where(_noise(n, inputs, inside, rng) < 0.0, -1.0, 1.0)
    elif kind == "prbs":
        clock = _clock_of_band(low, high) if clock is None else clock
        clock = whole_number("clock", clock, 1, n)
        shortest = shortest_register(n, clock)
        register = whole_number("register", shortest if register is None else register, shortest, LONGEST_REGISTER)
        x = _shifted_sequences(n, inputs, clock, register, rng)
    elif kind == "sine":
        lines = _lines(inside[(inside > 0) & (2 * inside < n)][::skip], inputs, sines)
        x = np.column_stack([_low_crest_sines(n, of_input) for of_input in lines])
        x /= np.abs(x).max(axis=0)
    else:
        x = _sweep(n, low, high, inputs, logarithmic)
    period = 0.5 * (bottom + top) + 0.5 * (top - bottom) * x
    hz = tuple(of_input / (n * dt) for of_input in lines)
    return InputSignal(np.tile(period, (periods, 1)), dt, kind, n, hz, crest_factor(x), register)


def _refuse_foreign_options(kind: str, chosen: Sequence[str]) -> None:
    """Refuse chosen options that the kind of signal does not take."""
    taken = OPTIONS.get(kind, ())
    foreign = sorted(set(chosen) - set(taken))
    if foreign:
        raise SysidError(f"{kind} does not take {', '.join(foreign)}; it takes {', '.join(sorted(taken)) or 'neither'}")


def _clock_of_band(low: float, high: float) -> int:
    """Samples per bit of a maximum-length sequence whose band ends at 1 / clock, where its envelope has -4 dB."""
    clock = round(1.0 / high)
    if low or abs(clock * high - 1.0) > 1e-6:
        raise SysidError(f"band of prbs must be 0 and 1 / clock, clock a whole number, got ({low:g}, {high:g})")
    return clock


def _shifted_sequences(n: int, inputs: int, clock: int, register: int, rng: np.random.Generator) -> FloatArray:
    """A maximum-length sequence of n samples for each input, shifted by equal parts of the period (n, inputs)."""
    state = rng.integers(0, 2, register)
    if not state.any():
        state[0] = 1  # a register of zeros never leaves zero
    bits = -(-n // clock)
    shifts = [clock * (j * bits // inputs) for j in range(inputs)]
    sequence = maximum_length_sequence(n + shifts[-1], register, clock=clock, state=state)
    return np.column_stack([sequence[shift : shift + n] for shift in shifts])


def _low_crest_sines(n: int, lines: np.ndarray) -> FloatArray:
    """Sum of equal sines at multiples of the lowest frequency, with a low peak (n,)."""
    turns = low_crest_turns(n, lines, np.ones(len(lines)))
    return sum_of_sines(n, lines, turns)


def _rising(name: str, value: Sequence[float], expected: str, low: float, high: float) -> tuple[float, float]:
    """Two rising numbers from `low` to `high`."""
    pair = real_array(name, value)
    if pair.shape != (2,) or not low <= pair[0] < pair[1] <= high:
        raise SysidError(f"{name} must be {expected}, got {shown(value)}")
    return float(pair[0]), float(pair[1])


def _noise(n: int, inputs: int, inside: np.ndarray, rng: np.random.Generator) -> FloatArray:
    """Normal noise (n, inputs) at some lines of the period alone; a filter would have a transient."""
    if len(inside) < 2:
        raise SysidError(f"{len(inside)} line(s) of {n} samples lie in the band: expected two or more for noise")
    x = rng.standard_normal((n, inputs))
    if len(inside) == n // 2 + 1:
        return x  # all lines: nothing to take away
    spectrum = np.fft.rfft(x, axis=0)
    outside = np.ones(len(spectrum), dtype=bool)
    outside[inside] = False
    spectrum[outside] = 0.0
    return np.fft.irfft(spectrum, n, axis=0)


def _lines(lines: np.ndarray, inputs: int, sines: int | None) -> list[np.ndarray]:
    """Divide the lines of the band among the inputs: every input takes each n-th line."""
    by_input = [lines[j::inputs] for j in range(inputs)]
    count = 1 if sines is None else whole_number("sines", sines, 1)
    fewest = len(by_input[-1])
    if fewest < count:
        raise SysidError(f"{fewest} lines for each of {inputs} input(s) lie in the band, expected {count} or more")
    if sines is None:
        return by_input
    chosen = []
    for of_input in by_input:
        evenly_spread = np.round(np.linspace(0, len(of_input) - 1, count)).astype(int)
        chosen.append(of_input[evenly_spread])
    return chosen


def _sweep(n: int, low: float, high: float, inputs: int, logarithmic: bool) -> FloatArray:
    """Sweep from the lower to the upper end of the band (n, 1)."""
    if inputs > 1:
        raise SysidError("several sweeps are not independent: expected one input of chirp")
    if logarithmic and low <= 0.0:
        raise SysidError("a logarithmic chirp cannot begin at 0 Hz: expected a lower end of the band above 0")
    # fractions of the Nyquist frequency in cycles per sample
    shape = "logarithmic" if logarithmic else "linear"
    sweep = scipy.signal.chirp(np.arange(n), low / 2.0, n, high / 2.0, shape)
    return np.asarray(sweep, dtype=np.float64)[:, None]
