"""Least squares for B, D and the initial states, given A and C, from sums over the records alone.

The simulated output is linear in them. Its regressors are filtered inputs in an orthonormal basis with the poles of A,
and one pass over the record gives all their products with each other and with the output. What remains does not
depend on the length of the record: neither the errors of the start nor those of the fit are simulated.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid.models.recursion import free_response
from sysid.records.arrays import FloatArray
from sysid.subspace.predictor import Predictor, Record, initial_spread
from sysid.subspace.predictor_errors import floored, without_initial_state
from sysid.subspace.predictor_sensitivities import Sensitivities

LEAST_ERROR = 1e-4
"""Mean square of the errors, relative to that of the output, below which sums lose the digits that the errors need."""

CONDITION = 1e8
"""Largest condition of the normal equations, columns of unit length: beyond it the errors have to be refined."""


@dataclass(frozen=True, eq=False)
class RecordSums:
    """Sums over one record.

    Attributes:
        signals: Products of the regressors with each other (signals, signals).
        by_output: With the outputs (signals, ny).
        outputs: Products of the outputs (ny, ny).
        prior: Prior deviation of the initial state (n,).
        samples: Length of the record.
    """

    signals: FloatArray
    by_output: FloatArray
    outputs: FloatArray
    prior: FloatArray
    samples: int

    @staticmethod
    def of(record: Record, sensitivities: Sensitivities) -> "RecordSums":
        """Sums of a complete record."""
        at, y = sensitivities.predictor, record.y
        signals, by_output = sensitivities.filtered_moments(record, y)
        prior = initial_spread(free_response(at.A, at.C, len(y)))
        return RecordSums(signals, by_output, y.T @ y, prior, len(y))

    def normal(self, table: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Normal equations of coordinates and initial state (q + n, q + n) and (q + n,), errors weighted (ny, ny)."""
        weighted = np.tensordot(weight, table, 1)
        columns = table.shape[2]
        full = weighted.reshape(-1, columns).T @ (self.signals @ table).reshape(-1, columns)
        return full, np.einsum("lac,al->c", weighted, self.by_output)

    def best_state(self, theta: FloatArray, full: FloatArray, slope: FloatArray) -> FloatArray:
        """Initial state (n,) for coordinates (q,), by normal equations and its prior."""
        q, scale = len(theta), self.prior
        corner = full[q:, q:] * np.outer(scale, scale) + np.eye(len(scale))
        return np.asarray(scale * np.linalg.solve(corner, scale * (slope[q:] - full[q:, :q] @ theta)))

    def errors(self, table: FloatArray, coordinates: FloatArray) -> FloatArray:
        """Sum of e e' (ny, ny) for coordinates and initial state (q + n,)."""
        coefficients = (table @ coordinates).T
        cross = coefficients.T @ self.by_output
        return self.outputs - cross - cross.T + coefficients.T @ self.signals @ coefficients


def regression_on_inputs(records: Sequence[Record], at: Predictor, basis: FloatArray) -> Predictor | None:
    """The predictor, in balanced coordinates and without innovation gain, with its best entries in the `basis`.

    None where the sums would cost digits: errors near rounding, or inputs that hardly tell some entries.
    """
    sensitivities = Sensitivities.of(at, by_dynamics=False)
    table = sensitivities.table(np.zeros(len(at.A)), basis)
    sums = [RecordSums.of(record, sensitivities) for record in records]
    start = basis.T @ at.vector()
    first = _covariance(sums, table, start, np.eye(len(at.C)))
    if first is None:
        return None
    weight = np.asarray(np.linalg.inv(floored(first[0])), dtype=np.float64)
    information, gradient = np.zeros((len(start),) * 2), np.zeros(len(start))
    for of_record in sums:
        full, slope = of_record.normal(table, weight)
        added_information, added_gradient = without_initial_state(
            full, slope, np.zeros(len(of_record.prior)), of_record.prior
        )
        information += added_information
        gradient += added_gradient
    scale = np.sqrt(np.diag(information))
    if not scale.min(initial=np.inf) > 0.0:
        return None
    relative = information / np.outer(scale, scale)
    values = np.linalg.eigvalsh(relative)
    if not values[0] * CONDITION > values[-1]:
        return None
    step = np.linalg.solve(relative, (gradient - information @ start) / scale) / scale
    last = _covariance(sums, table, start + step, weight)
    power = sum(float(np.trace(of_record.outputs)) for of_record in sums) / sum(s.samples for s in sums)
    if last is None or not np.trace(last[0]) > LEAST_ERROR * power or not last[1] < first[1]:
        return None
    return at.moved(basis @ step)


def _covariance(
    sums: Sequence[RecordSums], table: FloatArray, theta: FloatArray, weight: FloatArray
) -> tuple[FloatArray, float] | None:
    """Covariance of the errors (ny, ny) with the best initial states, and the criterion; None if rounding hides it."""
    total, samples, prior_cost = np.zeros_like(weight), 0, 0.0
    for of_record in sums:
        x0 = of_record.best_state(theta, *of_record.normal(table, weight))
        total += of_record.errors(table, np.concatenate((theta, x0)))
        samples += of_record.samples
        prior_cost += float(np.sum((x0 / of_record.prior) ** 2))
    covariance = total / samples
    sign, logarithm = np.linalg.slogdet(floored(covariance))
    if sign <= 0.0 or np.diag(covariance).min() <= 0.0:
        return None
    return covariance, float(logarithm) + prior_cost / samples
