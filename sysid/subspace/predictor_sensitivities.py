"""Prediction-error fit of `pem_ss`: derivatives of the prediction in an orthonormal basis, and their moments."""

from dataclasses import dataclass

import numpy as np

from sysid.models.block_response import chained, powers_up_to
from sysid.models.recursion import free_response, state_trajectory
from sysid.polynomial.orthonormal_basis import all_pass, gramian, stein
from sysid.records.arrays import FloatArray
from sysid.subspace.predictor import Predictor, Record

LENGTH = 8
"""Samples of a block whose products are computed together: products of more samples cost more, of fewer the states."""

STRETCH = 512 * LENGTH
"""Samples at a time: their blocks stay near the processor."""


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Derivatives of the prediction in the basis (zI - F)^-1 b of 2n functions, applied to w and to a pulse.

    Derivatives by entries of M and D alone have each pole once: n functions serve, and k stands for either number.

    Attributes:
        predictor: The predictor.
        F: State matrix of the basis (k, k).
        b: Its input (k,).
        states: (zI - A)^-1 e_i, coefficients by state, i, and function (n, n, k).
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
        basis = all_pass(np.linalg.eigvals(predictor.A).astype(complex))
        twice = None
        if by_dynamics:
            basis = basis.then(basis)
            driven = np.zeros((n, n, n, 2 * n))
            driven[range(n), range(n)] = basis.F[:, :n].T
            twice = np.tensordot(predictor.C, stein(predictor.A, basis.F, driven), 1)
        pulses = np.zeros((n, n, len(basis.b)))
        pulses[range(n), range(n)] = basis.b
        return Sensitivities(predictor, basis.F, basis.b, stein(predictor.A, basis.F, pulses), twice)

    def table(self, x0: FloatArray, basis: FloatArray) -> FloatArray:
        """Coefficients per output, signal and column (ny, signals, q + n); the last n columns are those of x0.

        Signals are the functions of every channel of w, then of the pulse, then the inputs themselves.
        """
        p = self.predictor
        n, nw = p.M.shape
        ny, nu = p.D.shape
        k = len(self.b)
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

    def filtered_moments(self, record: Record, e: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The same sums by blocks of samples: for n functions it costs less than the correlations at all lags."""
        (steps, nu), ny, k = record.u.shape, e.shape[1], len(self.b)
        driven = record.w.shape[1] * k
        filters = BlockFilters.of(self.F, self.b, record.w.shape[1], nu, ny)
        samples = np.hstack((record.w, e))
        sums = filters.sums(samples)
        pulse = free_response(self.F.T, self.b[None], steps)[:, 0]
        by_pulse = pulse.T @ filters.signals(samples[: len(pulse)])
        size = driven + k + nu
        others = np.r_[:driven, driven + k : size]
        out, products = np.zeros((size, size)), np.zeros((size, ny))
        out[np.ix_(others, others)] = sums[: driven + nu, : driven + nu]
        out[driven : driven + k, others] = by_pulse[:, : driven + nu]
        out[others, driven : driven + k] = by_pulse[:, : driven + nu].T
        out[driven : driven + k, driven : driven + k] = pulse.T @ pulse
        products[others] = sums[: driven + nu, driven + nu :]
        products[driven : driven + k] = by_pulse[:, driven + nu :]
        return out, products


@dataclass(frozen=True, eq=False)
class BlockFilters:
    """Filters x(t+1) = F x(t) + b s(t), one for each driving channel s, run over blocks of LENGTH samples.

    Signals are the states of all filters, then some of the channels themselves. Within a block they are linear in the
    states before it and in its samples, so that their products follow from those of states and samples of all blocks.

    Attributes:
        transition: F^LENGTH transposed (k, k).
        drive: From the samples of a channel in a block to its state after it (LENGTH, k).
        into: From states before a block and its samples to the signals at each sample (p, LENGTH, signals).
        driving: Number of driving channels, the first.
    """

    transition: FloatArray
    drive: FloatArray
    into: FloatArray
    driving: int

    @staticmethod
    def of(F: FloatArray, b: FloatArray, driving: int, nu: int, ny: int) -> "BlockFilters":
        """Filters of the driving channels; the first nu of them, and ny further channels, are signals too."""
        k, channels = len(b), driving + ny
        powers = powers_up_to(F, LENGTH)
        responses = powers[:-1] @ b
        direct = np.r_[:nu, driving:channels]
        into = np.zeros((driving * k + LENGTH * channels, LENGTH, driving * k + len(direct)))
        into_samples = into[driving * k :].reshape(LENGTH, channels, LENGTH, -1)
        for c in range(driving):
            columns = slice(c * k, (c + 1) * k)
            into[columns, :, columns] = powers[:-1].transpose(2, 0, 1)
            for i in range(LENGTH - 1):
                into_samples[i, c, i + 1 :, columns] = responses[: LENGTH - 1 - i]
        for i in range(LENGTH):
            into_samples[i, direct, i, driving * k + np.arange(len(direct))] = 1.0
        return BlockFilters(powers[-1].T.copy(), responses[::-1].copy(), into, driving)

    def sums(self, samples: FloatArray) -> FloatArray:
        """Sums over time of signal signal' (signals, signals) for the samples of all channels (N, channels)."""
        p, signals = len(self.into), self.into.shape[2]
        products = np.zeros((p, p))
        whole = len(samples) // LENGTH * LENGTH
        states = np.zeros((self.driving, len(self.transition)))
        for begin in range(0, whole, STRETCH):
            blocks, states = self.blocks(samples[begin : min(begin + STRETCH, whole)], states)
            products += blocks.T @ blocks
        by_sample = (products @ self.into.reshape(p, -1)).reshape(-1, signals)
        rest = self.last_signals(samples[whole:], states)
        return np.asarray(self.into.reshape(-1, signals).T @ by_sample + rest.T @ rest)

    def signals(self, samples: FloatArray) -> FloatArray:
        """The signals (N, signals) for the samples of all channels (N, channels), from rest."""
        p, signals = len(self.into), self.into.shape[2]
        whole = len(samples) // LENGTH * LENGTH
        blocks, states = self.blocks(samples[:whole], np.zeros((self.driving, len(self.transition))))
        first = (blocks @ self.into.reshape(p, -1)).reshape(-1, signals)
        return np.vstack((first, self.last_signals(samples[whole:], states)))

    def blocks(self, samples: FloatArray, states: FloatArray) -> tuple[FloatArray, FloatArray]:
        """States before each block with its samples (blocks, p), and the states after the last (driving, k)."""
        count, channels, k = len(samples) // LENGTH, samples.shape[1], len(self.transition)
        by_block = samples.reshape(count, LENGTH, channels)
        driving = by_block[:, :, : self.driving].transpose(0, 2, 1).reshape(-1, LENGTH)
        drive = (driving @ self.drive).reshape(count, self.driving, k)
        before = chained(self.transition, drive, states)
        return np.hstack(
            (before[:-1].reshape(count, self.driving * k), by_block.reshape(count, LENGTH * channels))
        ), before[-1]

    def last_signals(self, samples: FloatArray, states: FloatArray) -> FloatArray:
        """The signals of fewer than LENGTH samples (samples, signals) from states (driving, k)."""
        padded = np.zeros((LENGTH, samples.shape[1]))
        padded[: len(samples)] = samples
        block = np.concatenate((states.ravel(), padded.ravel()))
        return np.tensordot(block, self.into, 1)[: len(samples)]


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
