"""Prediction-error fit of `pem_ss`: Gauss-Newton steps at a cost that hardly depends on the length of the record.

Every derivative of the prediction is a fixed filter of w and of the initial state, with the poles of the predictor,
each at most twice. In an orthonormal basis of such filters, the Gauss-Newton normal equations consist of moments of the
basis outputs, which follow exactly from the correlations of w; these are computed once. Only the errors are computed
sample by sample: their accuracy is that of the fit. Poles that no record of this length tells from the unit circle are
the exception: infinite sums lose all digits there, and derivatives are computed sample by sample too. Poles at the
stability limit are constraints of every step.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.polynomial.correlation import autoregression
from sysid.polynomial.stability_limit import STABILITY_MARGIN, constrained_step, noise_margin
from sysid.records.arrays import FloatArray
from sysid.subspace.input_regression import regression_on_inputs
from sysid.subspace.observer_gain import spectral_radius
from sysid.subspace.predictor import Predictor, Record
from sysid.subspace.predictor_errors import Point, gapped_normal, without_initial_state
from sysid.subspace.predictor_sensitivities import Sensitivities, prediction_jacobian

RESOLVED = 10.0  # distance of a pole from the unit circle, in 1 / (length of the record): infinite sums keep the digits


def pulled_in(predictor: Predictor, limit: float, beyond: float | None = None) -> Predictor:
    """Move poles of modulus beyond a bound, by default the limit, onto the limit, along their radius."""
    bound = limit if beyond is None else beyond
    poles, vectors = np.linalg.eig(predictor.A)
    modulus = np.abs(poles)
    if modulus.max(initial=0.0) <= bound:
        return predictor
    shrinkage = np.where(modulus > bound, limit / np.maximum(modulus, bound), 1.0)
    moved = poles * shrinkage
    expected = float(np.abs(moved).max())
    try:
        A = (vectors * moved @ np.linalg.inv(vectors)).real
    except np.linalg.LinAlgError:
        A = predictor.A
    radius = np.abs(np.linalg.eigvals(A)).max() if np.isfinite(A).all() else np.inf
    # nearly dependent eigenvectors: scale all poles together
    if not radius < expected + 0.1 * (1.0 - expected):
        A = predictor.A * (limit / modulus.max())
    return Predictor(A, predictor.M, predictor.C, predictor.D)


def outward(predictor: Predictor, basis: FloatArray, limit: float) -> FloatArray:
    """Derivatives of the moduli of the poles at the limit (poles, q), one row for a conjugate pair."""
    n = len(predictor.A)
    poles, right = np.linalg.eig(predictor.A)
    at = np.flatnonzero((1.0 - np.abs(poles) < 2.0 * (1.0 - limit)) & (poles.imag >= 0.0))
    if not len(at):
        return np.zeros((0, basis.shape[1]))
    try:
        left = np.linalg.inv(right)
    except np.linalg.LinAlgError:
        return np.zeros((0, basis.shape[1]))
    changes = basis[: n * n].T.reshape(-1, n, n)
    # the derivative of an eigenvalue is v' dA w, with left and right eigenvectors v and w; that of its modulus is the
    # part along the eigenvalue
    slopes = np.einsum("pi,qij,jp->pq", left[at], changes, right[:, at])
    along = poles[at].conj() / np.abs(poles[at])
    return np.asarray((slopes * along[:, None]).real, dtype=np.float64)


CONVERGED = 1e-8  # remaining decrease, relative to the sum of squares
SETTLED = 1e-4  # the same in N dV / V: a hundredth of a standard deviation
ROUNDING = 1e-29  # mean square of the errors, relative to that of the output, that is rounding alone
EXACT = "errors at rounding level"  # the reason to stop there
REPAIRS = 6  # limit on the steps towards an exact fit
Directions = Callable[[Predictor], FloatArray]


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations in some directions, initial states eliminated.

    Attributes:
        information: J' W J (q, q).
        gradient: -J' W e, the right-hand side (q,).
        basis: The directions: entries of A, M, C, D per coordinate (all, q).
    """

    information: FloatArray
    gradient: FloatArray
    basis: FloatArray


