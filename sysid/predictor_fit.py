"""Prediction-error fits of state-space predictors, at a cost that hardly depends on the length of the record.

Every derivative of the prediction is a fixed filter with the predictor's poles, each at most twice, of w and of the
initial state. Written in an orthonormal basis of such filters, Gauss-Newton's normal equations are made of the moments
of the basis' outputs; and these follow, exactly, from the correlations of w, which are formed once. Only the errors
themselves are computed sample by sample: their accuracy is that of the fit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from sysid.arrays import FloatArray
from sysid.data import IOData
from sysid.orthonormal_basis import all_pass, gramian, stein
from sysid.predictor import Predictor, Scales
from sysid.recursion import free_response

CONVERGED = 1e-8  # decrease still to be had, as a part of the sum of squares
ROUNDING = 1e-29  # mean square of the errors, as a part of the output's, below which nothing is left to explain
PRIOR = 30.0  # standard deviations of a state that its initial value may well reach
REPAIRS = 6  # steps towards an exact fit
WEIGHT_FLOOR = 1e-10  # of the errors' covariance, as a part of its mean diagonal
Correlations = tuple[FloatArray, FloatArray]
Directions = Callable[[Predictor], FloatArray]


@dataclass(frozen=True, eq=False)
class Record:
    """One experiment, channels scaled, behind its initialisation window.

    Attributes:
        u: Inputs (N, nu).
        y: Outputs (N, ny).
        w: What drives the predictor (N, nu + ny) or (N, nu).
        transforms: Fourier transform of w and its lagged products, by length of the transform.
    """

    u: FloatArray
    y: FloatArray
    w: FloatArray
    transforms: dict[int, Correlations] = field(default_factory=dict)

    @staticmethod
    def of(experiment: IOData, scales: Scales, gain: bool) -> "Record":
        """Scale and cut."""
        u, y = experiment.u[experiment.window :] / scales.u, experiment.y[experiment.window :] / scales.y
        return Record(u, y, np.hstack((u, y)) if gain else u)

    def correlations(self, e: FloatArray, lags: int) -> Correlations:
        """Sums over t of w(t - j) w(t)' and of w(t - j) e(t)', j = 1..lags, (lags, nw, nw) and (lags, nw, ny)."""
        size = next_fast_len(len(self.w) + (1 << lags.bit_length()), real=True)
        if size not in self.transforms:
            spectrum = rfft(self.w.T, size)
            products = irfft(spectrum.conj()[:, None] * spectrum, size)
            self.transforms[size] = spectrum, np.ascontiguousarray(products[:, :, : size - len(self.w)].T)
        spectrum, own = self.transforms[size]
        cross = irfft(spectrum.conj()[:, None] * rfft(e.T, size), size)[:, :, 1 : lags + 1]
        # axes of `own` are (lag, t, t - lag) after the transposition
        return own[1 : lags + 1].transpose(0, 2, 1), cross.transpose(2, 0, 1)


@dataclass(frozen=True, eq=False)
class Point:
    """A predictor with the initial states, and its errors.

    Attributes:
        predictor: The predictor.
        states: Initial state per experiment (n,).
        errors: Per experiment (N, ny).
        covariance: Mean of e e' over all samples (ny, ny).
        criterion: Logarithm of its determinant, and what the size of the initial states adds.
    """

    predictor: Predictor
    states: list[FloatArray]
    errors: list[FloatArray]
    covariance: FloatArray
    criterion: float

    @staticmethod
    def at(records: Sequence[Record], predictor: Predictor, weight: FloatArray) -> "Point":
        """Evaluate, the initial states the best ones for errors with covariance W^-1.

        A state that leaves hardly a trace is held to a size that it may well have: it is taken to be random with a
        standard deviation of PRIOR times that of the state in balanced coordinates. Without noise this hardly counts.
        """
        root = np.linalg.cholesky(weight)
        n = len(predictor.A)
        states, errors, size = [], [], 0.0
        for record in records:
            e = record.y - predictor.predict(record.w, record.u, np.zeros(n))
            free = free_response(predictor.A, predictor.C, len(e))
            prior = _prior(free)
            columns = np.vstack((np.einsum("tln,lr->trn", free, root).reshape(-1, n) * prior, np.eye(n)))
            target = np.concatenate(((e[: len(free)] @ root).ravel(), np.zeros(n)))
            relative = np.linalg.lstsq(columns, target, rcond=None)[0]
            states.append(prior * relative)
            e[: len(free)] -= free @ states[-1]
            errors.append(e)
            size += float(relative @ relative)
        samples = sum(len(e) for e in errors)
        covariance = np.asarray(sum(e.T @ e for e in errors) / samples)
        criterion = float(np.linalg.slogdet(_floored(covariance))[1]) + size / samples
        return Point(predictor, states, errors, covariance, criterion)

    def balanced(self) -> "Point":
        """The same behaviour in balanced coordinates; entries are then of about equal effect."""
        into, back = self.predictor.balancing()
        p = self.predictor
        turned = Predictor(into @ p.A @ back, into @ p.M, p.C @ back, p.D)
        return Point(turned, [into @ x for x in self.states], self.errors, self.covariance, self.criterion)

    @property
    def weight(self) -> FloatArray:
        """Inverse of the errors' covariance (ny, ny)."""
        return np.asarray(np.linalg.inv(_floored(self.covariance)), dtype=np.float64)


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
    """Where the minimiser stopped.

    Attributes:
        point: Predictor, states, errors.
        normal: Normal equations there.
        iterations: Accepted steps.
        evaluations: Evaluations of the criterion.
        converged: The decrease still to be had is negligible, or the errors are at rounding level.
        reason: Why it stopped.
    """

    point: Point
    normal: Normal
    iterations: int
    evaluations: int
    converged: bool
    reason: str


