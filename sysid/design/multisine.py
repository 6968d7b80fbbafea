"""Multisines: one period of a sum of sines, and phases that give it a low crest factor."""

import numpy as np
import scipy

from sysid.records.arrays import FloatArray

POWERS = (4, 8, 16, 32, 64, 128, 256)
"""Exponents of the norms that follow each other to the peak: each minimum is the start of the next."""

STEPS = 200  # most steps of the search with each norm


def sum_of_sines(samples: int, lines: np.ndarray, turns: FloatArray, amplitude: float | FloatArray = 1.0) -> FloatArray:
    """One period of sines at multiples of its frequency.

    Args:
        samples: Length of the period.
        lines: Multiples (L,), from 0 to half the samples.
        turns: Phases (L,) or (L, n), in turns.
        amplitude: Of the coefficients as `numpy.fft.irfft` scales them, a number or as `turns`: `samples / 2` is that
            of a sine of amplitude 1.

    Returns:
        The samples (samples,) or (samples, n).
    """
    spectrum = np.zeros((samples // 2 + 1, *turns.shape[1:]), dtype=complex)
    spectrum[lines] = amplitude * np.exp(2j * np.pi * turns)
    return np.fft.irfft(spectrum, samples, axis=0)


def crest_factor(signal: FloatArray) -> FloatArray:
    """Largest absolute value over the root mean square, of each column."""
    return np.asarray(np.abs(signal).max(axis=0) / np.sqrt(np.mean(signal**2, axis=0)))


def schroeder_turns(lines: np.ndarray, power: FloatArray) -> FloatArray:
    """Phases (L,), in turns, of a sweep that spends on every line the time that its power asks for [Schroeder1970]."""
    share = power / power.sum()
    earlier = np.cumsum(share) - share
    return -(lines * earlier - (np.cumsum(share * lines) - share * lines))


def low_crest_turns(samples: int, lines: np.ndarray, amplitude: FloatArray) -> FloatArray:
    """Phases (L,), in turns, at which the samples have a low peak.

    From Schroeder's phases on, the norms of rising exponent are minimised over the phases: their limit is the peak
    [Guillaume1991]. The minimum is a local one. Lines are multiples of the frequency of the period, rising, from 1 to
    below half the samples (L,), with amplitudes (L,).
    """

    def norm(turns: FloatArray, power: int) -> tuple[float, FloatArray]:
        """Logarithm of the norm, and its gradient."""
        signal = sum_of_sines(samples, lines, turns, amplitude)
        # relative to the peak: the 256th power of the samples themselves would overflow
        highest = float(np.abs(signal).max())
        relative = signal / highest
        total = float(np.sum(relative**power))
        slope = np.fft.rfft(relative ** (power - 1) / (total * highest))[lines]
        # of a line, X and its conjugate at the negative frequency
        coefficients = amplitude * np.exp(2j * np.pi * turns)
        gradient = -4.0 * np.pi / samples * np.imag(coefficients * slope.conj())
        return float(np.log(total) / power + np.log(highest)), gradient

    def peak(turns: FloatArray) -> float:
        return float(np.abs(sum_of_sines(samples, lines, turns, amplitude)).max())

    best = turns = schroeder_turns(lines, amplitude**2)
    for power in POWERS:
        turns = scipy.optimize.minimize(
            norm, turns, args=(power,), jac=True, method="L-BFGS-B", options={"maxiter": STEPS}
        ).x
        # a minimum of the norm need not have a lower peak than the one before
        best = min(best, turns, key=peak)
    return best
