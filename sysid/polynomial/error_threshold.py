"""Huber's loss: errors beyond a threshold count linearly instead of by their squares, so that outliers lose their pull.

The sum of rho(eps(t) / s) is minimised, rho(x) = x^2/2 up to the threshold k and k |x| - k^2/2 beyond
[Ljung1999, sec. 15.2; Huber1981, ch. 7]. A minimisation of squares with the weights min(1, k s / |eps|) at its start
never raises that sum, and has its gradient there: repeated until nothing moves, it ends at a minimum.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from sysid.polynomial.constraints import ConstrainedCriterion, Constraint
from sysid.polynomial.error_jacobian import ErrorJacobian, error_jacobian
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.least_squares import scaled_triangle
from sysid.polynomial.orders import Orders
from sysid.polynomial.outliers import NORMAL_MEDIAN
from sysid.polynomial.prediction_error import (
    Linearisation,
    Minimum,
    coloured_information,
    levenberg_marquardt,
    linearisation_of,
)
from sysid.polynomial.trends import trend_terms
from sysid.records.arguments import real_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError

ROUNDS = 100  # limit on the minimisations; ten suffice with a few per cent of outliers
SCALED = 20  # rounds after which the scale stays: a median that moves with the errors need not settle
SETTLED = 1e-10  # change of the errors by the last round, relative to their sum of squares


def checked_error_threshold(value: object) -> float:
    """The threshold in robust deviations, 0 for none.

    Raises:
        SysidError: Any other value.
    """
    return real_number("error_threshold", value, "be 0 (squares alone) or a number of deviations > 0", lambda k: k >= 0)


@dataclass(frozen=True, eq=False)
class WeightedErrors:
    """Records whose errors carry weights.

    Attributes:
        experiments: The records, missing outputs filled.
        orders: The structure.
        initial_conditions: Assumption about the time before each experiment, not backcasting.
        counted: Whether the error of each row counts (rows_i,) per experiment.
    """

    experiments: tuple[IOData, ...]
    orders: Orders
    initial_conditions: InitialConditions
    counted: tuple[NDArray[np.bool_], ...]

    @staticmethod
    def of(experiments: Sequence[IOData], orders: Orders, initial_conditions: InitialConditions) -> "WeightedErrors":
        """Records with errors of which those of missing outputs do not count.

        Raises:
            SysidError: Backcasting, or missing outputs beside C or D.
        """
        if initial_conditions is InitialConditions.BACKCAST and max(orders.nc, orders.nd):
            raise SysidError("error_threshold goes with initial_conditions 'estimated' or 'zero', got 'backcast'")
        if max(orders.nc, orders.nd) and not all(e.complete for e in experiments):
            raise SysidError(
                "error_threshold beside C or D needs complete outputs, got missing ones: expected 0, or "
                "data.complete_parts() as experiments"
            )
        filled, counted = [], []
        for experiment in experiments:
            known = experiment.known[:, 0]
            start = experiment.window
            if initial_conditions is not InitialConditions.ZERO:
                start = orders.first_error(experiment.window)
            usable = known.copy()
            for lag in range(1, orders.na + 1):
                usable[lag:] &= known[:-lag]
            filled.append(replace(experiment, y=np.where(known, experiment.y[:, 0], 0.0), missing=False))
            counted.append(usable[start:])
        return WeightedErrors(tuple(filled), orders, initial_conditions, tuple(counted))

    def linearise(self, theta: FloatArray, roots: Sequence[FloatArray]) -> Linearisation:
        """Weighted sum of squares and its first derivatives."""
        count = int(sum(map(np.count_nonzero, self.counted)))
        return replace(linearisation_of(self.jacobians(theta, roots), theta), errors=count)

    def minimum(
        self,
        theta: FloatArray,
        roots: Sequence[FloatArray],
        constraint: Constraint | None,
        max_iterations: int,
    ) -> tuple[Minimum, float]:
        """Minimum of the weighted sum of squares from parameters (p,), and the square of the errors' first change."""
        orders, longest = self.orders, max(map(len, self.experiments))
        energy = sum(float(np.sum(e.y**2)) for e in self.experiments)
        search = ConstrainedCriterion(orders, constraint, longest, partial(self.linearise, roots=roots))
        free = search.free(theta)
        at = search(free, free)
        if at is None:
            raise SysidError("error_threshold: the estimate by squares has C, D or F with a root on the unit circle")
        minimum = levenberg_marquardt(search, at, energy, outward=search.outward, max_iterations=max_iterations)
        moved = at.triangle @ (at.scale * (minimum.at.theta - free))
        full = replace(minimum, at=replace(minimum.at, theta=search.full(minimum.at.theta)))
        return full, float(moved @ moved)

    def jacobians(self, theta: FloatArray, roots: Sequence[FloatArray]) -> list[ErrorJacobian]:
        """Jacobian and errors of each experiment, rows times the square `roots` (rows_i,) of their weights."""
        pairs = zip(self.experiments, roots, strict=True)
        return [error_jacobian(e, self.orders, theta, self.initial_conditions, root) for e, root in pairs]