def minimise(records: Sequence[Record], start: Predictor, directions: Directions, max_iterations: int) -> Minimum:
    """Levenberg-Marquardt on log det of the errors' covariance; the predictor stays stable [Ljung1999, eq. 7.92].

    Args:
        records: Experiments.
        start: A stable predictor.
        directions: Which changes of the entries are looked at, as columns, at a given predictor.
        max_iterations: Accepted steps at most.
    """
    power = float(np.mean([np.mean(r.y**2) for r in records]))
    point = Point.at(records, start.balanced(), np.eye(start.C.shape[0]))
    samples = sum(len(r.y) for r in records)
    damping, iterations, evaluations = 1e-6, 0, 1
    while True:
        normal = linearise(records, point, directions(point.predictor))
        if float(np.trace(point.covariance)) <= ROUNDING * power:
            return Minimum(point, normal, iterations, evaluations, True, "errors at rounding level")
        scale = column_scale(normal.information)
        values, vectors = np.linalg.eigh(normal.information / np.outer(scale, scale))
        kept = values > 1e-14 * values[-1]
        values = np.where(kept, values, 1.0)
        g = np.where(kept, vectors.T @ (normal.gradient / scale), 0.0)
        left = float(np.sum(g**2 / values)) / (samples * len(point.covariance))
        if left <= CONVERGED:
            return Minimum(point, normal, iterations, evaluations, True, "no decrease left")
        if iterations >= max_iterations:
            return Minimum(point, normal, iterations, evaluations, False, f"stopped after {iterations} iterations")
        blocked = False
        trial = None
        while damping < 1e8:
            weights = 1.0 / (values + damping)
            step = (vectors @ (weights * g)) / scale
            predictor = point.predictor.moved(normal.basis @ step)
            if predictor.is_stable():
                trial = Point.at(records, predictor, point.weight)
                evaluations += 1
                if trial.criterion < point.criterion:
                    break
                trial = None
            else:
                blocked = True
            damping = max(damping * 10.0, 1e-8)
        if trial is None:
            flat = left <= 1e-4 or float(np.trace(point.covariance)) <= 1e-16 * power
            why = "the edge of stability bars the way" if blocked else "no step decreases the errors further"
            return Minimum(point, normal, iterations, evaluations, flat, why)
        promised = float(np.sum(g**2 * weights * (2.0 - values * weights))) / samples
        achieved = point.criterion - trial.criterion
        damping = damping / 30.0 if achieved > 0.75 * promised else damping
        if achieved < 0.25 * promised:
            damping = max(damping * 4.0, 1e-8)
        point = trial.balanced()
        iterations += 1


