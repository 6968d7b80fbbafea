"""Confidence bands of quantities computed from an estimate: step responses, gains, poles, zeros."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.models.delta_method import spread, standard_directions
from sysid.models.estimate import Estimate, as_estimate
from sysid.models.frequency_response import NORMAL_95
from sysid.models.state_space import StateSpace
from sysid.records.arguments import function, shown, whole_number
from sysid.records.arrays import ComplexArray, FloatArray, Locked, rectangular
from sysid.records.errors import SysidError

CHI_SQUARE_95 = 5.991464547107979  # two degrees of freedom
Quantity = Callable[[StateSpace], FloatArray]


@dataclass(frozen=True, eq=False, repr=False)
class Band(Locked):
    """A quantity with its standard deviation and 95 % interval, entry by entry.

    Attributes:
        value: The quantity of the estimate.
        deviation: Standard deviation; NaN where the parameters' covariance is not known.
        ci95: Lower and upper end of the 95 % interval.
    """

    value: FloatArray
    deviation: FloatArray
    ci95: tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False, repr=False)
class RootBand(Locked):
    """Poles or zeros with their uncertainty.

    Attributes:
        roots: Roots of the estimate, largest modulus first (n,).
        covariance: Of (real part, imaginary part) of each (n, 2, 2); NaN where small changes of the parameters change
            the number of roots, or where the parameters' covariance is not known.
    """

    roots: ComplexArray
    covariance: FloatArray

    def modulus_deviation(self) -> FloatArray:
        """Standard deviation of the modulus, to first order (n,)."""
        # to first order the modulus changes by the part of the change along the root
        angle = np.angle(self.roots)
        along = np.stack((np.cos(angle), np.sin(angle)), axis=-1)
        return np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", along, self.covariance, along), 0.0))

    def ellipses(self, points: int = 60) -> ComplexArray:
        """Outline of the 95 % region of each root; a line for a real one (n, points)."""
        angle = np.linspace(0.0, 2.0 * np.pi, points)
        circle = np.sqrt(CHI_SQUARE_95) * np.stack((np.cos(angle), np.sin(angle)))
        out = np.full((len(self.roots), points), complex(np.nan, np.nan))
        for k in np.flatnonzero(np.isfinite(self.covariance).all(axis=(1, 2))):
            # a root of the covariance maps the circle onto the ellipse, or onto a line where it is singular
            outline = standard_directions(self.covariance[k]) @ circle
            out[k] = self.roots[k] + outline[0] + 1j * outline[1]
        return out


OF_MODEL = "from a model to real numbers, such as StateSpace.dc_gain"


def band(estimate: Estimate, quantity: Quantity) -> Band:
    """95 % confidence band of any quantity of a model, by the delta method (not its bandwidth, `Estimate.bandwidth`).

    It is the interval of [Ljung1999, ch. 9], valid where the quantity is about linear over the spread of the
    parameters; `sampled_band` is the check.

    Args:
        estimate: Any parametric estimate.
        quantity: From a model to a real array of any shape: `StateSpace.dc_gain`, or for instance
            `lambda model: model.step_response(100)`.

    Returns:
        The quantity, its standard deviation and its interval.

    Raises:
        SysidError: A complex quantity.
    """
    estimate, quantity = as_estimate(estimate), function("quantity", quantity, OF_MODEL)
    value = _real(quantity(estimate.model))
    moves = spread(lambda theta: quantity(estimate.realise(theta)), estimate.parameters, estimate.covariance)
    return normal_band(value, moves)


def normal_band(value: FloatArray, moves: FloatArray) -> Band:
    """Band of a quantity from its changes per standard direction, the first axis."""
    deviation = np.sqrt(np.sum(moves**2, axis=0))
    return Band(value, deviation, (value - NORMAL_95 * deviation, value + NORMAL_95 * deviation))


def sampled_band(estimate: Estimate, quantity: Quantity, rng: np.random.Generator, *, draws: int = 500) -> Band:
    """95 % interval of a quantity from models whose parameters are drawn from their distribution.

    Args:
        estimate: Any parametric estimate with a covariance.
        quantity: From a model to a real array of any shape.
        rng: Source of the draws.
        draws: Number of models.

    Returns:
        Standard deviation and 2.5 and 97.5 percentiles of the draws.

    Raises:
        SysidError: Fewer than two draws, an estimate without covariance, or a complex quantity.
    """
    estimate, quantity = as_estimate(estimate), function("quantity", quantity, OF_MODEL)
    value = _real(quantity(estimate.model))
    values = np.array([quantity(model) for model in sample_models(estimate, rng, draws=draws)], dtype=float)
    # a draw may be unstable and its response overflow: the percentiles then end at infinity, as they should
    with np.errstate(over="ignore", invalid="ignore"):
        low, high = np.percentile(values, [2.5, 97.5], axis=0)
        return Band(value, values.std(axis=0, ddof=1), (low, high))


def _real(value: FloatArray) -> FloatArray:
    """Check that the quantity is real: an interval needs an order."""
    out = rectangular("quantity", value)
    if np.iscomplexobj(out):
        raise SysidError(
            "the quantity is complex: expected real numbers, such as its modulus; poles_band and zeros_band give "
            "regions of poles and zeros, estimate.frequency_response that of the response"
        )
    try:
        return np.asarray(out, dtype=float)
    except (TypeError, ValueError) as error:
        raise SysidError(f"quantity must give real numbers for a model, got {shown(value)}") from error


def sample_models(estimate: Estimate, rng: np.random.Generator, *, draws: int = 500) -> list[StateSpace]:
    """Models with parameters drawn from the normal distribution of an estimate; near instability some are unstable.

    Raises:
        SysidError: Fewer than two draws, or an estimate without covariance.
    """
    estimate, draws = as_estimate(estimate), whole_number("draws", draws, 2)
    if not isinstance(rng, np.random.Generator):
        raise SysidError(f"rng must be a NumPy generator, such as np.random.default_rng(0), got {shown(rng)}")
    if not np.isfinite(estimate.covariance).all():
        raise SysidError(f"{estimate.method} gives no covariance of its parameters to draw from; refine it by pem_ss")
    # not Cholesky's: the covariance may be singular
    root = standard_directions(estimate.covariance)
    steps = rng.standard_normal((draws, root.shape[1])) @ root.T
    return [estimate.realise(estimate.parameters + step) for step in steps]


def poles_band(estimate: Estimate) -> RootBand:
    """Poles of the path from input to output with their covariances, by the delta method [Ljung1999, ch. 9].

    Coincident poles have no covariance to first order.

    Args:
        estimate: Any parametric estimate.

    Returns:
        The poles, largest modulus first.
    """
    return _roots_band(estimate, lambda model: model.input_path().poles())


def zeros_band(estimate: Estimate) -> RootBand:
    """Transmission zeros with their covariances, by the delta method [Ljung1999, ch. 9].

    Args:
        estimate: Any parametric estimate.

    Returns:
        The zeros of the path from input to output, largest modulus first.
    """
    return _roots_band(estimate, lambda model: model.input_path().zeros())


def _roots_band(estimate: Estimate, roots_of: Callable[[StateSpace], ComplexArray]) -> RootBand:
    """Roots of an estimate with their covariances by the delta method."""
    estimate = as_estimate(estimate)
    nominal = roots_of(estimate.model)

    def coordinates(theta: FloatArray) -> FloatArray:
        matched = matched_roots(roots_of(estimate.realise(theta)), nominal)
        return np.stack((matched.real, matched.imag), axis=-1)

    moves = spread(coordinates, estimate.parameters, estimate.covariance)
    return RootBand(nominal, np.einsum("kni,knj->nij", moves, moves))


def matched_roots(roots: ComplexArray, nominal: ComplexArray) -> ComplexArray:
    """`roots` in the sequence of the `nominal` ones that they are nearest to; NaN where their number differs."""
    if len(roots) != len(nominal):
        return np.full(len(nominal), complex(np.nan, np.nan))
    # least total distance: each by itself, two roots might take the same nearest one
    _, sequence = scipy.optimize.linear_sum_assignment(np.abs(nominal[:, None] - roots))
    return roots[sequence]
