"""Adaptation rules of recursive estimators: the weight of new samples against old ones [Ljung1999, ch. 11]."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from sysid.models.state_space import is_covariance
from sysid.records.arguments import real_number, shown, truth_value
from sysid.records.arrays import FloatArray, Locked, lock, real_array
from sysid.records.errors import SysidError

ROOT_FLOOR = 1e-12  # smallest eigenvalue of a given P, relative to its largest, variances scaled to one


class Adaptation(ABC):
    """A rule for the gain L(t) of theta(t) = theta(t-1) + L(t) eps(t); psi = -d eps / d theta.

    The memory of a rule, which it updates at every step, is P or a square root of P.

    Attributes:
        diffuse: Initial variance of an unknown parameter whose regressor has unit mean square, as large as the
            cancellation in the update of P allows.
    """

    diffuse: ClassVar[float] = 1e6

    @property
    @abstractmethod
    def forgets(self) -> bool:
        """Whether the parameters never stop moving."""

    def enter(self, P: FloatArray) -> FloatArray:
        """Memory of the rule (p, p) that stands for a matrix P."""
        return P.copy()

    def leave(self, memory: FloatArray) -> FloatArray:
        """Matrix P (p, p) that a memory of the rule stands for."""
        return memory

    def prior(self, covariance: FloatArray, variance: float) -> FloatArray:
        """P (p, p) for a covariance of the parameters (p, p) that was estimated with this variance of the errors."""
        return covariance

    def decay(self, steps: int) -> float:
        """Factor on the weight of earlier errors after `steps` steps."""
        return 1.0

    def check(self, parameters: int) -> None:  # noqa: B027, most rules have no settings to check
        """Refuse settings that do not fit this number of parameters."""

    @abstractmethod
    def step(self, memory: FloatArray, psi: FloatArray, steps: int) -> tuple[FloatArray, FloatArray]:
        """Gain (p,) and the next memory (p, p), after `steps` steps."""

    @abstractmethod
    def covariance(self, P: FloatArray, energy: float, variance: float, samples: int) -> FloatArray:
        """Covariance of the parameters (p, p), for mean square length `energy` of psi and error variance `variance`."""


@dataclass(frozen=True)
class Forgetting(Adaptation):
    """Least squares with exponential forgetting.

    P = (P - L psi' P) / lambda, L = P psi / (lambda + psi' P psi) [Ljung1999, sec. 11.2]. A square root of P is
    updated [Bierman1977]: P stays symmetric and positive, and a large initial P costs no digits.

    Attributes:
        factor: Forgetting factor lambda, 0 < factor <= 1; memory is about 1 / (1 - factor) samples. At 1 nothing is
            forgotten and the estimate tends to that of the whole record.
        initial: Initial factor, if it is smaller. It forgets the first samples, whose regressors depend on parameters
            far from the final ones.
        settling: Rate of the approach, lambda(t) = factor - (factor - initial) settling^t. The default takes about a
            thousand samples.

    Raises:
        SysidError: A factor or a settling out of range.
    """

    factor: float = 1.0
    initial: float = 1.0
    settling: float = 0.995
    diffuse: ClassVar[float] = 1e12  # a square root keeps twice the digits

    def __post_init__(self) -> None:
        """Check."""
        bound = "lie above 0 and not above 1"
        for name, label in (("factor", "the forgetting factor"), ("initial", "the forgetting initial factor")):
            value = real_number(label, getattr(self, name), bound, lambda factor: 0.0 < factor <= 1.0)
            object.__setattr__(self, name, value)
        settling = real_number("settling", self.settling, "lie from 0 to below 1", lambda rate: 0.0 <= rate < 1.0)
        object.__setattr__(self, "settling", settling)

    @property
    def forgets(self) -> bool:
        """True unless the factor is 1."""
        return self.factor < 1.0

    def enter(self, P: FloatArray) -> FloatArray:
        """Square root Q of P = Q Q'."""
        # with variances scaled to one, the floor on eigenvalues is the same for parameters of any unit
        scale = np.sqrt(np.maximum(np.diag(P), np.finfo(float).tiny))
        values, vectors = np.linalg.eigh(P / np.outer(scale, scale))
        root = vectors * np.sqrt(np.maximum(values, ROOT_FLOOR * max(float(values[-1]), 0.0)))
        return np.asarray(scale[:, None] * root)

    def leave(self, memory: FloatArray) -> FloatArray:
        """Q Q'."""
        return memory @ memory.T

    def prior(self, covariance: FloatArray, variance: float) -> FloatArray:
        """The covariance of the parameters, scaled to errors of unit variance."""
        return covariance / variance

    def decay(self, steps: int) -> float:
        """The present forgetting factor."""
        return self.factor - max(self.factor - self.initial, 0.0) * self.settling**steps

    def step(self, memory: FloatArray, psi: FloatArray, steps: int) -> tuple[FloatArray, FloatArray]:
        """See `Adaptation`.

        With f = Q' psi and alpha = lambda + f' f, the next root is (Q - Q f f' / (alpha + sqrt(lambda alpha))) /
        sqrt(lambda), whose square is the P of the class [Bierman1977].
        """
        forgetting = self.decay(steps)
        projected = psi @ memory
        spread = memory @ projected
        length = float(forgetting + projected @ projected)
        shrink = 1.0 / (length + np.sqrt(forgetting * length))
        root = memory - np.outer(spread, shrink * projected)
        # a division by 1 would cost as much as any other
        if forgetting != 1.0:
            root = root / np.sqrt(forgetting)
        return spread / length, root

    def covariance(self, P: FloatArray, energy: float, variance: float, samples: int) -> FloatArray:
        """P times the variance, reduced since the sum of squared weights is less than their sum."""
        return variance * P * (1.0 + self.factor**samples) / (1.0 + self.factor)