@dataclass(frozen=True, eq=False)
class Minimum:
    """Minimum of the criterion that a search reached, or the point where it gave up.

    Attributes:
        point: Predictor, states, errors.
        normal: Normal equations at the point.
        iterations: Accepted steps.
        evaluations: Evaluations of the criterion.
        converged: Whether the remaining decrease is negligible, or the errors are at rounding level.
        reason: Reason for stopping.
    """

    point: Point
    normal: Normal
    iterations: int
    evaluations: int
    converged: bool
    reason: str

    @property
    def exact(self) -> bool:
        """Whether only rounding is left of the errors."""
        return self.reason == EXACT


def minimise(records: Sequence[Record], start: Predictor, directions: Directions, max_iterations: int) -> Minimum:
    """Levenberg-Marquardt on `Point.criterion`; the predictor stays stable [Ljung1999, ch. 7]."""
    power = float(np.mean([np.mean(r.y**2) for r in records]))
    samples = sum(len(r.y) for r in records)
    longest = max(len(r.y) for r in records)
    margin = noise_margin(longest) if start.has_gain else STABILITY_MARGIN
    limit = 1.0 - margin
    point = Point.at(records, start.balanced(), np.eye(start.C.shape[0]))
    # relative to an information matrix of unit diagonal
    damping = 1e-6
    iterations, evaluations = 0, 1
    while True:
        normal = linearise(records, point, directions(point.predictor))
        if point.mean_square <= ROUNDING * power:
            return Minimum(point, normal, iterations, evaluations, True, EXACT)
        if not normal.information.any():
            why = "the predictor is too near the edge of stability for the arithmetic"
            return Minimum(point, normal, iterations, evaluations, False, why)
        equations = ScaledEquations.of(normal, point.predictor, limit)
        decrease = equations.predicted_decrease() / (samples * len(point.covariance))
        if decrease <= max(CONVERGED, SETTLED / (samples * len(point.covariance))):
            where = " at the edge of stability" if len(equations.bounds) else ""
            return Minimum(point, normal, iterations, evaluations, True, f"no decrease left{where}")
        if iterations >= max_iterations:
            why = f"stopped after {iterations} iterations, one more predicts N dV/V = {decrease * samples:.2g}"
            return Minimum(point, normal, iterations, evaluations, False, why)
        accepted: Point | None = None
        while accepted is None and damping < 1e8:
            step = equations.step(damping)
            moved = point.predictor.moved_in_innovations_form(normal.basis @ equations.in_coordinates(step))
            if np.isfinite(moved.A).all():
                trial = Point.at(records, pulled_in(moved, limit), point.weight, point.spreads)
                evaluations += 1
                accepted = trial if trial.criterion < point.criterion else None
            if accepted is None:
                damping = max(damping * 10.0, 1e-8)
        if accepted is None:
            # nearly at the minimum or at rounding level no step can show a decrease
            flat = decrease <= 1e-4 or point.mean_square <= 1e-16 * power
            why = f"no step decreases the errors further; predicted is N dV/V = {decrease * samples:.2g}"
            return Minimum(point, normal, iterations, evaluations, flat, why)
        predicted = float(2.0 * equations.gradient @ step - step**2 @ equations.values) / samples
        achieved = point.criterion - accepted.criterion
        # the damping follows the ratio of achieved and predicted decrease [NocedalWright2006, ch. 4]
        if achieved > 0.75 * predicted:
            damping = damping / 30.0
        if achieved < 0.25 * predicted:
            damping = max(damping * 4.0, 1e-8)
        point = accepted.balanced()
        iterations += 1


