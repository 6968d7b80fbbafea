"""Prediction-error fit of `pem_ss`: derivatives of the prediction in an orthonormal basis, and their moments."""

from dataclasses import dataclass

import numpy as np

from sysid.models.recursion import free_response, state_trajectory
from sysid.polynomial.orthonormal_basis import all_pass, gramian, stein
from sysid.records.arrays import FloatArray
from sysid.subspace.predictor import Predictor, Record


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Derivatives of the prediction in the basis (zI - F)^-1 b of 2n functions, applied to w and to a pulse.

    Attributes:
        predictor: The predictor.
        F: State matrix of the basis (2n, 2n).
        b: Its input (2n,).
        states: (zI - A)^-1 e_i, coefficients by state, i, and function (n, n, 2n).
        twice: C (zI - A)^-1 e_i times function a of the first n (ny, n, n, 2n), the costly part; None without
            derivatives by A.
    """

    predictor: Predictor
    F: FloatArray
    b: FloatArray
    states: FloatArray
    twice: FloatArray | None

    @staticmethod
    def of(predictor: Predictor, by_dynamics: bool = True) -> "Sensitivities":
        """Solve for the coefficients, which do not depend on the data; those by A only with `by_dynamics`."""
        n = len(predictor.A)
        # every derivative has the poles of the predictor, each at most twice
        once = all_pass(np.linalg.eigvals(predictor.A).astype(complex))
        basis = once.then(once)
        pulses = np.zeros((n, n, 2 * n))
        pulses[range(n), range(n)] = basis.b
        twice = None
        if by_dynamics:
            driven = np.zeros((n, n, n, 2 * n))
            driven[range(n), range(n)] = basis.F[:, :n].T
            twice = np.tensordot(predictor.C, stein(predictor.A, basis.F, driven), 1)
        return Sensitivities(predictor, basis.F, basis.b, stein(predictor.A, basis.F, pulses), twice)

    def table(self, x0: FloatArray, basis: FloatArray) -> FloatArray:
        """Coefficients per output, signal and column (ny, signals, q + n); the last n columns are those of x0.

        Signals are the functions of every channel of w, then of the pulse, then the inputs themselves.
        """
        p = self.predictor
        n, nw = p.M.shape
        ny, nu = p.D.shape
        k = 2 * n
        # the pulse at the begin drives the state to x0
        x = np.einsum("ic,jia->cja", np.column_stack((p.M, x0)), self.states)
        observed = np.tensordot(p.C, self.states, 1)
        columns = n * n + n * nw + ny * n + ny * nu
        out = np.zeros((ny, (nw + 1) * k + nu, columns))
        functions = out[:, : (nw + 1) * k].reshape(ny, nw + 1, k, columns)
        if self.twice is not None:
            by_a = np.einsum("cja,liab->lcbij", x[:, :, :n], self.twice, optimize=True)
            functions[..., : n * n] = by_a.reshape(ny, nw + 1, k, n * n)
        # columns follow the entries of A, then of M, C and D, row by row
        at = n * n
        for c in range(nw):
            functions[:, c, :, at + c : at + n * nw : nw] = observed.transpose(0, 2, 1)
        at += n * nw
        for i in range(ny):
            functions[i, :, :, at + i * n : at + (i + 1) * n] = x.transpose(0, 2, 1)
        at += ny * n
        for i in range(ny):
            out[i, (nw + 1) * k :, at + i * nu : at + (i + 1) * nu] = np.eye(nu)
        initial = np.zeros((ny, len(out[0]), n))
        initial[:, nw * k : (nw + 1) * k] = observed.transpose(0, 2, 1)
        return np.concatenate((out @ basis, initial), axis=2)

    def moments(self, record: Record, e: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Sums over time of signal signal' (signals, signals) and signal e' (signals, ny).

        With phi(t+1) = F phi(t) + b s(t) for every channel s, the sum P of phi phi' satisfies P = F P F' + F X b' +
        b X' F' + b S b' + the ends, X the sum of phi s' and S that of s s'.
        """
        F, b, w = self.F, self.b, record.w
        steps, nw = w.shape
        k, nu, ny = len(b), record.u.shape[1], e.shape[1]
        responses = free_response(F.T, b[None], steps)[:, 0]
        lags = min(len(responses), steps - 1)
        w_by_w, w_by_e = record.correlations(e, lags)
        x = np.zeros((nw + 1, k, nw + 1))
        by_lag = responses[:lags].T
        x[:nw, :, :nw] = (by_lag @ w_by_w.reshape(lags, nw * nw)).reshape(k, nw, nw).transpose(1, 0, 2)
        x[nw, :, :nw] = responses.T @ w[: len(responses)]
        s = np.zeros((nw + 1, nw + 1))
        s[:nw, :nw] = w.T @ w
        s[nw, nw] = 1.0
        # phi(N), behind the last sample, by channel: the sum over phi(t + 1) contains it, that over phi(t) does not
        last = np.zeros((nw + 1, k))
        last[:nw] = w[::-1][: len(responses)].T @ responses
        # the response to the pulse has died out by then, unless the record is shorter
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
        products = np.empty((functions + nu, ny))
        by_channel = (by_lag @ w_by_e.reshape(lags, nw * ny)).reshape(k, nw, ny).transpose(1, 0, 2)
        products[: nw * k] = by_channel.reshape(nw * k, ny)
        products[nw * k : functions] = responses.T @ e[: len(responses)]
        products[functions:] = record.u.T @ e
        return out, products


def prediction_jacobian(predictor: Predictor, record: Record, x0: FloatArray, basis: FloatArray) -> FloatArray:
    """Derivatives of the prediction by the coordinates and by x0, filtered sample by sample (N, ny, q + n).

    Slower than `Sensitivities`, but as accurate as the prediction also where poles meet at the unit circle.
    """
    p, w, u = predictor, record.w, record.u
    x, at_rest = state_trajectory(p.A, w @ p.M.T, x0), np.zeros(len(x0))
    zero = Predictor(np.zeros_like(p.A), np.zeros_like(p.M), np.zeros_like(p.C), np.zeros_like(p.D))
    out = np.zeros((*record.y.shape, basis.shape[1] + len(x0)))
    for k, column in enumerate(basis.T):
        # dx(t+1) = A dx + dA x + dM w, dyhat = C dx + dC x + dD u
        d = zero.moved(column)
        dx = state_trajectory(p.A, x @ d.A.T + w @ d.M.T, at_rest)
        out[:, :, k] = dx @ p.C.T + x @ d.C.T + u @ d.D.T
    free = free_response(p.A, p.C, len(w))
    out[: len(free), :, basis.shape[1] :] = free
    return out
