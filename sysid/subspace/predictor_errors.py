"""Errors of state-space predictors on records, with the best initial states."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sysid.models.recursion import free_response
from sysid.records.arrays import FloatArray
from sysid.subspace.predictor import Predictor
from sysid.subspace.predictor_gaps import Eliminated, greatest_likelihood
from sysid.subspace.predictor_record import Record, initial_spread

WEIGHT_FLOOR = 1e-10  # of the errors' covariance, as a part of its mean diagonal


@dataclass(frozen=True, eq=False)
class Point:
    """A predictor with the initial states, and its errors.

    Attributes:
        predictor: The predictor.
        states: Initial state per experiment (n,).
        errors: Per experiment (N, ny).
        covariance: Mean of e e' over all samples (ny, ny).
        criterion: Logarithm of its determinant, and what the size of the initial states adds.
        gaps: What became of the missing outputs, per experiment; empty where there are none.
        spreads: To what deviation the initial state of each experiment is held (n,); empty where outputs are missing.
    """

    predictor: Predictor
    states: list[FloatArray]
    errors: list[FloatArray]
    covariance: FloatArray
    criterion: float
    gaps: tuple[Eliminated, ...] = ()
    spreads: tuple[FloatArray, ...] = ()

    @staticmethod
    def at(
        records: Sequence[Record], predictor: Predictor, weight: FloatArray, spreads: Sequence[FloatArray] = ()
    ) -> "Point":
        """Evaluate, the initial states the best ones for errors with covariance W^-1.

        A state that leaves hardly a trace is held to a size that it may well have: it is taken to be random with a
        standard deviation of PRIOR times that of the state in balanced coordinates. Without noise this hardly counts.
        From one step to the next that size has to stay (`spreads`), or the criterion falls not as its gradient says.
        """
        if any(record.known is not None for record in records):
            likely = greatest_likelihood(records, predictor, weight)
            initial, made = [part.state for part in likely.parts], [part.errors for part in likely.parts]
            return Point(predictor, initial, made, likely.covariance, likely.criterion, likely.parts)
        root = np.linalg.cholesky(weight)
        n = len(predictor.A)
        states: list[FloatArray] = []
        errors: list[FloatArray] = []
        held: list[FloatArray] = []
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
            held.append(prior)
            size += float(relative @ relative)
        samples = sum(len(e) for e in errors)
        covariance = np.asarray(sum(e.T @ e for e in errors) / samples)
        criterion = float(np.linalg.slogdet(_floored(covariance))[1]) + size / samples
        return Point(predictor, states, errors, covariance, criterion, spreads=tuple(held))

    def balanced(self) -> "Point":
        """The same behaviour in balanced coordinates; entries are then of about equal effect."""
        into, back = self.predictor.balancing()
        p = self.predictor
        turned = Predictor(into @ p.A @ back, into @ p.M, p.C @ back, p.D)
        states = [into @ x for x in self.states]
        if self.gaps:
            return replace(self, predictor=turned, states=states)
        spreads = tuple(initial_spread(free_response(turned.A, turned.C, len(e))) for e in self.errors)
        grown = _size(states, spreads) - _size(self.states, self.spreads)
        criterion = self.criterion + grown / sum(len(e) for e in self.errors)
        return replace(self, predictor=turned, states=states, criterion=criterion, spreads=spreads)

    @property
    def weight(self) -> FloatArray:
        """Inverse of the errors' covariance (ny, ny)."""
        return np.asarray(np.linalg.inv(_floored(self.covariance)), dtype=np.float64)


def _size(states: Sequence[FloatArray], spreads: Sequence[FloatArray]) -> float:
    return sum(float(np.sum((x / spread) ** 2)) for x, spread in zip(states, spreads, strict=True))


def _floored(covariance: FloatArray) -> FloatArray:
    mean = float(np.trace(covariance)) / len(covariance)
    return covariance + max(WEIGHT_FLOOR * mean, np.finfo(float).tiny) * np.eye(len(covariance))