@dataclass(frozen=True)
class DirectionalForgetting(Forgetting):
    """Least squares that forgets only in the direction of the present regressor [CaoSchwartz2000].

    The information R = P^-1 loses the part that the sample psi renews, and gains the sample:
    R = R - (1 - lambda) R psi psi' R / (psi' R psi) + psi psi'. Directions without excitation keep what is known of
    them, so that P cannot wind up [KulhavyKarny1984; Bittanti1990]. Memory, of excitation, and attributes are those of
    `Forgetting`.
    """

    diffuse: ClassVar[float] = 1e6

    def enter(self, P: FloatArray) -> FloatArray:
        """P and its inverse (2, p, p)."""
        return np.stack((P, np.linalg.pinv(P, rcond=ROOT_FLOOR, hermitian=True)))

    def leave(self, memory: FloatArray) -> FloatArray:
        """P, the first matrix of the memory."""
        return memory[0]

    def step(self, memory: FloatArray, psi: FloatArray, steps: int) -> tuple[FloatArray, FloatArray]:
        """See `Adaptation`.

        Before the sample, the loss makes P grow by (1 - lambda) / (lambda psi' R psi) psi psi'; the gain is that of
        least squares with this P. P and R are updated side by side: an inversion at every sample costs more.
        """
        P, R = memory
        information, spread, square = R @ psi, P @ psi, psi[:, None] * psi
        length, forgetting = float(psi @ information), self.decay(steps)
        loss = growth = 0.0
        if length > 0.0 and forgetting < 1.0:
            loss, growth = (1.0 - forgetting) / length, (1.0 - forgetting) / (forgetting * length)
            spread = spread + growth * float(psi @ psi) * psi
        gain = spread / (1.0 + float(psi @ spread))
        out = np.empty_like(memory)
        out[0] = P + growth * square - gain[:, None] * spread
        out[1] = R + square - loss * (information[:, None] * information)
        return gain, out


@dataclass(frozen=True, eq=False, repr=False)
class Kalman(Locked, Adaptation):
    """Random-walk parameters: theta(t+1) = theta(t) + w(t), cov w = R1, cov e = R2.

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
        if walk.ndim == 2 and len(walk) == walk.shape[1]:
            valid = is_covariance(walk)
        else:
            valid = walk.ndim < 2 and bool((walk >= 0.0).all())
        if not valid:
            raise SysidError(
                f"R1 must be a number, a row or a covariance matrix, without negative variances, got {shown(self.R1)}"
            )
        variance = real_number("R2", self.R2, "be a positive variance", lambda size: 0.0 < size < np.inf)
        object.__setattr__(self, "R2", variance)
        object.__setattr__(self, "R1", lock(walk))

    @property
    def forgets(self) -> bool:
        """True if any parameter has a random walk."""
        return bool(np.any(self.R1))

    def check(self, parameters: int) -> None:
        """Check the shape of R1.

        Raises:
            SysidError: R1 is not a number, (p,) or (p, p).
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
        # variances alone: add them to the diagonal, without a matrix of zeros
        P.flat[:: len(P) + 1] += walk
        return gain, P

    def covariance(self, P: FloatArray, energy: float, variance: float, samples: int) -> FloatArray:
        """P itself, which is the covariance."""
        return P


@dataclass(frozen=True)
class Gradient(Adaptation):
    """Steps along the gradient: L = gain psi, or gain psi / (psi' psi) when normalised [Ljung1999, sec. 11.2].

    Attributes:
        gain: Step size. Normalised: without unit, between 0 and 2. Otherwise in 1 / (unit of the signals)^2.
        normalised: Whether the step is divided by the squared length of the regressor.

    Raises:
        SysidError: A gain that is not positive, or a normalised one of 2 or more.
    """

    gain: float
    normalised: bool = True

    def __post_init__(self) -> None:
        """Check."""
        normalised = truth_value("normalised", self.normalised)
        # a normalised step of 2 mirrors the error, a longer one lets it grow
        limit, bound = (2.0, "be between 0 and 2") if normalised else (np.inf, "be positive")
        gain = real_number("the gain", self.gain, bound, lambda size: 0.0 < size < limit)
        object.__setattr__(self, "gain", gain)

    @property
    def forgets(self) -> bool:
        """Always True: the steps do not shrink."""
        return True

    def step(self, memory: FloatArray, psi: FloatArray, steps: int) -> tuple[FloatArray, FloatArray]:
        """See `Adaptation`; the memory is unused."""
        if not self.normalised:
            return self.gain * psi, memory
        length = float(psi @ psi)
        normalised_gain = self.gain / length if length > 0.0 else 0.0
        return normalised_gain * psi, memory

    def covariance(self, P: FloatArray, energy: float, variance: float, samples: int) -> FloatArray:
        """Stationary covariance for small steps: half the gain times the variance of the errors."""
        gain = self.gain / energy if self.normalised and energy > 0.0 else self.gain
        return 0.5 * gain * variance * np.eye(len(P))
