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
        """Errors (N, ny)."""
        return np.asarray(np.linalg.solve(self.root.T, self.white.T).T, dtype=np.float64)

    def expected_products(self) -> FloatArray:
        """Conditional expectation of sum e e' given the known outputs (ny, ny)."""
        ny = len(self.root)
        pairs = [(i, j) for i in range(ny) for j in range(i + 1)]
        moves = np.zeros((len(pairs), ny, ny))
        for move, (i, j) in zip(moves, pairs, strict=True):
            move[i, j] += 0.5
            move[j, i] += 0.5
        # this uncertainty is the derivative of the log determinant with respect to W
        slopes = self.missing.slope(0.5 * np.einsum("pre,lec->plrc", moves, self.missing.response))
        unknown = np.zeros((ny, ny))
        for (i, j), value in zip(pairs, slopes, strict=True):
            unknown[i, j] = unknown[j, i] = value
        into = np.linalg.inv(self.root)
        return into.T @ (self.white.T @ self.white + unknown) @ into


def greatest_likelihood(
    records: Sequence[Record], predictor: Predictor, weight: FloatArray, rounds: int = 1
) -> tuple[tuple[Eliminated, ...], FloatArray, float]:
    """Likelihood of the known outputs, the error covariance iterated from the inverse of `weight`.

    Elimination per experiment, covariance of the errors (ny, ny), and -2 log likelihood per sample without constants.
    """
    covariance = np.asarray(np.linalg.inv(weight), dtype=np.float64)
    samples, ny = sum(len(r.y) for r in records), len(weight)
    parts = [eliminate(record, predictor, covariance) for record in records]
    for _ in range(rounds if ny > 1 else 0):
        covariance = np.asarray(sum(part.expected_products() for part in parts) / samples)
        parts = [eliminate(record, predictor, covariance) for record in records]
    observed = samples * ny - sum(part.missing.count for part in parts)
    scale = max(sum(part.cost for part in parts) / observed, np.finfo(float).tiny)
    determinant = sum(part.missing.log_determinant for part in parts)
    criterion = float(np.linalg.slogdet(covariance)[1]) + (determinant + observed * np.log(scale)) / samples
    return tuple(parts), scale * covariance, float(criterion)


