"""Problems with a known answer, shared by the tests of the analyst."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter, max_len_seq

import sysid

DT = 0.02
BURN_IN = 500
Array = NDArray[np.float64]


def binary_sequence(samples: int, hold: int, bits: int = 12) -> Array:
    """Maximum-length sequence of +-1, every bit held for `hold` samples."""
    sequence = max_len_seq(bits, length=-(-samples // hold))[0] * 2.0 - 1.0
    return np.repeat(sequence, hold)[:samples]


@dataclass(frozen=True, eq=False)
class Problem:
    """A single-input system A y = B/F u + C e with its input and noise variance; records begin in steady state."""

    A: Array
    B: Array
    C: Array
    F: Array
    nk: int
    samples: int
    hold: int
    variance: float
    parameters: Array

    @property
    def input(self) -> Array:
        """Input with the burn-in in front."""
        return binary_sequence(self.samples + BURN_IN, self.hold)

    @property
    def noise_free(self) -> Array:
        """Output without noise, burn-in in front."""
        return np.asarray(lfilter(self.B, np.convolve(self.A, self.F), self.input))

    @property
    def model(self) -> sysid.StateSpace:
        """The truth."""
        polynomials = sysid.Polynomials(self.A, self.B, self.C, np.ones(1), self.F)
        return sysid.innovations_form(polynomials, DT, self.variance)

    def draw(self, seed: int) -> sysid.IOData:
        """One noise realisation."""
        e = np.random.default_rng(seed).standard_normal(self.samples + BURN_IN) * np.sqrt(self.variance)
        y = self.noise_free + lfilter(self.C, self.A, e)
        return sysid.IOData(self.input[BURN_IN:], y[BURN_IN:], DT)

    def information(self) -> Array:
        """Fisher information of the parameters, averaged over five noise draws."""
        total = np.zeros((len(self.parameters),) * 2)
        nb, nc = len(self.B) - self.nk, len(self.C) - 1
        for seed in range(5):
            e = np.random.default_rng(90_000 + seed).standard_normal(self.samples + BURN_IN) * np.sqrt(self.variance)
            y, u = self.noise_free + lfilter(self.C, self.A, e), self.input

            def past(signal: Array, lag: int) -> Array:
                return np.concatenate((np.zeros(lag), signal[: len(signal) - lag]))

            if len(self.F) > 1:
                uf, wf = lfilter([1.0], self.F, u), lfilter([1.0], self.F, self.noise_free)
                rows = [past(uf, self.nk + k) for k in range(nb)] + [-past(wf, k) for k in range(1, len(self.F))]
            else:
                yf, uf, ef = (lfilter([1.0], self.C, x) for x in (y, u, e))
                rows = [-past(yf, k) for k in range(1, len(self.A))]
                rows += [past(uf, self.nk + k) for k in range(nb)] + [past(ef, k) for k in range(1, nc + 1)]
            psi = np.array(rows)[:, BURN_IN:]
            total += psi @ psi.T / self.variance / 5
        return total


def _problem(
    A: Array, B: Array, C: Array, F: Array, nk: int, samples: int, hold: int, variance: float | None
) -> Problem:
    """Noise 20 dB below the output where no variance is given."""
    b = np.concatenate((np.zeros(nk), B))
    parameters = np.concatenate((B, F[1:])) if len(F) > 1 else np.concatenate((A[1:], B, C[1:]))
    draft = Problem(A, b, C, F, nk, samples, hold, 1.0, parameters)
    if variance is None:
        pulse = np.zeros(5000)
        pulse[0] = 1.0
        gain = float(np.sum(lfilter(C, A, pulse) ** 2))
        variance = float(np.var(draft.noise_free[BURN_IN:])) / 100.0 / gain
    return Problem(A, b, C, F, nk, samples, hold, variance, parameters)


def make_p1() -> Problem:
    """The published yaw ARMAX model, badly conditioned."""
    c = np.poly([0.5, 0.3 + 0.4j, 0.3 - 0.4j, -0.2, 0.1]).real
    a = np.array([1, -2.542, 2.367, -0.8523, -0.08044, 0.1103])
    return _problem(a, np.array([0.003804, 0.003504, -0.004285]), c, np.ones(1), 2, 12_000, 5, None)


def make_p2() -> Problem:
    """The published shoulder-pitch OE model."""
    one = np.ones(1)
    return _problem(one, np.array([0.03459, 0.07584]), one, np.array([1, -0.9776, 0.07922]), 1, 12_000, 5, None)


def make_p3() -> Problem:
    """A second-order ARMAX textbook system."""
    c = np.array([1, -1.0, 0.2])
    return _problem(np.array([1, -1.5, 0.7]), np.array([1.0, 0.5]), c, np.ones(1), 1, 2000, 1, 1.0)


@pytest.fixture(scope="session")
def p1() -> Problem:
    """See `make_p1`."""
    return make_p1()


@pytest.fixture(scope="session")
def p2() -> Problem:
    """See `make_p2`."""
    return make_p2()


@pytest.fixture(scope="session")
def p3() -> Problem:
    """See `make_p3`."""
    return make_p3()


@dataclass(frozen=True, eq=False)
class Exact:
    """A random stable system and a noise-free record of it that begins in steady state."""

    A: Array
    B: Array
    data: sysid.IOData

    def response(self, f_hz: Array) -> NDArray[np.complex128]:
        """True frequency response (nf,)."""
        z = np.exp(-2j * np.pi * DT * np.asarray(f_hz))
        return np.polyval(self.B[::-1], z) / np.polyval(self.A[::-1], z)


@pytest.fixture(scope="session")
def exact_system() -> Callable[[int, int], Exact]:
    """Make a system of given order and delay."""

    def make(order: int, nk: int) -> Exact:
        rng = np.random.default_rng(10 * order + nk)
        poles: list[complex] = []
        while len(poles) < order:
            if order - len(poles) >= 2 and rng.random() < 0.5:
                pole = rng.uniform(0.3, 0.95) * np.exp(1j * rng.uniform(0.1, 2.5))
                poles += [pole, pole.conjugate()]
            else:
                poles.append(rng.uniform(-0.5, 0.95))
        a = np.atleast_1d(np.poly(poles).real)
        b = np.concatenate((np.zeros(nk), rng.standard_normal(order)))
        u = rng.standard_normal(1100)
        return Exact(a, b, sysid.IOData(u, lfilter(b, a, u), DT)[100:])

    return make