def least_squares_fit(records: Sequence[Record], start: Predictor, directions: Directions) -> Predictor:
    """Solve for entries in which the prediction is linear, where a single step is exact.

    Args:
        records: Experiments.
        start: A stable predictor, the other entries final.
        directions: The entries.
    """
    point = Point.at(records, start.balanced(), np.eye(start.C.shape[0]))
    power = float(np.mean([np.mean(r.y**2) for r in records]))
    # further steps repair what rounding and the first weights left, where the errors are so small that it shows
    for _ in range(REPAIRS):
        normal = linearise(records, point, directions(point.predictor))
        scale = column_scale(normal.information)
        solution = np.linalg.lstsq(normal.information / np.outer(scale, scale), normal.gradient / scale, rcond=1e-13)
        step = solution[0] / scale
        better = Point.at(records, point.predictor.moved(normal.basis @ step), point.weight)
        if not better.criterion < point.criterion:
            break
        point = better
        if float(np.trace(point.covariance)) > 1e-4 * power:
            break
    found = point.predictor
    return Predictor(start.A, start.balancing()[1] @ found.M, start.C, found.D)


def linearise(records: Sequence[Record], point: Point, basis: FloatArray) -> Normal:
    """Normal equations in the directions of `basis`, each experiment's initial state eliminated [GolubPereyra2003].

    Args:
        records: Experiments.
        point: Where.
        basis: Directions (all entries of A, M, C, D, q).
    """
    sensitivities = _Sensitivities.of(point.predictor)
    weight = point.weight
    q = basis.shape[1]
    information, gradient = np.zeros((q, q)), np.zeros(q)
    for record, x0, e in zip(records, point.states, point.errors, strict=True):
        table = sensitivities.table(x0, basis)
        moments, products = sensitivities.moments(record, e)
        weighted = np.einsum("lr,lac->rac", np.linalg.cholesky(weight), table)
        flat = weighted.reshape(-1, table.shape[2])
        full = flat.T @ np.matmul(moments, weighted).reshape(flat.shape)
        slope = np.einsum("lac,al->c", table, products @ weight)
        corner, side = full[q:, q:], full[q:, :q]
        prior = _prior(free_response(point.predictor.A, point.predictor.C, len(e)))
        inverse = np.outer(prior, prior) * np.linalg.inv(corner * np.outer(prior, prior) + np.eye(len(prior)))
        slope[q:] -= x0 / prior**2
        information += full[:q, :q] - side.T @ inverse @ side
        gradient += slope[:q] - side.T @ inverse @ slope[q:]
    return Normal(0.5 * (information + information.T), gradient, basis)


