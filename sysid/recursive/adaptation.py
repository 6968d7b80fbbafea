"""How a recursive estimator weighs what is new against what it knows [Ljung1999, ch. 11]."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from sysid.records.arguments import real_number, shown, truth_value
from sysid.records.arrays import FloatArray, Locked, lock, real_array
from sysid.records.errors import SysidError

ROOT_FLOOR = 1e-12  # of a covariance that is given, as a part of its largest entry, variances in units of their own


@runtime_checkable
class Adaptation(Protocol):
    """A rule for the gain L(t) of theta(t) = theta(t-1) + L(t) eps(t); psi = -d eps / d theta.

    What a rule carries on, its memory, is P itself or a root of it.
    """

    @property
    def diffuse(self) -> float:
        """Initial variance of a parameter about which nothing is known, its regressor of unit mean square."""

    @property
    def forgets(self) -> bool:
        """Whether parameters go on moving for ever."""

    def enter(self, P: FloatArray) -> FloatArray:
        """Memory (p, p) of a P."""

    def leave(self, memory: FloatArray) -> FloatArray:
        """P (p, p) of a memory."""

    def prior(self, covariance: FloatArray, variance: float) -> FloatArray:
        """P (p, p) that stands for a covariance of the parameters (p, p), found at such a variance of errors."""

    def decay(self, steps: int) -> float:
        """By how much what was known counts less after `steps` steps."""

    def check(self, parameters: int) -> None:
        """Refuse settings that do not fit so many parameters."""

    def step(self, memory: FloatArray, psi: FloatArray, steps: int) -> tuple[FloatArray, FloatArray]:
        """Gain (p,) and the next memory (p, p), after `steps` steps."""

    def covariance(self, P: FloatArray, energy: float, variance: float, samples: int) -> FloatArray:
        """Covariance of the parameters (p, p), for mean square length `energy` of psi and error variance `variance`."""


@dataclass(frozen=True)
class Forgetting:
    """Least squares in which an error counts less with every sample that passes.

    P = (P - L psi' P) / lambda, L = P psi / (lambda + psi' P psi) [Ljung1999, sec. 11.2]. A square root of P is carried
    on [Bierman1977]: P stays symmetric and positive, and a large initial one costs no digits.

    Attributes:
        factor: Forgetting factor lambda, 0 < factor <= 1; memory is about 1 / (1 - factor) samples. At 1 nothing is
            forgotten and the estimate tends to that of the whole record.
        initial: Factor to begin with, if it is less. Where regressors depend on the parameters, what was learnt with
            the first, wild ones is so forgotten.
        settling: Part of the way from `initial` to `factor` that each sample leaves:
            lambda(t) = factor - (factor - initial) settling^t. The default is there after about a thousand samples.

    Raises:
        SysidError: A factor outside, or a settling not from 0 to below 1.
    """

    factor: float = 1.0
    initial: float = 1.0
    settling: float = 0.995

    def __post_init__(self) -> None:
        """Check."""
        bound = "lie above 0 and not above 1"
        for name, given in (("factor", "the forgetting factor"), ("initial", "the forgetting initial factor")):
            value = real_number(given, getattr(self, name), bound, lambda part: 0.0 < part <= 1.0)
            object.__setattr__(self, name, value)
        settling = real_number("settling", self.settling, "lie from 0 to below 1", lambda part: 0.0 <= part < 1.0)
        object.__setattr__(self, "settling", settling)

    @property
    def diffuse(self) -> float:
        """Large: roots have twice the digits."""
        return 1e12

    @property
    def forgets(self) -> bool:
        """Unless the factor is 1."""
        return self.factor < 1.0

    def enter(self, P: FloatArray) -> FloatArray:
        """A root Q of P = Q Q'."""
        scale = np.sqrt(np.maximum(np.diag(P), np.finfo(float).tiny))
        values, vectors = np.linalg.eigh(P / np.outer(scale, scale))
        root = vectors * np.sqrt(np.maximum(values, ROOT_FLOOR * max(float(values[-1]), 0.0)))
        return np.asarray(scale[:, None] * root)

    def leave(self, memory: FloatArray) -> FloatArray:
        """Q Q'."""
        return memory @ memory.T

    def prior(self, covariance: FloatArray, variance: float) -> FloatArray:
        """P is the covariance for errors of unit variance."""
        return covariance / variance

    def decay(self, steps: int) -> float:
        """The forgetting factor of the moment."""
        return self.factor - max(self.factor - self.initial, 0.0) * self.settling**steps

    def check(self, parameters: int) -> None:
        """Any number of parameters will do."""

    def step(self, memory: FloatArray, psi: FloatArray, steps: int) -> tuple[FloatArray, FloatArray]:
        """See `Adaptation`."""
        forgetting = self.decay(steps)
        seen = psi @ memory
        spread = memory @ seen
        length = float(forgetting + seen @ seen)
        shrink = 1.0 / (length + np.sqrt(forgetting * length))
        root = memory - np.outer(spread, shrink * seen)
        return spread / length, root if forgetting == 1.0 else root / np.sqrt(forgetting)

    def covariance(self, P: FloatArray, energy: float, variance: float, samples: int) -> FloatArray:
        """P times the variance, shrunk since errors are averaged with squared weights."""
        return variance * P * (1.0 + self.factor**samples) / (1.0 + self.factor)