def gapped_normal(
    predictor: Predictor,
    parts: Sequence[Eliminated],
    states: Sequence[FloatArray],
    covariance: FloatArray,
    basis: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Information (q, q) and descent direction (q,) in the directions of `basis`; see `predictor_fit.linearise`."""
    root = np.linalg.cholesky(np.linalg.inv(covariance))
    q = basis.shape[1]
    information, gradient = np.zeros((q, q)), np.zeros(q)
    for part, x0 in zip(parts, states, strict=True):
        gaps, e = part.missing, part.errors
        columns = np.einsum("tlc,lr->trc", prediction_jacobian(predictor, part.filled, x0, basis), root)
        columns = gaps.eliminated(columns).reshape(-1, q + len(x0))
        prior = initial_spread(free_response(predictor.A, predictor.C, len(e)))
        full = columns.T @ columns
        slope = columns.T @ (e @ root).ravel()
        corner, side = full[q:, q:], full[q:, :q]
        inverse = np.outer(prior, prior) * np.linalg.inv(corner * np.outer(prior, prior) + np.eye(len(prior)))
        slope[q:] -= x0 / prior**2
        information += full[:q, :q] - side.T @ inverse @ side
        gradient += slope[:q] - side.T @ inverse @ slope[q:]
        if len(gaps.response) > 1 and gaps.count:
            derivatives = _response_derivatives(predictor, basis, len(gaps.response))
            gradient -= 0.5 * gaps.slope(np.einsum("re,plec->plrc", gaps.response[0], derivatives))
    return 0.5 * (information + information.T), gradient


def gapped_covariance(
    records: Sequence[Record], predictor: Predictor, weight: FloatArray, information: FloatArray, basis: FloatArray
) -> FloatArray:
    """Inverse of the observed information (q, q); that of `information` if the curvature is that of no maximum."""
    covariance = np.asarray(np.linalg.pinv(information, hermitian=True), dtype=np.float64)
    directions = standard_directions(covariance)

    def gradient(at: Predictor) -> FloatArray:
        parts, errors, _ = greatest_likelihood(records, at, weight, ROUNDS)
        return gapped_normal(at, parts, [part.state for part in parts], errors, basis)[1]

    here, gradients = gradient(predictor), []
    for step in STEP * directions.T:
        moved = predictor.moved(basis @ step)
        if not moved.is_stable():
            return covariance
        gradients.append(directions.T @ (here - gradient(moved)) / STEP)
    curvature = 0.5 * (np.array(gradients) + np.array(gradients).T)
    if not len(curvature) or np.linalg.eigvalsh(curvature)[0] < 0.01:
        return covariance
    return np.asarray(directions @ np.linalg.inv(curvature) @ directions.T, dtype=np.float64)


def eliminate(record: Record, predictor: Predictor, covariance: FloatArray) -> Eliminated:
    """Eliminate missing outputs and the initial state of one record, for errors of a given covariance."""
    n, (steps, ny) = len(predictor.A), record.y.shape
    known = np.ones((steps, ny), dtype=bool) if record.known is None else record.known
    root = np.linalg.cholesky(np.linalg.inv(covariance))
    missing = MissingOutputs.of(known, root.T @ _response(predictor, steps))
    errors = record.y - predictor.predict(record.w, record.u, np.zeros(n))
    free = free_response(predictor.A, predictor.C, steps)
    prior = initial_spread(free)
    columns = np.zeros((steps, ny, n + 1))
    columns[: len(free), :, :n] = free * prior
    columns[:, :, n] = errors
    remainder = missing.eliminated(np.einsum("tlc,lr->trc", columns, root)).reshape(-1, n + 1)
    phi = np.vstack((remainder[:, :n], np.eye(n)))
    relative = np.linalg.lstsq(phi, np.concatenate((remainder[:, n], np.zeros(n))), rcond=None)[0]
    white = remainder[:, n] - remainder[:, :n] @ relative
    errors[: len(free)] -= free @ (prior * relative)
    y = record.y.copy()
    y[~known] = -missing.best((errors @ root)[:, :, None])[:, 0]
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
    return np.concatenate((direct, tail[: alive[-1] + 1 if len(alive) else 0]))


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
            parts, covariance, criterion = greatest_likelihood(records, predictor, weight)
            initial, errors = [part.state for part in parts], [part.errors for part in parts]
            return Point(predictor, initial, errors, covariance, criterion, parts)
        root = np.linalg.cholesky(weight)
        n = len(predictor.A)
        states: list[FloatArray] = []
        errors = []
        priors: list[FloatArray] = []
        size = 0.0
        for i, record in enumerate(records):
            e = record.y - predictor.predict(record.w, record.u, np.zeros(n))
            free = free_response(predictor.A, predictor.C, len(e))
            prior = spreads[i] if spreads else initial_spread(free)
            columns = np.vstack((np.einsum("tln,lr->trn", free, root).reshape(-1, n) * prior, np.eye(n)))
            target = np.concatenate(((e[: len(free)] @ root).ravel(), np.zeros(n)))
            relative = np.linalg.lstsq(columns, target, rcond=None)[0]
            states.append(prior * relative)
            e[: len(free)] -= free @ states[-1]
            errors.append(e)
            priors.append(prior)
            size += float(relative @ relative)
        samples = sum(len(e) for e in errors)
        covariance = np.asarray(sum(e.T @ e for e in errors) / samples)
        chosen = records[0].output_weight
        if chosen is None:
            criterion = float(np.linalg.slogdet(_floored(covariance))[1])
        else:
            criterion = len(covariance) * float(np.log(max(_mean_square(covariance, chosen), np.finfo(float).tiny)))
        criterion += size / samples
        return Point(predictor, states, errors, covariance, criterion, spreads=tuple(priors), output_weight=chosen)

    def balanced(self) -> "Point":
        """The same behaviour in balanced coordinates, in which all entries have about equal effect."""
        into, back = self.predictor.balancing()
        p = self.predictor
        balanced = Predictor(into @ p.A @ back, into @ p.M, p.C @ back, p.D)
        states = [into @ x for x in self.states]
        if self.gaps:
            return replace(self, predictor=balanced, states=states)
        spreads = tuple(initial_spread(free_response(balanced.A, balanced.C, len(e))) for e in self.errors)
        increase = _size(states, spreads) - _size(self.states, self.spreads)
        criterion = self.criterion + increase / sum(len(e) for e in self.errors)
        return replace(self, predictor=balanced, states=states, criterion=criterion, spreads=spreads)

    @property
    def mean_square(self) -> float:
        """Mean of e' W e, of e' e without a weight of the outputs."""
        return _mean_square(self.covariance, self.output_weight)

    @property
    def inverse_covariance(self) -> FloatArray:
        """Inverse of the errors' covariance (ny, ny)."""
        return np.asarray(np.linalg.inv(_floored(self.covariance)), dtype=np.float64)

    @property
    def weight(self) -> FloatArray:
        """Weight of the errors (ny, ny), by which the mean of e' weight e is ny."""
        if self.output_weight is None:
            return self.inverse_covariance
        return self.output_weight * (len(self.covariance) / max(self.mean_square, np.finfo(float).tiny))


def _mean_square(covariance: FloatArray, weight: FloatArray | None) -> float:
    return float(np.trace(covariance) if weight is None else np.sum(weight * covariance))


def _size(states: Sequence[FloatArray], spreads: Sequence[FloatArray]) -> float:
    return sum(float(np.sum((x / spread) ** 2)) for x, spread in zip(states, spreads, strict=True))


def _floored(covariance: FloatArray) -> FloatArray:
    mean = float(np.trace(covariance)) / len(covariance)
    return covariance + max(WEIGHT_FLOOR * mean, np.finfo(float).tiny) * np.eye(len(covariance))
