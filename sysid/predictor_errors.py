"""Errors of state-space predictors on records, with the best initial states."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from sysid.arrays import FloatArray
from sysid.data import IOData
from sysid.predictor import Predictor, Scales
from sysid.recursion import free_response

PRIOR = 30.0  # standard deviations of a state that its initial value may well reach
WEIGHT_FLOOR = 1e-10  # of the errors' covariance, as a part of its mean diagonal
Correlations = tuple[FloatArray, FloatArray]


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
            prior = initial_spread(free)
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


def initial_spread(free: FloatArray) -> FloatArray:
    """In balanced coordinates a state's variance and its power in the output are one number."""
    return PRIOR * np.maximum(np.sqrt(np.einsum("tln,tln->n", free, free)), np.sqrt(np.finfo(float).tiny))


def _floored(covariance: FloatArray) -> FloatArray:
    mean = float(np.trace(covariance)) / len(covariance)
    return covariance + max(WEIGHT_FLOOR * mean, np.finfo(float).tiny) * np.eye(len(covariance))