@dataclass(frozen=True, eq=False, repr=False)
class Kalman(Locked):
    """Parameters that walk at random: theta(t+1) = theta(t) + w(t), cov w = R1, cov e = R2.

    P = P + R1 - L psi' P, L = P psi / (R2 + psi' P psi) [Ljung1999, sec. 11.2].

    Attributes:
        R1: Covariance of a parameter's step per sample: a number for all, one per parameter, or a matrix (p, p).
        R2: Variance of the innovation, in output units squared.

    Raises:
        SysidError: Negative R1, or R2 not above 0.
    """

    R1: ArrayLike
    R2: float = 1.0

    def __post_init__(self) -> None:
        """Check and lock."""
        walk = real_array("R1", self.R1)
        diagonal = np.diag(walk) if walk.ndim == 2 else walk
        matrix = walk.ndim == 2
        square = not matrix or (walk.shape[0] == walk.shape[1] and np.allclose(walk, walk.T, rtol=1e-9))
        if walk.ndim > 2 or not square or (diagonal < 0.0).any():
            raise SysidError(
                f"R1 must be a number, a row or a symmetric matrix without negative variances, got {shown(self.R1)}"
            )
        if matrix and walk.size and np.linalg.eigvalsh(walk)[0] < -1e-9 * np.abs(walk).max():
            raise SysidError(f"R1 must be a covariance, got one with eigenvalue {np.linalg.eigvalsh(walk)[0]:.3g}")
        variance = real_number("R2", self.R2, "be a positive variance", lambda size: 0.0 < size < np.inf)
        object.__setattr__(self, "R2", variance)
        object.__setattr__(self, "R1", lock(walk))

    @property
    def diffuse(self) -> float:
        """As large as differences of P allow."""
        return 1e6

    @property
    def forgets(self) -> bool:
        """Where anything walks."""
        return bool(np.any(self.R1))

    def enter(self, P: FloatArray) -> FloatArray:
        """P itself."""
        return P.copy()

    def leave(self, memory: FloatArray) -> FloatArray:
        """P itself."""
        return memory

    def prior(self, covariance: FloatArray, variance: float) -> FloatArray:
        """P is the covariance itself."""
        return covariance

    def decay(self, steps: int) -> float:
        """Errors are all averaged to find their variance."""
        return 1.0

    def check(self, parameters: int) -> None:
        """R1 must have one entry, or one per parameter.

        Raises:
            SysidError: It has another shape.
        """
        shape = np.shape(self.R1)
        if any(n != parameters for n in shape):
            raise SysidError(f"R1: expected a number, ({parameters},) or {(parameters,) * 2}, got shape {shape}")

    def step(self, memory: FloatArray, psi: FloatArray, steps: int) -> tuple[FloatArray, FloatArray]:
        """See `Adaptation`."""
        spread = memory @ psi
        length = self.R2 + psi @ spread
        gain = spread / length
        walk = np.asarray(self.R1)
        P = memory - np.outer(spread, spread) / length
        if walk.ndim == 2:
            return gain, P + walk
        P.flat[:: len(P) + 1] += walk
        return gain, P

    def covariance(self, P: FloatArray, energy: float, variance: float, samples: int) -> FloatArray:
        """P itself."""
        return P


@dataclass(frozen=True)
class Gradient:
    """Steps along the gradient: L = gain psi, or gain psi / (psi' psi) when normalised [Ljung1999, sec. 11.2].

    Attributes:
        gain: Step size. Normalised: of no unit, between 0 and 2. Else in one over the square of the signals' units.
        normalised: Whether the step is divided by the squared length of the regressor.

    Raises:
        SysidError: A gain that is not positive, or 2 and more when normalised.
    """

    gain: float
    normalised: bool = True

    def __post_init__(self) -> None:
        """Check."""
        normalised = truth_value("normalised", self.normalised)
        most, bound = (2.0, "be between 0 and 2") if normalised else (np.inf, "be positive")
        gain = real_number("the gain", self.gain, bound, lambda size: 0.0 < size < most)
        object.__setattr__(self, "gain", gain)

    @property
    def diffuse(self) -> float:
        """P is not used."""
        return 1e6

    @property
    def forgets(self) -> bool:
        """Steps do not shrink."""
        return True

    def enter(self, P: FloatArray) -> FloatArray:
        """P itself."""
        return P.copy()

    def leave(self, memory: FloatArray) -> FloatArray:
        """P itself."""
        return memory

    def prior(self, covariance: FloatArray, variance: float) -> FloatArray:
        """P is the covariance itself."""
        return covariance

    def decay(self, steps: int) -> float:
        """Errors are all averaged to find their variance."""
        return 1.0

    def check(self, parameters: int) -> None:
        """Any number of parameters will do."""

    def step(self, memory: FloatArray, psi: FloatArray, steps: int) -> tuple[FloatArray, FloatArray]:
        """See `Adaptation`; the memory is not used."""
        if not self.normalised:
            return self.gain * psi, memory
        length = float(psi @ psi)
        return (self.gain / length if length > 0.0 else 0.0) * psi, memory

    def covariance(self, P: FloatArray, energy: float, variance: float, samples: int) -> FloatArray:
        """What small steps settle to: half the gain times the variance of the errors."""
        gain = self.gain / energy if self.normalised and energy > 0.0 else self.gain
        return 0.5 * gain * variance * np.eye(len(P))
