"""Prediction-error fit of `pem_ss`: errors on records, also with missing outputs, and their normal equations."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sysid.models.delta_method import STEP, standard_directions
from sysid.models.recursion import free_response
from sysid.polynomial.missing_outputs import MissingOutputs
from sysid.records.arrays import FloatArray
from sysid.subspace.predictor import Predictor, Record, initial_spread
from sysid.subspace.predictor_sensitivities import prediction_jacobian

NEGLIGIBLE = 1e-12  # tail of a response, relative to its first sample
ROUNDS = 4  # iterations of the error covariance where its converged value is needed


@dataclass(frozen=True, eq=False)
class Eliminated:
    """One record with its missing outputs and its initial state eliminated.

    Attributes:
        missing: The missing outputs, errors in units of `root`.
        filled: The record with the missing outputs at their conditional means.
        state: Initial state (n,).
        white: Errors times `root` (N, ny).
        root: W = root root', the inverse of the errors' covariance (ny, ny).
        cost: Sum of squares of `white` plus the prior cost of the initial state.
    """

    missing: MissingOutputs
    filled: Record
    state: FloatArray
    white: FloatArray
    root: FloatArray
    cost: float

    @property
    def errors(self) -> FloatArray:
        """One-step prediction errors (N, ny), those of missing outputs at their conditional means."""
        return np.asarray(np.linalg.solve(self.root.T, self.white.T).T, dtype=np.float64)

    def expected_products(self) -> FloatArray:
        """Conditional expectation of sum e e' given the known outputs (ny, ny)."""
        ny = len(self.root)
        rows, columns = np.tril_indices(ny)
        # a change of every entry of the symmetric W, lower triangle row by row
        changes = np.zeros((len(rows), ny, ny))
        for change, i, j in zip(changes, rows, columns, strict=True):
            change[i, j] += 0.5
            change[j, i] += 0.5
        # this uncertainty is the derivative of the log determinant with respect to W
        slopes = self.missing.slope(0.5 * np.einsum("pre,lec->plrc", changes, self.missing.response))
        uncertainty = np.zeros((ny, ny))
        uncertainty[rows, columns] = slopes
        uncertainty[columns, rows] = slopes
        into = np.linalg.inv(self.root)
        return into.T @ (self.white.T @ self.white + uncertainty) @ into


def greatest_likelihood(
    records: Sequence[Record], predictor: Predictor, weight: FloatArray, rounds: int = 1
) -> tuple[tuple[Eliminated, ...], FloatArray, float]:
    """Likelihood of the known outputs, the error covariance iterated from the inverse of `weight`.

    Elimination per experiment, covariance of the errors (ny, ny), and -2 log likelihood per sample without constants.
    """
    covariance = np.asarray(np.linalg.inv(weight), dtype=np.float64)
    samples, ny = sum(len(r.y) for r in records), len(weight)
    eliminated = [eliminate(record, predictor, covariance) for record in records]
    # with one output the covariance is a scale, which follows below
    for _ in range(rounds if ny > 1 else 0):
        covariance = np.asarray(sum(e.expected_products() for e in eliminated) / samples)
        eliminated = [eliminate(record, predictor, covariance) for record in records]
    observed = samples * ny - sum(e.missing.count for e in eliminated)
    scale = max(sum(e.cost for e in eliminated) / observed, np.finfo(float).tiny)
    determinant = sum(e.missing.log_determinant for e in eliminated)
    criterion = float(np.linalg.slogdet(covariance)[1]) + (determinant + observed * np.log(scale)) / samples
    return tuple(eliminated), scale * covariance, float(criterion)


