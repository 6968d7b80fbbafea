"""Identifiability: poorly determined parameters, and cancellations that suggest a smaller model."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid.models.delta_method import spread
from sysid.models.estimate import Estimate, as_estimate
from sysid.polynomial.orders import Orders, make_orders
from sysid.records.arrays import ComplexArray, FloatArray, Locked
from sysid.records.errors import SysidError
from sysid.records.printing import Part, Table, number, numbers

POORLY_KNOWN = 1e3  # square root of the condition of the correlation matrix that is reported
TOGETHER = 2.0  # distance of a pole and a zero, in standard deviations, below which they may coincide


@dataclass(frozen=True)
class Cancellation:
    """A pole and a zero that the data cannot distinguish.

    Attributes:
        pole: Root of A or F in the z plane.
        zero: Root of B in the z plane.
        distance: Distance between them.
        deviation: Standard deviation of the distance.
        input: Index of the input.
    """

    pole: complex
    zero: complex
    distance: float
    deviation: float
    input: int


@dataclass(frozen=True, eq=False, repr=False)
class Identifiability(Locked):
    """Conditioning of an estimate.

    Attributes:
        names: One per parameter.
        relative_deviation: Standard deviation of each parameter over its magnitude (p,).
        condition: Ratio of the longest to the shortest axis of the confidence ellipsoid, parameters in units of their
            own deviations: 1 for independent ones, large if they are determined only jointly.
        weakest: Least determined direction, in those units, of unit length (p,).
        cancellations: Poles and zeros that cannot be distinguished.
        texts: Findings in words with numbers; empty if there is none.
    """

    names: tuple[str, ...]
    relative_deviation: FloatArray
    condition: float
    weakest: FloatArray
    cancellations: tuple[Cancellation, ...]
    texts: tuple[str, ...]

    def _parts(self) -> list[Part]:
        deviations, direction = numbers(self.relative_deviation), numbers(self.weakest)
        table = Table([("parameter", self.names), ("deviation / value", deviations), ("weakest direction", direction)])
        return [f"Condition of the parameters {self.condition:.4g}", table, *(self.texts or ("nothing to report",))]


def identifiability(estimate: Estimate) -> Identifiability:
    """Find parameters that the data hardly determine, from the covariance of an estimate [Ljung1999, sec. 16.4].

    Large deviations of single parameters with a small condition mean too little data; a large condition means that some
    combination of them is hardly excited, or superfluous. A pole and a zero within two standard deviations of each
    other suggest a model with one less of each.

    Args:
        estimate: Any estimate with a covariance; cancellations are those of polynomial models.

    Returns:
        Numbers and texts.

    Raises:
        SysidError: The estimate has no parameters, or its method gives no covariance.
    """
    estimate = as_estimate(estimate)
    covariance, theta = estimate.covariance, estimate.parameters
    if not len(theta) or not np.isfinite(covariance).all():
        raise SysidError(f"{estimate.method} gives no covariance of its parameters, which identifiability needs")
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    # the condition of the correlations, not of the covariance, which the units of the parameters change
    scale = np.where(deviation > 0.0, deviation, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    # rounding may make the smallest eigenvalue negative
    smallest = max(float(values[0]), 0.0)
    condition = float(np.sqrt(values[-1] / smallest)) if smallest > 0.0 else np.inf
    relative = deviation / np.maximum(np.abs(theta), np.finfo(float).tiny)
    cancellations = _cancellations(estimate)
    findings = [
        *_joint_findings(estimate, condition, vectors[:, -1]),
        *_deviation_findings(estimate, deviation, relative),
        *_cancellation_findings(cancellations),
    ]
    return Identifiability(
        names=estimate.parameter_names,
        relative_deviation=relative,
        condition=condition,
        weakest=vectors[:, -1],
        cancellations=cancellations,
        texts=tuple(findings),
    )


def _joint_findings(estimate: Estimate, condition: float, weakest: FloatArray) -> list[str]:
    """A text on parameters that are determined only jointly, naming the four that are most in the weakest direction."""
    if condition <= POORLY_KNOWN:
        return []
    main = np.argsort(-np.abs(weakest))[:4]
    names = ", ".join(estimate.parameter_names[k] for k in main)
    return [f"the parameters are determined only jointly: condition {condition:.3g}, mainly of {names}"]


def _deviation_findings(estimate: Estimate, deviation: FloatArray, relative: FloatArray) -> list[str]:
    """A text on parameters that may be zero as far as the data tell."""
    vague = int((relative > 1.0).sum())
    if not vague:
        return []
    theta, k = estimate.parameters, int(np.argmax(relative))
    return [
        f"{vague} of {len(theta)} parameters are smaller than their standard deviation, "
        f"{estimate.parameter_names[k]} = {theta[k]:.3g} +- {deviation[k]:.3g} the most"
    ]


def _cancellation_findings(cancellations: Sequence[Cancellation]) -> list[str]:
    """A text on each pole and zero that cannot be distinguished."""
    findings = []
    for c in cancellations:
        findings.append(
            f"the pole {number(c.pole)} and the zero {number(c.zero)} of input {c.input + 1} cannot be distinguished: "
            f"distance {c.distance:.3g}, standard deviation {c.deviation:.3g}; try orders smaller by one"
        )
    return findings


def _cancellations(estimate: Estimate) -> tuple[Cancellation, ...]:
    """Poles, each with its nearest zero, whose distance is within the uncertainty."""
    if estimate.polynomials is None:
        return ()
    orders = make_orders(estimate.polynomials.nu, **dict(estimate.orders))
    cancellations = []
    for j in range(len(orders.nb)):
        poles, zeros = _roots(orders, estimate.parameters, j)
        if not len(zeros):
            continue
        # of a complex pair the other one has the same distances
        for pole in poles[poles.imag >= 0.0]:
            zero = zeros[np.argmin(np.abs(zeros - pole))]
            cancellation = _cancellation(estimate, orders, j, complex(pole), complex(zero))
            if cancellation.distance < TOGETHER * cancellation.deviation:
                cancellations.append(cancellation)
    return tuple(cancellations)


def _cancellation(estimate: Estimate, orders: Orders, j: int, pole: complex, zero: complex) -> Cancellation:
    """Distance of a pole and a zero of input j, with its standard deviation by the delta method."""

    def gap(theta: FloatArray) -> FloatArray:
        poles, zeros = _roots(orders, theta, j)
        moved_pole = poles[np.argmin(np.abs(poles - pole))]
        moved_zero = zeros[np.argmin(np.abs(zeros - zero))]
        return np.array([(moved_pole - moved_zero).real, (moved_pole - moved_zero).imag])

    changes = spread(gap, estimate.parameters, estimate.covariance)
    difference = np.array([(pole - zero).real, (pole - zero).imag])
    distance = float(np.linalg.norm(difference))
    # a distance of zero has no direction: any will do
    along = difference / distance if distance > 0.0 else np.array([1.0, 0.0])
    deviation = float(np.sqrt(along @ (changes.T @ changes) @ along))
    return Cancellation(pole, zero, distance, deviation, j)


def _roots(orders: Orders, theta: FloatArray, j: int) -> tuple[ComplexArray, ComplexArray]:
    """Poles A F_j and zeros B_j."""
    a, b, _, _, f = orders.split(theta)
    poles = np.concatenate((np.roots(a), np.roots(f[j]))).astype(complex)
    return poles, np.roots(b[j][orders.nk[j] :]).astype(complex)
