"""How a recursive estimator weighs what is new against what it knows [Ljung1999, ch. 11]."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from sysid.arrays import FloatArray, lock, real_array
from sysid.errors import SysidError

SETTLING = 0.995  # of the way to the lasting factor that is left with every sample


class Adaptation(Protocol):
    """A rule for the gain L(t) of theta(t) = theta(t-1) + L(t) eps(t); P is its matrix, psi = -d eps / d theta."""

    def decay(self, steps: int) -> float:
        """By how much what was known counts less after `steps` steps."""

    def check(self, parameters: int) -> None:
        """Refuse settings that do not fit so many parameters."""

    def step(self, P: FloatArray, psi: FloatArray, steps: int) -> tuple[FloatArray, FloatArray]:
        """Gain (p,) and the next P (p, p), after `steps` steps."""

    def covariance(self, P: FloatArray, energy: float, variance: float, samples: int) -> FloatArray:
        """Covariance of the parameters (p, p), for mean square length `energy` of psi and error variance `variance`."""


@dataclass(frozen=True)
class Forgetting:
    """Least squares in which an error counts less with every sample that passes.

    P = (P - L psi' P) / lambda, L = P psi / (lambda + psi' P psi) [Ljung1999, sec. 11.2].

    Attributes:
        factor: Forgetting factor lambda, 0 < factor <= 1; memory is about 1 / (1 - factor) samples. At 1 nothing is
            forgotten and the estimate tends to that of the whole record.
        initial: Factor to begin with, if it is less; it rises to `factor` over about a thousand samples. Where
            regressors depend on the parameters, what was learnt with the first, wild ones is so forgotten.

    Raises:
        SysidError: A factor outside.
    """

    factor: float = 1.0
    initial: float = 1.0

    def __post_init__(self) -> None:
        """Check."""
        for name, value in (("factor", self.factor), ("initial factor", self.initial)):
            if not 0.0 < value <= 1.0:
                raise SysidError(f"the forgetting {name} must lie above 0 and not above 1, got {value!r}")

    def decay(self, steps: int) -> float:
        """The forgetting factor of the moment."""
        return self.factor - max(self.factor - self.initial, 0.0) * SETTLING**steps

    def check(self, parameters: int) -> None:
        """Any number of parameters will do."""

    def step(self, P: FloatArray, psi: FloatArray, steps: int) -> tuple[FloatArray, FloatArray]:
        """See `Adaptation`."""
        forgetting = self.decay(steps)
        spread = P @ psi
        length = forgetting + psi @ spread
        # the order of the products keeps P symmetric to the last bit; what is not grows
        return spread / length, (P - np.outer(spread, spread) / length) / forgetting

    def covariance(self, P: FloatArray, energy: float, variance: float, samples: int) -> FloatArray:
        """P times the variance, shrunk since errors are averaged with squared weights."""
        return variance * P * (1.0 + self.factor**samples) / (1.0 + self.factor)


@dataclass(frozen=True, eq=False)
class Kalman:
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
        if walk.ndim > 2 or (diagonal < 0.0).any():
            raise SysidError(
                f"R1 must be a number, a row or a square matrix without negative variances, got {self.R1!r}"
            )
        if not (np.isfinite(self.R2) and self.R2 > 0.0):
            raise SysidError(f"R2 must be a positive variance, got {self.R2!r}")
        object.__setattr__(self, "R1", lock(walk))

    def decay(self, steps: int) -> float:
        """Errors are all averaged to find their variance."""
        return 1.0

    def check(self, parameters: int) -> None:
        """R1 must have one entry, or one per parameter."""
        shape = np.shape(self.R1)
        if any(n != parameters for n in shape):
            raise SysidError(f"R1: expected a number, ({parameters},) or {(parameters,) * 2}, got shape {shape}")

    def step(self, P: FloatArray, psi: FloatArray, steps: int) -> tuple[FloatArray, FloatArray]:
        """See `Adaptation`."""
        spread = P @ psi
        length = self.R2 + psi @ spread
        gain = spread / length
        walk = np.asarray(self.R1)
        P = P - np.outer(spread, spread) / length
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
        if not (np.isfinite(self.gain) and self.gain > 0.0) or (self.normalised and self.gain >= 2.0):
            bound = "between 0 and 2" if self.normalised else "positive"
            raise SysidError(f"the gain must be {bound}, got {self.gain!r}")

    def decay(self, steps: int) -> float:
        """Errors are all averaged to find their variance."""
        return 1.0

    def check(self, parameters: int) -> None:
        """Any number of parameters will do."""

    def step(self, P: FloatArray, psi: FloatArray, steps: int) -> tuple[FloatArray, FloatArray]:
        """See `Adaptation`; P is not used."""
        if not self.normalised:
            return self.gain * psi, P
        length = float(psi @ psi)
        return (self.gain / length if length > 0.0 else 0.0) * psi, P

    def covariance(self, P: FloatArray, energy: float, variance: float, samples: int) -> FloatArray:
        """What small steps settle to: half the gain times the variance of the errors."""
        gain = self.gain / energy if self.normalised and energy > 0.0 else self.gain
        return 0.5 * gain * variance * np.eye(len(P))
