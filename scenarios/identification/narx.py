"""Polynomial NARX models, their terms chosen by forward regression with orthogonal least squares."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np

from scenarios.files.errors import ScenarioError
from scenarios.identification.simulation_fit import DIVERGED, compiled, record_weights, settled
from sysid import IOData

MOST_CANDIDATES = 1000
"""Terms to choose from; more are mostly powers of one another, and take minutes."""

MOST_TERMS = 100
"""Terms that are added before the criterion picks the best number of them."""

EXACT = 1e-20
"""Sum of squares of the errors, relative to that of the output, that is rounding alone."""

MARGIN = 2.0
"""Factor of the training commands for which a model must stay bounded: outside its data a polynomial soon diverges."""

DEPENDENT = 1e-12
"""Part of a candidate's square that the terms before it leave; below it only rounding is left."""


@compiled
def run_polynomial(
    factors: np.ndarray, coefficients: np.ndarray, inputs: np.ndarray, y: np.ndarray, first: int, last: int, na: int
) -> np.ndarray:
    """Run a polynomial difference equation from sample `first` to before `last`, outputs before the record 0.

    Terms are those of `Narx`, inputs the past ones at every sample (N, nu nb); of the outputs y (N,) those before
    `first` are used. Returned are the outputs (last - first,).
    """
    past, out = np.empty(na + last - first), np.empty(last - first)
    for lag in range(1, na + 1):
        past[na - lag] = y[first - lag] if first >= lag else 0.0
    for t in range(last - first):
        value = 0.0
        for k in range(len(coefficients)):
            term = coefficients[k]
            for factor in factors[k]:
                if factor > na:
                    term *= inputs[first + t, factor - na - 1]
                elif factor > 0:
                    term *= past[na + t - factor]
            value += term
        past[na + t] = value
        out[t] = value
    return out


