"""Band of frequencies that an input excites: windowed spectra over the whole record, its ends included."""

from collections.abc import Sequence

import numpy as np
import scipy

from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.repetition import repetitions

LINE = 1e-3  # a line excites if it has this part of the strongest line's power; weaker ones are noise and leakage
FLOOR = 1e-2  # a broad floor of weak lines excites too if it has this part of the total power
SCATTER = 0.03  # lowest power of a line of a random floor, relative to the floor's median
RESOLVED = 2  # lines on either side over which a Hann window spreads every line
TAPERS = 5  # sine tapers of the spectrum that sees the ends of a record
TAPERED = 1e-2  # as LINE, of the tapered spectrum: its own leakage falls with the fourth power of the distance alone
COHERENT = 30.0  # leakage of several lines that add up in phase, over the sum of their powers
REACH = 5  # lines over which the tapers spread a line down to that level
STRONG = 0.25  # power of a line, relative to the strongest, from which on a model of too low an order follows it
NEIGHBOURS = 7  # lines of a random input over which its power is averaged


def excited_band(record: IOData, *, input: int = 0) -> tuple[float, float]:
    """Lowest and highest frequency at which an input has significant power, Hz.

    The lowest is 0 if it reaches 0 Hz within the resolution; 0 Hz counts unless the mean was removed. They are the
    outermost lines of the spectrum under a Hann window that stand out, by themselves or as part of a broad floor. That
    window mutes the ends of the record, where a sweep has its lowest or highest frequencies, or a step all of its
    power: what sine tapers [Riedel1995] show beyond the spread of the outermost line counts too.
    """
    u = record.scored.u[:, input]
    n = len(u)
    power = hann_power(u)
    low, high = _outermost_peaks(power)
    tapered = _tapered_power(u)
    lines = np.flatnonzero(tapered >= TAPERED * tapered.max())
    if lines[0] + REACH < low:
        low = int(lines[0])
    if lines[-1] - REACH > high:
        high = int(lines[-1])
    if low < RESOLVED:
        low = 0
    return low / (n * record.dt), high / (n * record.dt)


def lowest_excited(record: IOData, *, input: int = 0) -> float:
    """Lowest frequency of `excited_band`, Hz."""
    low, _ = excited_band(record, input=input)
    return low


def hann_window(n: int) -> FloatArray:
    """Periodic Hann window (n,)."""
    return np.asarray(0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(n) / n))


def hann_power(signal: FloatArray) -> FloatArray:
    """Squared moduli of the discrete Fourier transform of a signal (N,) under a Hann window (N // 2 + 1,)."""
    window = hann_window(len(signal))
    # A record that ends within a period has a mean under the window even after its own mean was removed.
    centred = signal - (window @ signal / window.sum() - signal.mean())
    return np.asarray(np.abs(np.fft.rfft(window * centred)) ** 2)


def not_leakage(power: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Whether each line of `hann_power` (n,) exceeds what the window spreads there from stronger lines.

    At a distance of x lines a sinusoid appears with the amplitude sin(pi x) / (pi x (1 - x^2)) [Harris1978], at worst
    half a line nearer than the line that shows it.
    """
    n = len(power)
    x = np.arange(RESOLVED + 1, max(n, RESOLVED + 2)) - 0.5
    side = np.concatenate((np.zeros(RESOLVED + 1), 1.0 / (np.pi * x * (x**2 - 1.0)) ** 2))[:n]
    kernel = np.concatenate((side[:0:-1], side))
    size = 2 * len(kernel)
    spread = np.fft.irfft(np.fft.rfft(power, size) * np.fft.rfft(kernel, size), size)[n - 1 : 2 * n - 1]
    # the convolution rounds to parts of the strongest line
    rounding = np.finfo(float).eps * n * power.max()
    return np.asarray(power > COHERENT * spread + rounding)


def _tapered_power(signal: FloatArray) -> FloatArray:
    """Mean spectrum of a signal (N,) under orthogonal sine tapers (N // 2 + 1,), which weigh nearly all alike."""
    n = len(signal)
    times = np.pi * (np.arange(n) + 1.0) / (n + 1.0)
    power = np.zeros(n // 2 + 1)
    for k in range(1, TAPERS + 1):
        power += np.abs(np.fft.rfft(np.sin(k * times) * signal)) ** 2
    return power / TAPERS


def _outermost_peaks(power: FloatArray) -> tuple[int, int]:
    """Lowest and highest line that stand out, moved to the top of their peaks: the window spreads each."""
    level = LINE * power.max()
    floor = float(np.median(power))
    if floor * len(power) >= FLOOR * power.sum():
        # single lines of a random floor scatter far below its median
        level = min(level, SCATTER * floor)
    lines = np.flatnonzero(power >= level)
    low, high = int(lines[0]), int(lines[-1])
    # the spread of a peak, and no further: a broad spectrum may rise all the way to its middle
    if low >= RESOLVED:
        low += int(np.argmax(power[low : low + RESOLVED + 1]))
    start = max(high - RESOLVED, 0)
    high = start + int(np.argmax(power[start : high + 1]))
    return low, high


def lowest_strong_line(experiments: Sequence[IOData]) -> float:
    """Lowest frequency at which every input has a fair share of the power of its strongest line, Hz."""
    lowest = 0.0
    groups = repetitions(experiments)
    for j in range(experiments[0].nu):
        of_input = []
        if groups:
            for group in groups:
                mean = group.folded([e.u[:, [j]] for e in experiments]).mean(axis=0)[:, 0]
                power = np.abs(scipy.fft.rfft(mean)) ** 2
                of_input.append(_first_strong(power) / (group.period * experiments[0].dt))
        else:
            for e in experiments:
                power = np.abs(scipy.fft.rfft(e.u[:, j])) ** 2
                # single lines of a random input may be weak by chance
                power[1:] = scipy.ndimage.uniform_filter1d(power[1:], NEIGHBOURS, mode="nearest")
                of_input.append(_first_strong(power) / (len(e) * e.dt))
        lowest = max(lowest, min(of_input))
    return lowest


def _first_strong(power: FloatArray) -> int:
    """Number of the first line, without that at 0 Hz, of at least `STRONG` of the power of the strongest (n,)."""
    return 1 + int(np.argmax(power[1:] >= STRONG * power[1:].max(initial=0.0)))
