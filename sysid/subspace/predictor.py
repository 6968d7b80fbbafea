"""Prediction-error fit of `pem_ss`: predictors in state-space form, their records and local coordinates."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy
from numpy.typing import NDArray

from sysid.models.data_summary import DataSummary
from sysid.models.recursion import output_by_blocks
from sysid.models.state_space import StateSpace
from sysid.polynomial.orthonormal_basis import gramian
from sysid.polynomial.stability_limit import STABILITY_MARGIN
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.singular_values import svd

FLOOR = 1e-10  # of the Gramians, relative to their trace: bounds the scaling of nearly unobservable states


@dataclass(frozen=True, eq=False)
class Predictor:
    """x(t+1) = A x + M w, yhat = C x + D u, with w = [u; y], or w = u where there is no innovation gain.

    The predictor of x+ = F x + B u + K e, y = C x + D u + e has A = F - K C and M = [B - K D, K]: one to one.

    Attributes:
        A: State matrix (n, n), stable.
        M: From w to the state (n, nu + ny) or (n, nu).
        C: Output matrix (ny, n).
        D: Direct term (ny, nu).
    """

    A: FloatArray
    M: FloatArray
    C: FloatArray
    D: FloatArray

    @property
    def has_gain(self) -> bool:
        """Whether past outputs drive the state."""
        return self.M.shape[1] > self.D.shape[1]

    def is_stable(self) -> bool:
        """Whether the predictor is stable, also in floating-point numbers.

        The eigenvalues of a matrix far from normal, as a very large gain makes it, may lie inside the unit circle only
        up to rounding: its powers grow without bound. Those of poles that meet at the limit grow, but stay finite.
        """
        if not np.isfinite(self.A).all():
            return False
        if np.abs(np.linalg.eigvals(self.A)).max(initial=0.0) >= 1.0 - STABILITY_MARGIN:
            return False
        # twelve squarings: growth that the eigenvalues hide overflows
        with np.errstate(over="ignore", invalid="ignore"):
            return bool(np.isfinite(np.linalg.matrix_power(self.A, 2**12)).all())

    def vector(self) -> FloatArray:
        """All entries of A, M, C, D, row by row."""
        return np.concatenate([matrix.ravel() for matrix in (self.A, self.M, self.C, self.D)])

    def moved(self, step: FloatArray) -> "Predictor":
        """The predictor with `step` added to its entries."""
        dA, dM, dC, dD = np.split(step, np.cumsum([self.A.size, self.M.size, self.C.size]))
        return Predictor(
            self.A + dA.reshape(self.A.shape),
            self.M + dM.reshape(self.M.shape),
            self.C + dC.reshape(self.C.shape),
            self.D + dD.reshape(self.D.shape),
        )

    def moved_in_innovations_form(self, step: FloatArray) -> "Predictor":
        """The predictor after a step in F = A + K C, B, K, C and D, to first order that of `moved`.

        Along such a line the errors of clean data vary less.
        """
        out, nu = self.moved(step), self.D.shape[1]
        if self.has_gain:
            dK = out.M[:, nu:] - self.M[:, nu:]
            out.A[:] -= dK @ (out.C - self.C)
            out.M[:, :nu] -= dK @ (out.D - self.D)
        return out

    def balancing(self) -> tuple[FloatArray, FloatArray]:
        """Change of basis T and its inverse to balanced coordinates: equally controllable and observable states."""
        n = len(self.A)
        with np.errstate(over="ignore", invalid="ignore"):
            controllability = gramian(self.A, self.M @ self.M.T)
            observability = gramian(self.A.T, self.C.T @ self.C)
        if not (np.isfinite(controllability).all() and np.isfinite(observability).all()):
            # an unstable predictor, or Gramians that overflow
            return np.eye(n), np.eye(n)
        left, right = _root(controllability), _root(observability)
        u, values, vt = svd(right.T @ left)
        root = np.sqrt(values)
        return (u / root).T @ right.T, left @ (vt.T / root)

    def balanced(self) -> "Predictor":
        """The predictor in balanced coordinates; see `balancing`."""
        into, back = self.balancing()
        return Predictor(into @ self.A @ back, into @ self.M, self.C @ back, self.D)

    def predict(self, w: FloatArray, u: FloatArray, x0: FloatArray) -> FloatArray:
        """Predicted output (N, ny)."""
        D = self.D
        if self.has_gain:
            # present outputs do not act on their own prediction
            D = np.hstack((D, np.zeros((len(D), len(D)))))
            return output_by_blocks(self.A, self.M, self.C, D, w, x0)
        return output_by_blocks(self.A, self.M, self.C, D, u, x0)


def _root(gramian: FloatArray) -> FloatArray:
    """Square root L of a Gramian with its floor, L L' = gramian + floor (n, n)."""
    floor = FLOOR * max(float(np.trace(gramian)), np.finfo(float).tiny)
    try:
        return np.asarray(np.linalg.cholesky(gramian + floor * np.eye(len(gramian))), dtype=np.float64)
    except np.linalg.LinAlgError:
        # rounding exceeds the floor if A is far from normal
        values, vectors = np.linalg.eigh(0.5 * (gramian + gramian.T))
        return np.asarray(vectors * np.sqrt(np.maximum(values, floor)))