def gapped_normal(
    predictor: Predictor,
    eliminated: Sequence[Eliminated],
    states: Sequence[FloatArray],
    covariance: FloatArray,
    basis: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Information (q, q) and descent direction (q,) in the directions of `basis`; see `predictor_fit.linearise`."""
    root = np.linalg.cholesky(np.linalg.inv(covariance))
    q = basis.shape[1]
    information, gradient = np.zeros((q, q)), np.zeros(q)
    for record, x0 in zip(eliminated, states, strict=True):
        gaps, e = record.missing, record.errors
        jacobian = prediction_jacobian(predictor, record.filled, x0, basis)
        columns = np.einsum("tlc,lr->trc", jacobian, root)
        columns = gaps.eliminated(columns).reshape(-1, q + len(x0))
        prior = initial_spread(free_response(predictor.A, predictor.C, len(e)))
        full = columns.T @ columns
        slope = columns.T @ (e @ root).ravel()
        added_information, added_gradient = without_initial_state(full, slope, x0, prior)
        information += added_information
        gradient += added_gradient
        if len(gaps.response) > 1 and gaps.count:
            # the log determinant of the missing outputs' covariance depends on the predictor too
            derivatives = _response_derivatives(predictor, basis, len(gaps.response))
            gradient -= 0.5 * gaps.slope(np.einsum("re,plec->plrc", gaps.response[0], derivatives))
    return 0.5 * (information + information.T), gradient


def without_initial_state(
    full: FloatArray, slope: FloatArray, x0: FloatArray, prior: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Information (q, q) and gradient (q,) after elimination of the initial state, whose columns are the last n.

    By the Schur complement of N = [N11, N21'; N21, N22 + S^-2], S = diag(prior) the prior deviation of the state:
    N11 - N21' (N22 + S^-2)^-1 N21 [GolubPereyra2003]. The inverse is S (S N22 S + I)^-1 S, regular for any N22.
    """
    q = len(slope) - len(x0)
    corner, side = full[q:, q:], full[q:, :q]
    inverse = np.outer(prior, prior) * np.linalg.inv(corner * np.outer(prior, prior) + np.eye(len(prior)))
    slope[q:] -= x0 / prior**2
    return full[:q, :q] - side.T @ inverse @ side, slope[:q] - side.T @ inverse @ slope[q:]


def gapped_covariance(
    records: Sequence[Record], predictor: Predictor, weight: FloatArray, information: FloatArray, basis: FloatArray
) -> FloatArray:
    """Inverse of the observed information (q, q); that of `information` if the curvature is that of no maximum."""
    covariance = np.asarray(np.linalg.pinv(information, hermitian=True), dtype=np.float64)
    directions = standard_directions(covariance)

    def gradient(at: Predictor) -> FloatArray:
        eliminated, errors, _ = greatest_likelihood(records, at, weight, ROUNDS)
        return gapped_normal(at, eliminated, [e.state for e in eliminated], errors, basis)[1]

    at_predictor = gradient(predictor)
    rows = []
    for step in STEP * directions.T:
        moved = predictor.moved(basis @ step)
        if not moved.is_stable():
            return covariance
        rows.append(directions.T @ (at_predictor - gradient(moved)) / STEP)
    curvature = 0.5 * (np.array(rows) + np.array(rows).T)
    # in standard deviations of the expected information the curvature is about one
    if not len(curvature) or np.linalg.eigvalsh(curvature)[0] < 0.01:
        return covariance
    return np.asarray(directions @ np.linalg.inv(curvature) @ directions.T, dtype=np.float64)


def eliminate(record: Record, predictor: Predictor, covariance: FloatArray) -> Eliminated:
    """Eliminate missing outputs and the initial state of one record, for errors of a given covariance."""
    n, (steps, ny) = len(predictor.A), record.y.shape
    observed = np.ones((steps, ny), dtype=bool) if record.known is None else record.known
    root = np.linalg.cholesky(np.linalg.inv(covariance))
    missing = MissingOutputs.of(observed, root.T @ _response(predictor, steps))
    errors = record.y - predictor.predict(record.w, record.u, np.zeros(n))
    free = free_response(predictor.A, predictor.C, steps)
    prior = initial_spread(free)
    # in its prior deviations the initial state has unit covariance
    columns = np.zeros((steps, ny, n + 1))
    columns[: len(free), :, :n] = free * prior
    columns[:, :, n] = errors
    remainder = missing.eliminated(np.einsum("tlc,lr->trc", columns, root)).reshape(-1, n + 1)
    # n more rows are the prior of the initial state, in its deviations
    phi = np.vstack((remainder[:, :n], np.eye(n)))
    target = np.concatenate((remainder[:, n], np.zeros(n)))
    relative = np.linalg.lstsq(phi, target, rcond=None)[0]
    white = remainder[:, n] - remainder[:, :n] @ relative
    errors[: len(free)] -= free @ (prior * relative)
    y = record.y.copy()
    y[~observed] = -missing.best((errors @ root)[:, :, None])[:, 0]
    w = record.w if not predictor.has_gain else np.hstack((record.u, y))
    filled = replace(record, y=y, w=w, transforms={}, known=None)
    cost = float(white @ white + relative @ relative)
    return Eliminated(missing, filled, prior * relative, white.reshape(steps, ny), root, cost)


def _response(predictor: Predictor, steps: int) -> FloatArray:
    """Errors after a pulse in each output until they have died out (L, ny, ny)."""
    ny, nu = predictor.D.shape
    direct = np.eye(ny)[None]
    if not predictor.has_gain:
        return direct
    tail = -free_response(predictor.A, predictor.C, steps - 1) @ predictor.M[:, nu:]
    alive = np.flatnonzero(np.abs(tail).max(axis=(1, 2), initial=0.0) > NEGLIGIBLE)
    length = alive[-1] + 1 if len(alive) else 0
    return np.concatenate((direct, tail[:length]))


def _response_derivatives(predictor: Predictor, basis: FloatArray, lags: int) -> FloatArray:
    """Derivatives of `_response` along directions (q, lags, ny, ny)."""
    A, C = predictor.A, predictor.C
    ny, nu = predictor.D.shape
    sizes = np.cumsum([m.size for m in (A, predictor.M, C)])
    by_a, by_m, by_c, _ = np.split(basis.T, sizes, axis=1)
    dA, dC = by_a.reshape(-1, *A.shape), by_c.reshape(-1, *C.shape)
    x, dx = predictor.M[:, nu:], by_m.reshape(-1, *predictor.M.shape)[:, :, nu:]
    out = np.zeros((len(dA), lags, ny, ny))
    for lag in range(1, lags):
        out[:, lag] = -(dC @ x + C @ dx)
        x, dx = A @ x, A @ dx + dA @ x
    return out


WEIGHT_FLOOR = 1e-10  # of the error covariance, relative to its mean diagonal


@dataclass(frozen=True, eq=False)
class Point:
    """A predictor with its initial states, errors and criterion.

    Attributes:
        predictor: The predictor.
        states: Initial state per experiment (n,).
        errors: Per experiment (N, ny).
        covariance: Mean of e e' over all samples (ny, ny).
        criterion: Logarithm of its determinant, or ny times that of the mean of e' W e with a weight W of the outputs,
            plus the prior cost of the initial states.
        gaps: Elimination of the missing outputs per experiment; empty if there are none.
        spreads: Prior deviation of the initial state of each experiment (n,); empty with missing outputs.
        output_weight: W of the records (ny, ny); None for the inverse of the covariance.
    """

    predictor: Predictor
    states: list[FloatArray]
    errors: list[FloatArray]
    covariance: FloatArray
    criterion: float
    gaps: tuple[Eliminated, ...] = ()
    spreads: tuple[FloatArray, ...] = ()
    output_weight: FloatArray | None = None

    @staticmethod
    def at(
        records: Sequence[Record], predictor: Predictor, weight: FloatArray, spreads: Sequence[FloatArray] = ()
    ) -> "Point":
        """Evaluate with the best initial states for errors of covariance W^-1.

        Nearly unobservable initial states are regularised by a prior deviation of PRIOR times that of the state in
        balanced coordinates, which hardly matters without noise. The prior (`spreads`) must stay the same within a
        step, or the criterion does not follow its gradient.
        """
        if any(record.known is not None for record in records):
            eliminated, covariance, criterion = greatest_likelihood(records, predictor, weight)
            initial, errors = [e.state for e in eliminated], [e.errors for e in eliminated]
            return Point(predictor, initial, errors, covariance, criterion, eliminated)
        root = np.asarray(np.linalg.cholesky(weight), dtype=np.float64)
        states: list[FloatArray] = []
        errors = []
        priors: list[FloatArray] = []
        prior_cost = 0.0
        for i, record in enumerate(records):
            e = record.y - predictor.predict(record.w, record.u, np.zeros(len(predictor.A)))
            free = free_response(predictor.A, predictor.C, len(e))
            prior = spreads[i] if spreads else initial_spread(free)
            relative = _relative_initial_state(free, e, root, prior)
            states.append(prior * relative)
            e[: len(free)] -= free @ states[-1]
            errors.append(e)
            priors.append(prior)
            prior_cost += float(relative @ relative)
        samples = sum(len(e) for e in errors)
        covariance = np.asarray(sum(e.T @ e for e in errors) / samples)
        output_weight = records[0].output_weight
        if output_weight is None:
            criterion = float(np.linalg.slogdet(floored(covariance))[1])
        else:
            mean_square = max(_mean_square(covariance, output_weight), np.finfo(float).tiny)
            criterion = len(covariance) * float(np.log(mean_square))
        criterion += prior_cost / samples
        return Point(
            predictor, states, errors, covariance, criterion, spreads=tuple(priors), output_weight=output_weight
        )

    def balanced(self) -> "Point":
        """The point in balanced coordinates, in which all entries have about equal effect."""
        into, back = self.predictor.balancing()
        p = self.predictor
        balanced = Predictor(into @ p.A @ back, into @ p.M, p.C @ back, p.D)
        states = [into @ x for x in self.states]
        if self.gaps:
            return replace(self, predictor=balanced, states=states)
        spreads = tuple(initial_spread(free_response(balanced.A, balanced.C, len(e))) for e in self.errors)
        # the prior of the new coordinates gives the same states another cost
        increase = _prior_cost(states, spreads) - _prior_cost(self.states, self.spreads)
        criterion = self.criterion + increase / sum(len(e) for e in self.errors)
        return replace(self, predictor=balanced, states=states, criterion=criterion, spreads=spreads)

    @property
    def mean_square(self) -> float:
        """Mean of e' W e, of e' e without a weight of the outputs."""
        return _mean_square(self.covariance, self.output_weight)

    @property
    def inverse_covariance(self) -> FloatArray:
        """Inverse of the errors' covariance (ny, ny)."""
        return np.asarray(np.linalg.inv(floored(self.covariance)), dtype=np.float64)

    @property
    def weight(self) -> FloatArray:
        """Weight (ny, ny) of the errors e, scaled so that the mean of e' weight e is ny."""
        if self.output_weight is None:
            return self.inverse_covariance
        return self.output_weight * (len(self.covariance) / max(self.mean_square, np.finfo(float).tiny))


def _relative_initial_state(free: FloatArray, e: FloatArray, root: FloatArray, prior: FloatArray) -> FloatArray:
    """Initial state in its prior deviations (n,) that fits errors e (N, ny) best, weighted by `root` root'."""
    n = len(prior)
    # n more rows are the prior of the initial state
    columns = np.vstack((np.einsum("tln,lr->trn", free, root).reshape(-1, n) * prior, np.eye(n)))
    target = np.concatenate(((e[: len(free)] @ root).ravel(), np.zeros(n)))
    return np.asarray(np.linalg.lstsq(columns, target, rcond=None)[0])


def _mean_square(covariance: FloatArray, weight: FloatArray | None) -> float:
    """Mean of e' W e from the covariance of e; of e' e without W."""
    return float(np.trace(covariance)) if weight is None else float(np.sum(weight * covariance))


def _prior_cost(states: Sequence[FloatArray], spreads: Sequence[FloatArray]) -> float:
    """Sum of squares of all initial states in their prior deviations."""
    return sum(float(np.sum((x / spread) ** 2)) for x, spread in zip(states, spreads, strict=True))


def floored(covariance: FloatArray) -> FloatArray:
    """Covariance with a floor on its diagonal, so that an output without errors leaves it regular."""
    mean = float(np.trace(covariance)) / len(covariance)
    return covariance + max(WEIGHT_FLOOR * mean, np.finfo(float).tiny) * np.eye(len(covariance))
