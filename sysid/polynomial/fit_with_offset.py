"""The operating point of a record: what the output is where the input is at its mean."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sysid.models.estimate import Estimate
from sysid.models.predict import residuals
from sysid.models.state_space import StateSpace
from sysid.records.data import IOData
from sysid.records.errors import SysidError, SysidWarning

ROUNDS = 12
"""Estimates at most: each has a better level than the one before."""

WORTH = 1e-4
"""Part of the errors' power that a further level must explain."""

EXACT = 1e-24
"""Part of the output's power below which errors are rounding."""

ENDLESS = 1e8
"""A free response beyond this is that of a predictor that is not stable; it tells no level."""

LARGEST_RATIO = 0.95
"""Of one step to the step before, that is trusted to go on like this."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OffsetFit:
    """A model of what moves about an operating point.

    Attributes:
        estimate: The model.
        parts: The records about their operating point, that the model is of.
        input: Inputs of the operating point (nu,).
        output: Outputs of it (ny,).
    """

    estimate: Estimate
    parts: tuple[IOData, ...]
    input: Array
    output: Array


def subtract_means(parts: Sequence[IOData]) -> tuple[tuple[IOData, ...], Array, Array]:
    """The records less their means, one for all parts: each has one of its own only by chance.

    Args:
        parts: Records with the same channels; outputs may be missing.

    Returns:
        The records, the means of the inputs (nu,) and of the outputs (ny,).
    """
    u = np.concatenate([part.u for part in parts]).mean(axis=0)
    y = np.nanmean(np.concatenate([part.y for part in parts]), axis=0)
    return tuple(part.subtract(u=u, y=y) for part in parts), u, y


def fit_with_offset(run: Callable[[Sequence[IOData]], Estimate], parts: Sequence[IOData]) -> OffsetFit:
    """Estimate a model together with a constant on every output.

    The mean of a record that starts from rest, or ends on the way, is not the output at the mean of its input. So the
    constant that is left is estimated from the model's one-step errors, and the model anew without it, as long as
    that explains more.

    Args:
        run: The estimator.
        parts: Records with the same channels; outputs may be missing.

    Returns:
        Model, records and operating point.
    """
    moved, u, y = subtract_means(parts)
    found, best = run(moved), np.inf
    power = sum(float(np.nansum(part.y**2)) for part in moved)
    result, last = OffsetFit(found, moved, u, y), np.zeros(len(y))
    for _ in range(ROUNDS):
        level, before, after = unexplained_offset(found.model, moved)
        if not before < best:
            break
        best, result = before, OffsetFit(found, moved, u, y)
        if not before - after > WORTH * before or before < EXACT * power:
            break
        step, last = _extrapolated(level, last), level
        moved, y = tuple(part.subtract(y=step) for part in moved), y + step
        try:
            found = run(moved)
        except SysidError:
            break
    return result


def _extrapolated(step: Array, last: Array) -> Array:
    """Where steps that shrink by one factor lead in the end (Aitken's process); the step itself where they do not."""
    size = float(last @ last)
    ratio = float(step @ last) / size if size > 0.0 else 0.0
    return step / (1.0 - ratio) if 0.0 < ratio < LARGEST_RATIO else step


def unexplained_offset(model: StateSpace, parts: Sequence[IOData]) -> tuple[Array, float, float]:
    """The constant on every output that explains most of the one-step errors, the initial states being free.

    Args:
        model: The model.
        parts: Records with its channels.

    Returns:
        The constants (ny,), and the sum of squares before and after.
    """
    gram, moment, total = np.zeros((model.ny, model.ny)), np.zeros(model.ny), 0.0
    for part in parts:
        still = replace(part, u=np.zeros_like(part.u), y=np.where(part.known, 0.0, np.nan))
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", SysidWarning)
            columns = [residuals(model, still, x0=axis) for axis in np.eye(model.order)]
            zero = np.zeros(model.order)
            columns += [residuals(model, replace(still, y=still.y + axis), x0=zero) for axis in np.eye(model.ny)]
            errors = residuals(model, part, x0=zero)
        # behind the initialisation window, where an output is known
        known = part.known.ravel() & np.repeat(np.arange(len(part)) >= part.window, model.ny)
        table = np.stack([*(column.ravel()[known] for column in columns), errors.ravel()[known]], axis=1)
        if not np.isfinite(table).all() or np.abs(table[:, : model.order + model.ny]).max(initial=0.0) > ENDLESS:
            return np.zeros(model.ny), np.inf, np.inf
        if model.order:
            free, rest = table[:, : model.order], table[:, model.order :]
            table = rest - free @ np.linalg.lstsq(free, rest, rcond=None)[0]
        ones, left = table[:, :-1], table[:, -1]
        gram, moment, total = gram + ones.T @ ones, moment + ones.T @ left, total + float(left @ left)
    level: Array = np.linalg.lstsq(gram, moment, rcond=1e-10)[0].astype(np.float64)
    return level, total, total - float(moment @ level)