@dataclass(frozen=True, eq=False)
class Scales:
    """Root mean squares of the channels; fits run on channels divided by them.

    Attributes:
        u: Per input (nu,).
        y: Per output (ny,).
    """

    u: FloatArray
    y: FloatArray

    @staticmethod
    def of(experiments: Sequence[IOData]) -> "Scales":
        """Root mean squares of a data set, after the initialisation windows."""
        inputs = [e.u[e.window :] for e in experiments]
        outputs = [e.y[e.window :] for e in experiments]
        return Scales(_root_mean_squares(inputs), _root_mean_squares(outputs))

    def predictor(self, model: StateSpace, gain: bool) -> Predictor:
        """Predictor of a model, channels scaled."""
        K = model.gain if gain else np.zeros_like(model.gain)
        B = (model.B - K @ model.D) * self.u
        M = np.hstack((B, K * self.y)) if gain else B
        C = model.C / self.y[:, None]
        D = model.D * self.u / self.y[:, None]
        return Predictor(model.A - K @ model.C, M, C, D)

    def model(self, predictor: Predictor, data: DataSummary, covariance: FloatArray | None) -> StateSpace:
        """Model of a scaled predictor; the covariance is in output units."""
        C = predictor.C * self.y[:, None]
        D = predictor.D * self.y[:, None] / self.u
        nu = len(self.u)
        K = np.zeros((len(predictor.A), len(self.y)))
        if predictor.has_gain:
            K = predictor.M[:, nu:] / self.y
        return StateSpace(
            predictor.A + K @ C,
            predictor.M[:, :nu] / self.u + K @ D,
            C,
            D,
            K,
            data.dt,
            covariance,
            **data.labels,
        )


def _root_mean_squares(signals: list[FloatArray]) -> FloatArray:
    """Root mean square of each channel, of its known samples; one for a silent channel."""
    roots = []
    for channel in np.concatenate(signals).T:
        samples = channel[np.isfinite(channel)]
        roots.append(float(np.linalg.norm(samples)) / np.sqrt(max(len(samples), 1)))
    return np.array([root if root > 0.0 else 1.0 for root in roots])


PRIOR = 300.0  # standard deviation of initial states, in that of the states; a smaller one would bias the criterion
Correlations = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Record:
    """One experiment, channels scaled, after its initialisation window.

    Attributes:
        u: Inputs (N, nu).
        y: Outputs (N, ny).
        w: Input of the predictor (N, nu + ny) or (N, nu).
        transforms: Fourier transform of w and its lagged products, by length of the transform.
        known: Mask of the known outputs (N, ny), the others zero in `y`; None if none is missing.
        output_weight: Weight of the errors (ny, ny); None for the inverse of their covariance.
    """

    u: FloatArray
    y: FloatArray
    w: FloatArray
    transforms: dict[int, Correlations] = field(default_factory=dict)
    known: NDArray[np.bool_] | None = None
    output_weight: FloatArray | None = None

    @staticmethod
    def of(experiment: IOData, scales: Scales, gain: bool, output_weight: FloatArray | None = None) -> "Record":
        """Scale an experiment and remove its initialisation window."""
        u, y = experiment.u[experiment.window :] / scales.u, experiment.y[experiment.window :] / scales.y
        known_outputs = None
        if not experiment.complete:
            known_outputs = np.isfinite(y)
            y = np.where(known_outputs, y, 0.0)
        w = np.hstack((u, y)) if gain else u
        return Record(u, y, w, known=known_outputs, output_weight=output_weight)

    def correlations(self, e: FloatArray, lags: int) -> Correlations:
        """Sums over t of w(t - j) w(t)' and of w(t - j) e(t)', j = 1..lags, (lags, nw, nw) and (lags, nw, ny)."""
        # zeros after the record, more than lags, keep its end from acting on its beginning; lags that grow a little
        # from step to step find the same size, hence the power of two
        size = scipy.fft.next_fast_len(len(self.w) + (1 << lags.bit_length()), real=True)
        if size not in self.transforms:
            spectrum = scipy.fft.rfft(self.w.T, size)
            products = scipy.fft.irfft(spectrum.conj()[:, None] * spectrum, size)
            self.transforms[size] = spectrum, np.ascontiguousarray(products[:, :, : size - len(self.w)].T)
        spectrum, w_by_w = self.transforms[size]
        spectrum_of_errors = scipy.fft.rfft(e.T, size)
        w_by_e = scipy.fft.irfft(spectrum.conj()[:, None] * spectrum_of_errors, size)[:, :, 1 : lags + 1]
        # axes of `w_by_w` are (lag, t, t - lag) after the transposition
        return w_by_w[1 : lags + 1].transpose(0, 2, 1), w_by_e.transpose(2, 0, 1)


