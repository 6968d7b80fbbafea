"""Problems with a known answer, shared by the tests of the analyst."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter, max_len_seq

import sysid

DT = 0.02
BURN_IN = 500
Array = NDArray[np.float64]


def binary_sequence(samples, hold, bits=12):
    """Maximum-length sequence of +-1, every bit held for `hold` samples."""
    sequence = max_len_seq(bits, length=-(-samples // hold))[0] * 2.0 - 1.0
    return np.repeat(sequence, hold)[:samples]


@dataclass(frozen=True, eq=False)
class Problem:
    """A single-input system A y = B/F u + C/D e with its input and noise variance; records begin in steady state."""

    A: Array
    B: Array
    C: Array
    D: Array
    F: Array
    nk: int
    samples: int
    hold: int
    variance: float

    @property
    def parameters(self):
        """True parameters in the order A, B, C, D, F."""
        return np.concatenate((self.A[1:], self.B[self.nk :], self.C[1:], self.D[1:], self.F[1:]))

    @property
    def input(self):
        """Input with the burn-in in front."""
        return binary_sequence(self.samples + BURN_IN, self.hold)

    @property
    def noise_free(self):
        """Output without noise, burn-in in front."""
        return np.asarray(lfilter(self.B, np.convolve(self.A, self.F), self.input))

    @property
    def model(self):
        """The truth."""
        polynomials = sysid.Polynomials(self.A, self.B, self.C, self.D, self.F)
        return sysid.models.innovations_form(polynomials, DT, self.variance)

    def output(self, e):
        """Output for innovations with the burn-in in front."""
        return self.noise_free + lfilter(self.C, np.convolve(self.A, self.D), e)

    def innovations(self, seed):
        """White noise of the right variance, burn-in in front."""
        return np.random.default_rng(seed).standard_normal(self.samples + BURN_IN) * np.sqrt(self.variance)

    def draw(self, seed):
        """One noise realisation."""
        return sysid.IOData(self.input[BURN_IN:], self.output(self.innovations(seed))[BURN_IN:], DT)

    def information(self):
        """Fisher information of the parameters, averaged over five noise draws."""
        total = np.zeros((len(self.parameters),) * 2)
        orders = [len(p) - 1 for p in (self.A, self.C, self.D, self.F)]

        def past(signal, lags):
            return [np.concatenate((np.zeros(lag), signal[: len(signal) - lag])) for lag in lags]

        na, nc, nd, nf = (range(1, n + 1) for n in orders)
        cf = np.convolve(self.C, self.F)
        for seed in range(5):
            e = self.innovations(90_000 + seed)
            w, v = lfilter(self.B, self.F, self.input), lfilter(self.C, self.D, e)
            rows = past(-lfilter(self.D, self.C, self.output(e)), na)
            rows += past(lfilter(self.D, cf, self.input), range(self.nk, len(self.B)))
            rows += past(lfilter([1.0], self.C, e), nc) + past(-lfilter([1.0], self.C, v), nd)
            rows += past(-lfilter(self.D, cf, w), nf)
            psi = np.array(rows)[:, BURN_IN:]
            total += psi @ psi.T / self.variance / 5
        return total


ONE = np.ones(1)


def _problem(A, B, C, F, nk, samples, hold, variance, D=ONE):
    """Noise 20 dB below the output where no variance is given."""
    draft = Problem(A, np.concatenate((np.zeros(nk), B)), C, D, F, nk, samples, hold, 1.0)
    if variance is None:
        gain = float(np.sum(lfilter(C, np.convolve(A, D), np.eye(1, 5000)[0]) ** 2))
        variance = float(np.var(draft.noise_free[BURN_IN:])) / 100.0 / gain
    return replace(draft, variance=variance)


def make_p1():
    """The published yaw ARMAX model, badly conditioned."""
    c = np.poly([0.5, 0.3 + 0.4j, 0.3 - 0.4j, -0.2, 0.1]).real
    a = np.array([1, -2.542, 2.367, -0.8523, -0.08044, 0.1103])
    return _problem(a, np.array([0.003804, 0.003504, -0.004285]), c, ONE, 2, 12_000, 5, None)


def make_p2():
    """The published shoulder-pitch OE model."""
    return _problem(ONE, np.array([0.03459, 0.07584]), ONE, np.array([1, -0.9776, 0.07922]), 1, 12_000, 5, None)


def make_p3():
    """A second-order ARMAX textbook system."""
    c = np.array([1, -1.0, 0.2])
    return _problem(np.array([1, -1.5, 0.7]), np.array([1.0, 0.5]), c, ONE, 1, 2000, 1, 1.0)


def make_p4():
    """The plant of P2 under a resonant disturbance: a Box-Jenkins system."""
    c, d, f = np.array([1, -0.8, 0.2]), np.array([1, -1.5, 0.7]), np.array([1, -0.9776, 0.07922])
    return _problem(ONE, np.array([0.03459, 0.07584]), c, f, 1, 3000, 5, None, d)


def make_p5():
    """A third-order ARX system with a delay of two."""
    a = np.array(np.poly([0.9 * np.exp(0.4j), 0.9 * np.exp(-0.4j), 0.6]).real)
    return _problem(a, np.array([0.5, -0.2, 0.1]), ONE, ONE, 2, 2000, 2, None)


# The factories stay plain functions: the benchmarks call them.
p1, p2, p3, p4, p5 = (
    pytest.fixture(scope="session", name=make.__name__.removeprefix("make_"))(make)
    for make in (make_p1, make_p2, make_p3, make_p4, make_p5)
)