@dataclass(frozen=True, eq=False)
class ScaledEquations:
    """Normal equations in the eigenvectors of the information matrix, scaled to unit diagonal.

    Attributes:
        values: Eigenvalues (q,), one for directions in which the data say nothing.
        vectors: Eigenvectors (q, q).
        scale: Lengths of the Jacobian columns (q,).
        gradient: Right-hand side (q,), zero in directions in which the data say nothing.
        bounds: Derivatives of the moduli of the poles at the stability limit (poles, q), which no step may increase.
    """

    values: FloatArray
    vectors: FloatArray
    scale: FloatArray
    gradient: FloatArray
    bounds: FloatArray

    @staticmethod
    def of(normal: Normal, predictor: Predictor, limit: float) -> "ScaledEquations":
        """Scale normal equations to unit diagonal and transform them to the eigenvectors of their matrix."""
        scale = column_scale(normal.information)
        values, vectors = np.linalg.eigh(normal.information / np.outer(scale, scale))
        # beyond this ratio an eigenvalue is rounding
        kept = values > 1e-14 * values[-1]
        gradient = np.where(kept, vectors.T @ (normal.gradient / scale), 0.0)
        bounds = np.where(kept, outward(predictor, normal.basis, limit) / scale @ vectors, 0.0)
        return ScaledEquations(np.where(kept, values, 1.0), vectors, scale, gradient, bounds)

    def step(self, damping: float) -> FloatArray:
        """Levenberg-Marquardt step in the eigenvectors (q,) that takes no pole beyond the limit."""
        return constrained_step(self.values + damping, self.gradient, self.bounds)

    def in_coordinates(self, step: FloatArray) -> FloatArray:
        """The step in the directions of the normal equations (q,)."""
        return self.vectors @ step / self.scale

    def predicted_decrease(self) -> float:
        """Decrease of the weighted sum of squares by a full step, to second order."""
        return float(self.gradient @ constrained_step(self.values, self.gradient, self.bounds))


def least_squares_fit(records: Sequence[Record], start: Predictor, directions: Directions) -> Predictor:
    """Solve for the entries in which the prediction is linear, by a single Gauss-Newton step.

    Further steps repair rounding and the first weights if the errors are so small that these matter.
    """
    if not directions(start).shape[1]:
        return start
    into, back = start.balancing()
    balanced = Predictor(into @ start.A @ back, into @ start.M, start.C @ back, start.D)
    fitted: Predictor | None = None
    complete = all(record.known is None and record.output_weight is None for record in records)
    if complete and not start.has_gain and not _is_slow(records, start):
        fitted = regression_on_inputs(records, balanced, directions(balanced))
    if fitted is None:
        fitted = _refined_fit(records, balanced, directions)
    # M of the fit is in balanced coordinates, A and C of the start are not
    return Predictor(start.A, back @ fitted.M, start.C, fitted.D)


def _is_slow(records: Sequence[Record], predictor: Predictor) -> bool:
    """Whether a pole is too near the unit circle for the longest record."""
    return spectral_radius(predictor.A) > 1.0 - RESOLVED / max(len(r.y) for r in records)


def _refined_fit(records: Sequence[Record], start: Predictor, directions: Directions) -> Predictor:
    """`least_squares_fit` from a balanced start by errors computed sample by sample, and in balanced coordinates."""
    point = Point.at(records, start, np.eye(start.C.shape[0]))
    power = float(np.mean([np.mean(r.y**2) for r in records]))
    for _ in range(REPAIRS):
        normal = linearise(records, point, directions(point.predictor))
        scale = column_scale(normal.information)
        relative = normal.information / np.outer(scale, scale)
        step = np.linalg.lstsq(relative, normal.gradient / scale, rcond=1e-13)[0] / scale
        update = Point.at(records, point.predictor.moved(normal.basis @ step), point.weight, point.spreads)
        if not update.criterion < point.criterion:
            break
        point = update
        # errors of a hundredth of the output or more: neither rounding nor the first weights matter
        if point.mean_square > 1e-4 * power:
            break
    return point.predictor