def forward_regression(table: np.ndarray, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Choose regressors one by one by their error reduction ratio, as many as BIC prefers.

    The ratio of a regressor, orthogonalised against those chosen before to w, is (w'y)^2 / (w'w y'y) [Billings2013,
    ch. 3]: the part of the output's power that it explains. BIC, N log V + k log N [Schwarz1978], is where it stops.

    Args:
        table: Regressors with the output as last column, or the triangle of their QR factorisation, which has the same
            products (rows, m + 1).
        samples: Number of samples N.

    Returns:
        Numbers of the regressors in the order of their choice (k,), and their ratios (k,).
    """
    left, target = table[:, :-1].copy(), table[:, -1].copy()
    energy = float(target @ target)
    lengths = np.sum(left**2, axis=0)
    chosen, ratios, costs = list[int](), list[float](), list[float]()
    for count in range(1, min(MOST_TERMS, left.shape[1]) + 1):
        powers = np.sum(left**2, axis=0)
        usable = powers > DEPENDENT * lengths
        usable[chosen] = False
        gains = np.where(usable, (target @ left) ** 2 / np.where(usable, powers, 1.0), 0.0)
        best = int(np.argmax(gains))
        # What is left explains rounding; NaN ends the choice too.
        if not gains[best] > EXACT * energy:
            break
        direction = left[:, best] / np.sqrt(powers[best])
        left -= np.outer(direction, direction @ left)
        target -= direction * (direction @ target)
        # Rounding may make it zero, whose logarithm the criterion cannot take.
        rest = max(float(target @ target), EXACT * energy)
        chosen.append(best)
        ratios.append(float(gains[best]) / energy)
        costs.append(samples * math.log(rest / samples) + count * math.log(samples))
    kept = int(np.argmin(costs)) + 1 if costs else 0
    return np.array(chosen[:kept], dtype=int), np.array(ratios[:kept])


@dataclass(frozen=True, eq=False)
class Narx:
    """y(t) as a polynomial in past outputs and inputs, all relative to their means and over their spreads.

    Attributes:
        na: Outputs y(t-1) to y(t-na).
        nb: Inputs u(t-nk) to u(t-nk-nb+1), of every input.
        nk: Delay in samples.
        factors: Regressors whose product each term is (k, degree); 0: the constant 1; then past outputs, then inputs.
        coefficients: Of the terms (k,).
        levels: Mean inputs and, last, the mean output of the training records (nu + 1,), rad.
        spreads: Their standard deviations (nu + 1,), rad.
    """

    na: int
    nb: int
    nk: int
    factors: np.ndarray
    coefficients: np.ndarray
    levels: np.ndarray
    spreads: np.ndarray

    def predicted(self, record: IOData, steps: int) -> np.ndarray:
        """Return the outputs (N, 1), simulated from those of the window, or predicted from those up to t - steps.

        Before the record, all signals are taken at the means of the training records.

        Raises:
            ScenarioError: The predictions diverge.
        """
        inputs, y = self.scaled(record)
        first, samples = record.window, len(y)
        horizon = min(steps or samples, samples - first)
        out = y.copy()
        out[first : first + horizon] = self.run(inputs, y, first, first + horizon)
        for t in range(first + horizon, samples):
            out[t] = self.run(inputs, y, t - horizon + 1, t + 1)[-1]
        output = out * self.spreads[-1] + self.levels[-1]
        return settled(output, record, str(self), self.levels[-1], self.spreads[-1])[:, None]

    def run(self, inputs: np.ndarray, y: np.ndarray, first: int, last: int) -> np.ndarray:
        """Simulate samples from scaled past inputs (N, nu nb) and the scaled outputs before the first of them."""
        return np.asarray(run_polynomial(self.factors, self.coefficients, inputs, y, first, last, self.na))

    def scaled(self, record: IOData) -> tuple[np.ndarray, np.ndarray]:
        """Past inputs (N, nu nb) and outputs (N,) of a record, scaled."""
        u = (record.u - self.levels[:-1]) / self.spreads[:-1]
        return self.past_inputs(u), (record.y[:, 0] - self.levels[-1]) / self.spreads[-1]

    def past_inputs(self, u: np.ndarray) -> np.ndarray:
        """Inputs u(t-nk) to u(t-nk-nb+1) at every t, one input after the other (N, nu nb); 0 before the record."""
        before = self.nk + self.nb
        padded = np.concatenate([np.zeros((before, u.shape[1])), u])
        lagged = []
        for lag in range(self.nk, self.nk + self.nb):
            lagged.append(padded[before - lag : len(padded) - lag])
        return np.stack(lagged, axis=2).reshape(len(u), -1)

    def __str__(self) -> str:
        """Its orders as in a spec."""
        return f"narx:{self.na}/{self.nb}/{self.nk}/{self.factors.shape[1]}"


def narx(experiments: Sequence[IOData], na: int, nb: int, nk: int, degree: int) -> Narx:
    """Fit a polynomial NARX model to records of one output, each over its spread.

    Candidates are all monomials up to a degree in na past outputs and nb inputs, the constant among them
    [Leontaritis1985]. Forward regression on the one-step errors orders them, BIC bounds their number; of the models
    with as many terms or fewer, the one with the least simulation errors on the same records is taken, among those that
    stay bounded under these commands and under `MARGIN` times as large ones: one-step errors do not show that a model
    with one term more diverges [Piroddi2003].

    Args:
        experiments: Records with one output.
        na: Number of past outputs.
        nb: Number of values of each input.
        nk: Delay of the first of them in samples.
        degree: Highest degree of a term.

    Raises:
        ScenarioError: More than `MOST_CANDIDATES` candidates, or records shorter than the lags.
    """
    nu = experiments[0].nu
    count = math.comb(na + nu * nb + degree, degree)
    if count > MOST_CANDIDATES:
        raise ScenarioError(
            f"narx orders {na} {nb} {nk} {degree} given: {count} candidate terms of {nu} input(s), expected "
            f"{MOST_CANDIDATES} or less; lower na, nb or degree"
        )
    lags = max(na, nk + nb - 1)
    shortest = min(len(record) - max(record.window, lags) for record in experiments)
    if shortest < 1:
        raise ScenarioError(f"narx orders {na} {nb} {nk} {degree} given, a record has no sample behind {lags} lags")
    signals = np.concatenate([np.hstack([record.u, record.y]) for record in experiments])
    levels, spreads = signals.mean(axis=0), signals.std(axis=0)
    # The constant counts as a regressor of degree 0: products of fewer factors are filled up with it.
    factors = np.array(list(combinations_with_replacement(range(1 + na + nu * nb), degree)))
    # A channel that does not move has no scale.
    empty = Narx(na, nb, nk, factors, np.zeros(count), levels, np.where(spreads > 0.0, spreads, 1.0))
    records = []
    for record, weight in zip(experiments, record_weights(experiments) * spreads[-1], strict=True):
        inputs, y = empty.scaled(record)
        records.append(_Regression(inputs, y, weight, max(record.window, lags)))
    triangle, samples = _candidate_triangle(records, na, factors)
    terms, _ = forward_regression(triangle, samples)
    with np.errstate(all="ignore"):  # models that diverge overflow
        models = (_with_terms(empty, triangle, terms[:number]) for number in range(1, len(terms) + 1))
        return min(models, key=lambda model: _simulation_error(model, records), default=empty)


class _Regression(NamedTuple):
    """Scaled past inputs and outputs of a record, its weight, and its first sample with a full past."""

    inputs: np.ndarray
    y: np.ndarray
    weight: float
    first: int


def _candidate_triangle(records: Sequence[_Regression], na: int, factors: np.ndarray) -> tuple[np.ndarray, int]:
    """Triangle of all candidate terms and the output over the records (m + 1, m + 1), and the number of samples."""
    triangle, samples = np.zeros((0, len(factors) + 1)), 0
    for inputs, y, weight, first in records:
        past = np.stack([y[first - lag : len(y) - lag] for lag in range(1, na + 1)], axis=1)
        rows = np.column_stack([np.ones(len(past)), past, inputs[first:]])
        table = weight * np.column_stack([rows[:, factors].prod(axis=2), y[first:]])
        # One triangle after the other: all rows at once may take a gigabyte.
        triangle = np.asarray(np.linalg.qr(np.concatenate([triangle, table]), mode="r"))
        samples += len(table)
    return triangle, samples


def _with_terms(empty: Narx, triangle: np.ndarray, terms: np.ndarray) -> Narx:
    """The model with some of the candidate terms, fitted by least squares."""
    columns = triangle[:, terms]
    # Powers differ by orders of magnitude: columns of unit length make the solution well conditioned.
    lengths = np.linalg.norm(columns, axis=0)
    solution = np.linalg.lstsq(columns / lengths, triangle[:, -1], rcond=None)[0]
    return replace(empty, factors=empty.factors[terms], coefficients=solution / lengths)


def _simulation_error(model: Narx, records: Sequence[_Regression]) -> float:
    """Weighted squares of the simulation errors; infinite for a model that does not stay bounded."""
    total = 0.0
    for inputs, y, weight, first in records:
        error = weight * (model.run(inputs, y, first, len(y)) - y[first:])
        larger = model.run(MARGIN * inputs, y, first, len(y))
        is_bounded = np.abs(error).max() < DIVERGED and np.abs(larger).max() < DIVERGED
        total += float(error @ error) if is_bounded else math.inf
    return total