@dataclass(frozen=True, eq=False)
class HuberFit:
    """Minimum of Huber's loss.

    Attributes:
        theta: Parameters (p,).
        basis: Their change by each free parameter (p, q).
        tables: Jacobian and errors (rows, p + 1) per experiment; zero rows, with NaN as error, where none counts.
        scale: Robust standard deviation of the errors s.
        threshold: k.
        trends_of_outputs: Trend of the output (N_i,) of each experiment.
        transients: Number of initial conditions and trends.
        converged: Whether nothing moves any more.
        rounds: Weighted minimisations.
    """

    theta: FloatArray
    basis: FloatArray
    tables: tuple[FloatArray, ...]
    scale: float
    threshold: float
    trends_of_outputs: list[FloatArray]
    transients: int
    converged: bool
    rounds: int

    @property
    def limit(self) -> float:
        """Largest error that counts by its square; errors that are all zero have none."""
        return self.threshold * self.scale if self.scale else np.inf

    @property
    def beyond(self) -> int:
        """Number of errors beyond the threshold."""
        errors = np.concatenate([table[:, -1] for table in self.tables])
        return int(np.sum(np.abs(np.nan_to_num(errors)) > self.limit))

    @property
    def messages(self) -> list[str]:
        """Message on a search that did not settle."""
        return [] if self.converged else [f"error_threshold: the weights did not settle in {self.rounds} rounds"]

    @property
    def diagnostics(self) -> dict[str, object]:
        """What the estimate reports."""
        return {
            "error_threshold": self.threshold,
            "error_scale": self.scale,
            "errors_beyond_threshold": self.beyond,
            "converged": self.converged,
        }

    def covariance(self, colour_order: int) -> FloatArray:
        """Covariance (p, p) of independent errors of any symmetric distribution [Huber1981, sec. 7.6].

        K^2 sum(psi^2)/(n - p) / mean(psi')^2 (J' J)^-1 with psi(eps) = max(-k s, min(eps, k s)) and
        K = 1 + p/n (1 - mean(psi'))/mean(psi'). With a `colour_order` above 0, the correlation in time of psi is that
        of an autoregression up to this order, for errors that are independent of the input.
        """
        clipped = []
        for table in self.tables:
            psi = np.clip(table[:, -1], -self.limit, self.limit)
            clipped.append(np.column_stack((table[:, :-1], psi)))
        psi = np.concatenate([table[:, -1] for table in clipped])
        psi = psi[np.isfinite(psi)]
        q = self.basis.shape[1]
        count, unknown = len(psi), q + self.transients
        derivatives = np.vstack([table[:, :-1] @ self.basis for table in clipped])
        triangle, lengths = scaled_triangle(derivatives)
        half = self.basis @ (np.linalg.pinv(triangle) / lengths[:, None])
        middle = np.eye(q)
        # errors that are all zero have no colour
        if colour_order and psi.any():
            middle = coloured_information(clipped, colour_order, half)
        inside = max(1.0 - self.beyond / count, 1.0 / count)
        correction = 1.0 + unknown / count * (1.0 - inside) / inside
        factor = (correction / inside) ** 2 * float(psi @ psi) / (count - unknown)
        return factor * half @ middle @ half.T


