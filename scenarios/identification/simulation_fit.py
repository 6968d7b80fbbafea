"""Fit of nonlinear models to records: simulation errors by Levenberg-Marquardt, and the check that none diverges."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numba import njit

from scenarios.files.errors import ScenarioError
from sysid import IOData
from sysid.polynomial.least_squares import scaled_triangle
from sysid.polynomial.prediction_error import Linearisation, levenberg_marquardt

Simulated = tuple[np.ndarray, np.ndarray]
"""Simulated output (N,) and its sensitivities (N, p + q) to shared parameters and to what a record has for itself."""

Simulate = Callable[[np.ndarray, np.ndarray, IOData], Simulated]
"""Simulates a record with shared parameters (p,) and what the record has for itself (q,)."""

LARGEST = 1e100
"""Errors above it count as diverging: their squares would overflow."""

DIVERGED = 1e3
"""Distance from the mean output, in spreads of the training records, that only a diverging simulation reaches."""


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a loop; its machine code is kept on disk, unless no folder for it is writable."""
    try:
        return njit(cache=True, error_model="numpy")(function)
    except RuntimeError:
        return njit(error_model="numpy")(function)


def record_weights(records: Sequence[IOData]) -> np.ndarray:
    """Return one over the spread of each record's output (parts,).

    A model that misses something errs in proportion to the motion, far above the noise. Without the weights the largest
    amplitude alone would decide; the normalised error of a score counts every record alike.

    Raises:
        ScenarioError: An output does not move.
    """
    spreads = np.array([record.y[:, 0].std() for record in records])
    if not spreads.all():
        raise ScenarioError("an output of a training record does not move, expected motion to identify a model from")
    return 1.0 / spreads


def fit_simulation(
    simulate: Simulate,
    shared: np.ndarray,
    own: Sequence[np.ndarray],
    records: Sequence[IOData],
    *,
    weights: np.ndarray | None = None,
    max_iterations: int = 100,
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Minimise the weighted simulation errors of one output over records, from a start [More1978].

    sum_r w_r^2 sum_t (y_r(t) - yhat(t; theta, xi_r))^2 over the samples behind the window of each record.

    Args:
        simulate: The model.
        shared: Initial parameters theta (p,).
        own: Initial values of what each record has for itself, xi_r (q,): its initial state, its level.
        records: Records with one output.
        weights: Weight of each record; `record_weights` by default.
        max_iterations: Limit on the accepted steps.

    Returns:
        theta and all xi_r.

    Raises:
        ScenarioError: The simulation diverges at the start, or an output does not move.
    """
    if weights is None:
        weights = record_weights(records)
    p, q = len(shared), len(own[0])
    samples = sum(len(record) - record.window for record in records)

    def private_of(theta: np.ndarray, k: int) -> np.ndarray:
        return theta[p + q * k : p + q * (k + 1)]

    def criterion(theta: np.ndarray, _: np.ndarray) -> Linearisation | None:
        count = len(theta)
        triangles = []
        for k, record in enumerate(records):
            output, slopes = simulate(theta[:p], private_of(theta, k), record)
            table = weights[k] * np.column_stack([slopes, output - record.y[:, 0]])[record.window :]
            if not np.abs(table).max() < LARGEST:
                return None
            triangles.append(_triangle_of_record(table, k, (p, q, count)))
        triangle, lengths = scaled_triangle(np.concatenate(triangles))
        target = triangle[:, -1] * lengths[-1]
        cost = float(target @ target)
        return Linearisation(theta, cost, triangle[:count, :count], target[:count], lengths[:count], samples, 0)

    start = np.concatenate([shared, *own])
    initial = criterion(start, start)
    if initial is None:
        raise ScenarioError("the simulation of the initial model diverges on the records")
    energy = 0.0
    for weight, record in zip(weights, records, strict=True):
        energy += float(weight * weight * np.sum((record.y - record.y.mean()) ** 2))
    theta = levenberg_marquardt(criterion, initial, energy, max_iterations=max_iterations).at.theta
    return theta[:p], [private_of(theta, k) for k in range(len(records))]


def _triangle_of_record(table: np.ndarray, k: int, sizes: tuple[int, int, int]) -> np.ndarray:
    """Triangle with the products of a record's columns, at the columns of all parameters (rows, count + 1).

    What follows works on its few rows instead of the samples.

    Args:
        table: Sensitivities to shared and private parameters, and the errors (N, p + q + 1).
        k: Number of the record.
        sizes: Numbers of shared parameters p, of private ones of a record q, and of all.
    """
    p, q, count = sizes
    private = slice(p + q * k, p + q * (k + 1))
    triangle, lengths = scaled_triangle(table)
    wide = np.zeros((len(triangle), count + 1))
    wide[:, :p], wide[:, private], wide[:, -1] = triangle[:, :p], triangle[:, p:-1], triangle[:, -1]
    wide[:, [*range(p), *range(private.start, private.stop), count]] *= lengths
    return wide


def fit_to_window(simulate: Simulate, shared: np.ndarray, own: np.ndarray, record: IOData) -> np.ndarray:
    """Fit to the window of a record what it has for itself (q,), from a start; without a window that is the start."""
    if not record.window:
        return own

    def private(_: np.ndarray, xi: np.ndarray, window: IOData) -> Simulated:
        output, slopes = simulate(shared, xi, window)
        return output, slopes[:, len(shared) :]

    window = replace(record, window=0)[: record.window]
    # Few parameters converge in few steps; the weight of a single record does not matter.
    _, (fitted,) = fit_simulation(private, np.zeros(0), [own], [window], weights=np.ones(1), max_iterations=20)
    return fitted


def settled(output: np.ndarray, record: IOData, model: str, level: float, spread: float) -> np.ndarray:
    """Return simulated outputs (N,) of a record unless they diverge.

    Args:
        output: Outputs (N,), rad.
        record: The record.
        model: The model in words.
        level: Mean output of the training records, rad.
        spread: Its standard deviation there, rad.

    Raises:
        ScenarioError: An output is not finite, or further from the level than `DIVERGED` spreads.
    """
    has_diverged = ~(np.abs(output - level) < DIVERGED * spread)  # so that NaN counts
    if has_diverged.any():
        first = int(np.argmax(has_diverged))
        raise ScenarioError(
            f"{model} diverges on {record.name or 'the record'}: from sample {first} of {len(record)} on its output is "
            f"more than {DIVERGED:g} times the spread of the training records away from their mean; expected a stable "
            "simulation, which fewer terms or a lower degree may give"
        )
    return output
