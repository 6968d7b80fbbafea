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


def record_weights(parts: Sequence[IOData]) -> np.ndarray:
    """Return one over the spread of each record's output (parts,).

    A model that misses something errs in proportion to the motion, far above the noise. Without the weights the largest
    amplitude alone would decide; the normalised error of a score counts every record alike.

    Raises:
        ScenarioError: An output does not move.
    """
    spreads = np.array([part.y[:, 0].std() for part in parts])
    if not spreads.all():
        raise ScenarioError("an output of a training record does not move, expected motion to identify a model from")
    return 1.0 / spreads


def fit_simulation(
    simulate: Simulate,
    shared: np.ndarray,
    own: Sequence[np.ndarray],
    parts: Sequence[IOData],
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
        parts: Records with one output.
        weights: Weight of each record; `record_weights` by default.
        max_iterations: Limit on the accepted steps.

    Returns:
        theta and all xi_r.

    Raises:
        ScenarioError: The simulation diverges at the start, or an output does not move.
    """
    weights = record_weights(parts) if weights is None else weights
    p, q = len(shared), len(own[0])
    count = p + q * len(parts)

    def split(theta: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        return theta[:p], [theta[p + q * k : p + q * (k + 1)] for k in range(len(parts))]

    def criterion(theta: np.ndarray, _: np.ndarray) -> Linearisation | None:
        rows = []
        for k, (part, private) in enumerate(zip(parts, split(theta)[1], strict=True)):
            output, slopes = simulate(theta[:p], private, part)
            table = weights[k] * np.column_stack([slopes, output - part.y[:, 0]])[part.window :]
            if not np.abs(table).max() < LARGEST:
                return None
            # The triangle of a record's columns has their products: what follows works on few rows.
            triangle, lengths = scaled_triangle(table)
            wide = np.zeros((len(triangle), count + 1))
            wide[:, :p], wide[:, -1] = triangle[:, :p], triangle[:, -1]
            wide[:, p + q * k : p + q * (k + 1)] = triangle[:, p:-1]
            wide[:, [*range(p), *range(p + q * k, p + q * (k + 1)), count]] *= lengths
            rows.append(wide)
        triangle, lengths = scaled_triangle(np.concatenate(rows))
        target = triangle[:, -1] * lengths[-1]
        samples = sum(len(part) - part.window for part in parts)
        return Linearisation(
            theta, float(target @ target), triangle[:count, :count], target[:count], lengths[:count], samples, 0
        )

    start = np.concatenate([shared, *own])
    at = criterion(start, start)
    if at is None:
        raise ScenarioError("the simulation of the initial model diverges on the records")
    energy = sum(float(w * w * np.sum((part.y - part.y.mean()) ** 2)) for w, part in zip(weights, parts, strict=True))
    return split(levenberg_marquardt(criterion, at, energy, max_iterations=max_iterations).at.theta)


def fit_to_window(simulate: Simulate, shared: np.ndarray, own: np.ndarray, record: IOData) -> np.ndarray:
    """Fit to the window of a record what it has for itself (q,), from a start; without a window that is the start."""
    if not record.window:
        return own

    def private(_: np.ndarray, xi: np.ndarray, part: IOData) -> Simulated:
        output, slopes = simulate(shared, xi, part)
        return output, slopes[:, len(shared) :]

    window = replace(record, window=0)[: record.window]
    return fit_simulation(private, np.zeros(0), [own], [window], weights=np.ones(1), max_iterations=20)[1][0]


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
    wild = ~(np.abs(output - level) < DIVERGED * spread)
    if wild.any():
        first = int(np.argmax(wild))
        raise ScenarioError(
            f"{model} diverges on {record.name or 'the record'}: from sample {first} of {len(record)} on its output is "
            f"more than {DIVERGED:g} times the spread of the training records away from their mean; expected a stable "
            "simulation, which fewer terms or a lower degree may give"
        )
    return output