def huber_fit(
    experiments: Sequence[IOData],
    orders: Orders,
    theta: FloatArray,
    threshold: float,
    initial_conditions: InitialConditions = InitialConditions.ESTIMATED,
    *,
    max_iterations: int = 100,
    constraint: Constraint | None = None,
) -> HuberFit:
    """Minimise Huber's loss from the parameters (p,) of least squares.

    The scale s is the median of |eps| over 0.6745, of the known errors, with the parameters counted.
    """
    weighted = WeightedErrors.of(experiments, orders, initial_conditions)
    roots = [mask.astype(float) for mask in weighted.counted]
    scale, converged, rounds = 0.0, False, 0
    while not converged and rounds < ROUNDS:
        rounds += 1
        errors = _errors(weighted.jacobians(theta, roots), roots)
        if rounds <= SCALED:
            scale = _scale(errors, orders.count if constraint is None else constraint.count)
        roots = _roots(errors, threshold * scale if scale else np.inf)
        minimum, change = weighted.minimum(theta, roots, constraint, max_iterations)
        converged = change <= SETTLED * minimum.at.cost
        theta = minimum.at.theta
    final = weighted.jacobians(theta, roots)
    trends = []
    for experiment, jacobian in zip(experiments, final, strict=True):
        trends.append(trend_terms(orders.trend, len(experiment)) @ jacobian.trend)
    return HuberFit(
        theta=theta,
        basis=np.eye(orders.count) if constraint is None else constraint.basis,
        tables=tuple(_unweighted(jacobian.columns, root) for jacobian, root in zip(final, roots, strict=True)),
        scale=scale,
        threshold=threshold,
        trends_of_outputs=trends,
        transients=minimum.at.transients,
        converged=converged,
        rounds=rounds,
    )


def _errors(jacobians: Sequence[ErrorJacobian], roots: Sequence[FloatArray]) -> list[FloatArray]:
    """Errors without weights (rows,) per experiment; NaN where none counts."""
    pairs = zip(jacobians, roots, strict=True)
    return [_unweighted(jacobian.columns[:, -1:], root)[:, 0] for jacobian, root in pairs]


def _unweighted(table: FloatArray, roots: FloatArray) -> FloatArray:
    """Rows [..., error] divided by their roots; where these are zero, zeros and NaN as the error."""
    counts = roots > 0.0
    plain = np.where(counts[:, None], table / np.where(counts, roots, 1.0)[:, None], 0.0)
    plain[~counts, -1] = np.nan
    return plain


def _scale(errors: Sequence[FloatArray], parameters: int) -> float:
    """Robust standard deviation of the errors, NaN where none counts."""
    known = np.concatenate(errors)
    known = np.abs(known[np.isfinite(known)])
    free = max(len(known) - parameters, 1)
    return float(np.median(known) / NORMAL_MEDIAN * np.sqrt(len(known) / free))


def _roots(errors: Sequence[FloatArray], limit: float) -> list[FloatArray]:
    """Square roots of the weights min(1, limit / |error|); zero where no error counts."""
    roots = []
    for of_record in errors:
        sizes = np.abs(np.nan_to_num(of_record))
        weights = np.where(sizes > limit, limit / np.where(sizes > limit, sizes, 1.0), 1.0)
        roots.append(np.where(np.isfinite(of_record), np.sqrt(weights), 0.0))
    return roots