def linearise(records: Sequence[Record], point: Point, basis: FloatArray) -> Normal:
    """Normal equations in the directions of `basis`, each experiment's initial state eliminated [GolubPereyra2003]."""
    if point.gaps:
        return Normal(*gapped_normal(point.predictor, point.gaps, point.states, point.covariance, basis), basis)
    weight = point.weight
    root = np.linalg.cholesky(weight)
    q = basis.shape[1]
    information, gradient = np.zeros((q, q)), np.zeros(q)
    slow = _is_slow(records, point.predictor)
    if not slow:
        by_dynamics = bool(basis[: point.predictor.A.size].any())
        sensitivities = Sensitivities.of(point.predictor, by_dynamics)
        sums = sensitivities.moments if by_dynamics else sensitivities.filtered_moments
    # sums of squares that overflow are refused below
    with np.errstate(over="ignore", invalid="ignore"):
        for record, x0, e, prior in zip(records, point.states, point.errors, point.spreads, strict=True):
            if slow:
                jacobian = prediction_jacobian(point.predictor, record, x0, basis)
                flat = np.einsum("tlc,lr->trc", jacobian, root).reshape(-1, q + len(x0))
                full, slope = flat.T @ flat, flat.T @ (e @ root).ravel()
            else:
                table = sensitivities.table(x0, basis)
                moments, products = sums(record, e)
                weighted = np.einsum("lr,lac->rac", root, table)
                flat = weighted.reshape(-1, table.shape[2])
                full = flat.T @ np.matmul(moments, weighted).reshape(flat.shape)
                slope = np.einsum("lac,al->c", table, products @ weight)
            added_information, added_gradient = without_initial_state(full, slope, x0, prior)
            information += added_information
            gradient += added_gradient
    if not 0.0 < np.diag(information).max(initial=0.0) < np.inf:
        # at the edge of stability rounding may hide how the errors depend on the parameters
        return Normal(np.zeros((q, q)), np.zeros(q), basis)
    return Normal(0.5 * (information + information.T), gradient, basis)


def gradient_covariance(records: Sequence[Record], point: Point, basis: FloatArray, order: int) -> FloatArray:
    """J' W R W J (q, q) with the covariance R of errors that are white (`order` 0), or coloured but free of the input.

    The root of their inverse covariance makes the errors uncorrelated; each component is then modelled by an
    autoregression, by which J is filtered [Ljung1999, ch. 9]. Correlation between components at lags other than zero is
    ignored.
    """
    root, whitening = np.linalg.cholesky(point.weight), np.linalg.cholesky(point.inverse_covariance)
    mixture = root.T @ np.linalg.inv(whitening).T
    whiteners, variances = [], []
    for component in (np.concatenate(point.errors) @ whitening).T:
        whitener = autoregression(component, order)[0]
        whiteners.append(whitener)
        variances.append(float(np.mean(scipy.signal.lfilter(whitener, [1.0], component) ** 2)))
    q = basis.shape[1]
    total = np.zeros((q, q))
    for record, x0, prior in zip(records, point.states, point.spreads, strict=True):
        jacobian = prediction_jacobian(point.predictor, record, x0, basis)
        columns = _without_initial_columns(np.einsum("tlc,lr->rtc", jacobian, root), prior)
        components = np.tensordot(mixture.T, columns, 1)
        for component, whitener, variance in zip(components, whiteners, variances, strict=True):
            filtered = scipy.signal.lfilter([1.0], whitener, component, axis=0)
            total += variance * (filtered.T @ filtered)
    return total


def _without_initial_columns(columns: FloatArray, prior: FloatArray) -> list[FloatArray]:
    """Jacobian of each output (N, q) with what the last n columns, those of the initial state, explain removed."""
    q = columns.shape[2] - len(prior)
    corner = sum(output[:, q:].T @ output[:, q:] for output in columns) + np.diag(prior**-2.0)
    side = sum(output[:, q:].T @ output[:, :q] for output in columns)
    onto = np.linalg.solve(corner, side)
    return [output[:, :q] - output[:, q:] @ onto for output in columns]


def column_scale(information: FloatArray) -> FloatArray:
    """Lengths of the Jacobian columns of an information matrix (q,), bounded below to stay regular."""
    squares = np.diag(information)
    floor = max(1e-20 * float(squares.max(initial=0.0)), np.finfo(float).tiny)
    return np.sqrt(np.maximum(squares, floor))