@dataclass(frozen=True, eq=False)
class _Sensitivities:
    """Derivatives of the prediction in the basis (zI - F)^-1 b of 2n functions, applied to w and to a pulse.

    Attributes:
        predictor: Where.
        F: State matrix of the basis (2n, 2n).
        b: Its input (2n,).
        states: (zI - A)^-1 e_i, coefficients by state, i, and function (n, n, 2n).
        twice: C (zI - A)^-1 e_i times function a of the first n (ny, n, n, 2n).
    """

    predictor: Predictor
    F: FloatArray
    b: FloatArray
    states: FloatArray
    twice: FloatArray

    @staticmethod
    def of(predictor: Predictor) -> "_Sensitivities":
        n = len(predictor.A)
        once = all_pass(np.linalg.eigvals(predictor.A).astype(complex))
        basis = once.then(once)
        pulses = np.zeros((n, n, 2 * n))
        pulses[range(n), range(n)] = basis.b
        driven = np.zeros((n, n, n, 2 * n))
        driven[range(n), range(n)] = basis.F[:, :n].T
        twice = np.tensordot(predictor.C, stein(predictor.A, basis.F, driven), 1)
        return _Sensitivities(predictor, basis.F, basis.b, stein(predictor.A, basis.F, pulses), twice)

    def table(self, x0: FloatArray, basis: FloatArray) -> FloatArray:
        """Coefficients per output, signal and column (ny, signals, q + n); the last n columns are those of x0.

        Signals are the functions of every channel of w, then of the pulse, then the inputs themselves.
        """
        p = self.predictor
        n, nw = p.M.shape
        ny, nu = p.D.shape
        k = 2 * n
        x = np.einsum("ic,jia->cja", np.column_stack((p.M, x0)), self.states)
        seen = np.tensordot(p.C, self.states, 1)
        columns = n * n + n * nw + ny * n + ny * nu
        out = np.zeros((ny, (nw + 1) * k + nu, columns))
        functions = out[:, : (nw + 1) * k].reshape(ny, nw + 1, k, columns)
        by_a = np.einsum("cja,liab->lcbij", x[:, :, :n], self.twice, optimize=True)
        functions[..., : n * n] = by_a.reshape(ny, nw + 1, k, n * n)
        at = n * n
        for c in range(nw):
            functions[:, c, :, at + c : at + n * nw : nw] = seen.transpose(0, 2, 1)
        at += n * nw
        for i in range(ny):
            functions[i, :, :, at + i * n : at + (i + 1) * n] = x.transpose(0, 2, 1)
        at += ny * n
        for i in range(ny):
            out[i, (nw + 1) * k :, at + i * nu : at + (i + 1) * nu] = np.eye(nu)
        initial = np.zeros((ny, len(out[0]), n))
        initial[:, nw * k : (nw + 1) * k] = seen.transpose(0, 2, 1)
        return np.concatenate((out @ basis, initial), axis=2)

    def moments(self, record: Record, e: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Sums over time of signal signal' (signals, signals) and signal e' (signals, ny).

        With phi(t+1) = F phi(t) + b s(t) for every channel s, the sum P of phi phi' satisfies P = F P F' + F X b' +
        b X' F' + b S b' + the ends, X the sum of phi s' and S that of s s'.
        """
        F, b, w = self.F, self.b, record.w
        steps, nw = w.shape
        k, nu = len(b), record.u.shape[1]
        responses = free_response(F.T, b[None], steps)[:, 0]
        lags = min(len(responses), steps - 1)
        own, cross = record.correlations(e, lags)
        x = np.zeros((nw + 1, k, nw + 1))
        by_lag = responses[:lags].T
        x[:nw, :, :nw] = (by_lag @ own.reshape(lags, -1)).reshape(k, nw, nw).transpose(1, 0, 2)
        x[nw, :, :nw] = responses.T @ w[: len(responses)]
        s = np.zeros((nw + 1, nw + 1))
        s[:nw, :nw] = w.T @ w
        s[nw, nw] = 1.0
        last = np.zeros((nw + 1, k))
        last[:nw] = w[::-1][: len(responses)].T @ responses
        if len(responses) == steps:
            last[nw] = F @ responses[-1]
        moved = np.einsum("ab,cbd->cda", F, x)[..., None] * b
        q = moved + moved.transpose(1, 0, 3, 2) + s[:, :, None, None] * np.outer(b, b)
        q -= last[:, None, :, None] * last[None, :, None, :]
        functions = (nw + 1) * k
        out = np.empty((functions + nu,) * 2)
        out[:functions, :functions] = gramian(F, q).transpose(0, 2, 1, 3).reshape(functions, functions)
        out[:functions, functions:] = x[:, :, :nu].reshape(functions, nu)
        out[functions:, :functions] = out[:functions, functions:].T
        out[functions:, functions:] = s[:nu, :nu]
        products = np.empty((functions + nu, e.shape[1]))
        by_channel = (by_lag @ cross.reshape(lags, -1)).reshape(k, nw, -1).transpose(1, 0, 2)
        products[: nw * k] = by_channel.reshape(nw * k, -1)
        products[nw * k : functions] = responses.T @ e[: len(responses)]
        products[functions:] = record.u.T @ e
        return out, products


def _prior(free: FloatArray) -> FloatArray:
    """In balanced coordinates a state's variance and its power in the output are one number."""
    return PRIOR * np.maximum(np.sqrt(np.einsum("tln,tln->n", free, free)), np.sqrt(np.finfo(float).tiny))


def column_scale(information: FloatArray) -> FloatArray:
    """Lengths of the columns behind an information matrix (q,), directions without any information aside."""
    squares = np.diag(information)
    return np.sqrt(np.maximum(squares, max(1e-20 * float(squares.max(initial=0.0)), np.finfo(float).tiny)))


def _floored(covariance: FloatArray) -> FloatArray:
    mean = float(np.trace(covariance)) / len(covariance)
    return covariance + max(WEIGHT_FLOOR * mean, np.finfo(float).tiny) * np.eye(len(covariance))
