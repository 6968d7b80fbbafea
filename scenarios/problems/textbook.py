"""Textbook systems: five open-loop ones, each with another structure or difficulty, and a plant in closed loop."""

import numpy as np
from scipy.signal import lfilter, max_len_seq

from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.problems.linear_problem import BURN_IN, LinearProblem
from sysid import Polynomials
from sysid.records.arrays import FloatArray

BITS = 12
ONE = np.ones(1)

TEXTBOOK = {
    "p1": "the published yaw ARMAX model: badly conditioned, single coefficients are hardly known, the response is",
    "p2": "the published shoulder-pitch OE model",
    "p3": "an ARMAX system of second order with much noise, N = 2000",
    "p4": "the plant of p2 under a resonant disturbance: a Box-Jenkins system",
    "p5": "an ARX system of third order with a delay of two, N = 2000",
}
"""Open-loop systems by name."""

FEEDBACK = {
    "feedback": "a plant of second order with ARMAX noise under proportional feedback",
    "feedback-arx": "the same with equation noise, of which least squares are unbiased",
}
"""Closed-loop systems by name."""

FEEDBACK_DEVIATION = 0.3
"""Of the innovation, for a reference of +-1: noise is 5 % of the power of the input, which biases open-loop methods."""


def binary_sequence(samples: int, hold: int, bits: int = BITS) -> FloatArray:
    """Maximum-length sequence of +-1, every bit held for some samples (N,)."""
    sequence = max_len_seq(bits, length=-(-samples // hold))[0] * 2.0 - 1.0
    return np.repeat(sequence, hold)[:samples]


def textbook(name: str, label: str, samples: int | None) -> LinearProblem:
    """A problem of `TEXTBOOK` under a name; samples of a record, or None for as many as it has."""
    a: FloatArray = ONE
    b: FloatArray = np.array([0.0, 0.03459, 0.07584])
    c: FloatArray = ONE
    d: FloatArray = ONE
    f: FloatArray = np.array([1.0, -0.9776, 0.07922])
    length, hold, variance = 12_000, 5, None
    if name == "p1":
        a, f = np.array([1, -2.542, 2.367, -0.8523, -0.08044, 0.1103]), ONE
        b = np.array([0, 0, 0.003804, 0.003504, -0.004285])
        c = np.asarray(np.poly([0.5, 0.3 + 0.4j, 0.3 - 0.4j, -0.2, 0.1]).real, dtype=np.float64)
    elif name == "p3":
        a, b, c, f = np.array([1, -1.5, 0.7]), np.array([0, 1.0, 0.5]), np.array([1, -1.0, 0.2]), ONE
        length, hold, variance = 2000, 1, 1.0
    elif name == "p4":
        c, d, length = np.array([1, -0.8, 0.2]), np.array([1, -1.5, 0.7]), 3000
    elif name == "p5":
        a = np.asarray(np.poly([0.9 * np.exp(0.4j), 0.9 * np.exp(-0.4j), 0.6]).real, dtype=np.float64)
        b, f, length, hold = np.array([0, 0, 0.5, -0.2, 0.1]), ONE, 2000, 2
    full = binary_sequence(length + BURN_IN, hold)
    truth = Polynomials(a, b, c, d, f)
    if variance is None:
        variance = noise_variance(truth, full[:, None], 20.0)
    # The variance is that of the full length, so that another length is the same system.
    reference = full if samples is None else binary_sequence(samples + BURN_IN, hold)
    return LinearProblem(label, truth, reference[:, None], variance, SAMPLE_TIME)


def noise_variance(truth: Polynomials, inputs: FloatArray, signal_to_noise_db: float) -> float:
    """Variance of the innovation with which the noise lies so far below the output.

    Args:
        truth: The system.
        inputs: The burn-in in front (BURN_IN + N, nu).
        signal_to_noise_db: Power of the output without noise over that of the noise, dB.
    """
    channels = [truth.channel(j) for j in range(truth.nu)]
    parts = [lfilter(b, np.convolve(truth.A, f), inputs[:, j]) for j, (b, f) in enumerate(channels)]
    pulse = np.zeros(5000)
    pulse[0] = 1.0
    gain = float(np.sum(lfilter(truth.C, np.convolve(truth.A, truth.D), pulse) ** 2))
    power = float(np.var(np.sum(parts, axis=0)[BURN_IN:]))
    return power / 10.0 ** (signal_to_noise_db / 10.0) / gain


def feedback(plain: str, name: str, samples: int | None) -> LinearProblem:
    """Input u = r - 0.4 y with a binary r, every bit held for two samples.

    Which estimators are biased: all that take the input as independent of the noise (output error, instruments of the
    input, spectra, open-loop subspace methods), and those whose noise model is wrong. Which are not: prediction-error
    methods in a structure that holds the noise [Ljung1999, sec. 13.4].
    """
    c: FloatArray = np.array([1.0, 0.6, 0.3]) if plain == "feedback" else np.ones(1)
    truth = Polynomials(A=np.array([1.0, -1.5, 0.7]), B=np.array([0.0, 1.0, 0.5]), C=c)
    reference = binary_sequence((samples or 1000) + BURN_IN, hold=2)
    return LinearProblem(name, truth, reference[:, None], FEEDBACK_DEVIATION**2, SAMPLE_TIME, feedback=0.4)