def initial_spread(free: FloatArray) -> FloatArray:
    """Prior deviation of initial states (n,), from the power of their free responses.

    In balanced coordinates the variance of a state equals the power of its free response.
    """
    power = np.einsum("tln,tln->n", free, free)
    return PRIOR * np.maximum(np.sqrt(power), np.sqrt(np.finfo(float).tiny))


def local_coordinates(at: Predictor, direct: bool = True) -> FloatArray:
    """Directions that change the predictions (entries of A, M, C, D; q), D free if `direct` [McKelvey2004].

    They are those of the innovations form x+ = F x + B u + K e, y = C x + D u + e. First K, which leaves the model from
    u to y as it is: clean data determine that far better. Then F, B and C, orthogonal to changes of the basis of the
    state, as x -> (I + E) x changes F by E F - F E, B by E B, and C by -C E. Last D.
    """
    n, (ny, nu) = len(at.A), at.D.shape
    K = at.M[:, nu:] if at.has_gain else np.zeros((n, ny))
    F, B, C, D = at.A + K @ at.C, at.M[:, :nu] + K @ at.D, at.C, at.D
    free_gains, free_direct = K.size * at.has_gain, D.size * direct
    # one row per direction, the entries of K, then of F, B and C, then of D in its columns
    free = scipy.linalg.block_diag(
        np.eye(free_gains, K.size), _complement_of_basis_changes(F, B, C).T, np.eye(free_direct, D.size)
    )
    q = len(free)
    dK, dF, dB, dC, dD = np.split(free, np.cumsum([K.size, F.size, B.size, C.size]), axis=1)
    dK, dF, dB = dK.reshape(q, *K.shape), dF.reshape(q, *F.shape), dB.reshape(q, *B.shape)
    dC, dD = dC.reshape(q, *C.shape), dD.reshape(q, *D.shape)
    # A = F - K C and M = [B - K D, K]
    dA = dF - dK @ C - K @ dC
    dM = np.concatenate((dB - dK @ D - K @ dD, dK), axis=2)[:, :, : at.M.shape[1]]
    return np.hstack([change.reshape(q, -1) for change in (dA, dM, dC, dD)]).T


def _complement_of_basis_changes(F: FloatArray, B: FloatArray, C: FloatArray) -> FloatArray:
    """Orthonormal directions of the entries of F, B and C that no change of the basis of the state has (entries, q)."""
    n = len(F)
    unit = np.eye(n * n).reshape(n * n, n, n)
    changes = (unit @ F - F @ unit, unit @ B, -C @ unit)
    tangent = np.hstack([change.reshape(n * n, -1) for change in changes]).T
    # of a minimal model the n^2 changes are independent: the columns of Q beyond them are the rest
    return np.asarray(np.linalg.qr(tangent, mode="complete")[0][:, n * n :])


def input_coordinates(at: Predictor, direct: bool = True) -> FloatArray:
    """Unit columns (entries of A, M, C, D; q) that change B, and D if `direct`: the prediction is linear in them."""
    n, nu = len(at.A), at.D.shape[1]
    before_d = at.A.size + at.M.size + at.C.size
    index = np.arange(at.M.size).reshape(n, -1)[:, :nu].ravel() + at.A.size
    if direct:
        index = np.concatenate((index, np.arange(at.D.size) + before_d))
    out = np.zeros((before_d + at.D.size, len(index)))
    out[index, range(len(index))] = 1.0
    return out
