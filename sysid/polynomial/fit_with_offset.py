"""Estimation of a model together with constant output offsets: its operating point."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sysid.models.estimate import Estimate
from sysid.models.predict import residuals
from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError, SysidWarning

ROUNDS = 12  # limit on the alternations between model and offset
WORTH = 1e-4  # least decrease of the power of the errors, relative to it, for a further round
EXACT = 1e-24  # power of the errors, relative to the output, that is rounding alone
ENDLESS = 1e8  # largest response of the predictor that is used; an unstable predictor determines no offset
LARGEST_RATIO = 0.95  # largest ratio of consecutive steps that is extrapolated as a geometric series


BLOCK = 2**16
"""Samples whose regressors are held at a time: those of a million samples of ten outputs take more than 1 GB."""


@dataclass(frozen=True)
class OffsetFit:
    """A model and the records that it was fitted to.

    Attributes:
        estimate: The model.
        parts: The records relative to its operating point.
    """

    estimate: Estimate
    parts: tuple[IOData, ...]


def subtract_means(parts: Sequence[IOData]) -> tuple[IOData, ...]:
    """Subtract the means of all records together: the mean of a single part differs from it only by chance."""
    u = np.concatenate([part.u for part in parts]).mean(axis=0)
    y = np.nanmean(np.concatenate([part.y for part in parts]), axis=0)
    return tuple(part.subtract(u=u, y=y) for part in parts)


def fit_with_offset(run: Callable[[Sequence[IOData]], Estimate], parts: Sequence[IOData]) -> OffsetFit:
    """Estimate a model together with a constant on every output.

    The mean output of a record with a transient is not the output at the mean input. So the remaining constant is
    estimated from the one-step errors of the model, and the model again without it, as long as the errors decrease.

    Args:
        run: The estimator.
        parts: Records with the same channels; outputs may be missing.

    Returns:
        Model and records.
    """
    shifted = subtract_means(parts)
    estimate, best = run(shifted), np.inf
    power = sum(float(np.nansum(part.y**2)) for part in shifted)
    result, last = OffsetFit(estimate, shifted), np.zeros(parts[0].ny)
    for _ in range(ROUNDS):
        offset, before, after = unexplained_offset(estimate.model, shifted)
        if not before < best:
            break
        best, result = before, OffsetFit(estimate, shifted)
        if not before - after > WORTH * before or before < EXACT * power:
            break
        step, last = _extrapolated(offset, last), offset
        shifted = tuple(part.subtract(y=step) for part in shifted)
        try:
            estimate = run(shifted)
        except SysidError:
            break
    return result


def _extrapolated(step: FloatArray, last: FloatArray) -> FloatArray:
    """Sum of a geometric series of steps (Aitken extrapolation); the step itself if the ratio is no such."""
    size = float(last @ last)
    ratio = float(step @ last) / size if size > 0.0 else 0.0
    return step / (1.0 - ratio) if 0.0 < ratio < LARGEST_RATIO else step


def unexplained_offset(model: StateSpace, parts: Sequence[IOData]) -> tuple[FloatArray, float, float]:
    """Constant offset of every output (ny,) that explains most of the one-step errors, with free initial states.

    Returned beside it: the sums of squares of the errors before and after.
    """
    gram, moment, total = np.zeros((model.ny, model.ny)), np.zeros(model.ny), 0.0
    order, axes = model.order, np.eye(model.order + model.ny)
    # of the state beside a constant output
    predictor = axes.copy()
    predictor[:order] = np.hstack((model.A - model.gain @ model.C, model.gain))
    for part in parts:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", SysidWarning)
            errors = residuals(model, part, x0=np.zeros(order))
            # after a gap the predictor is another one
            step = BLOCK if part.complete else len(part)
            table, starts = np.empty((0, order + model.ny + 1)), axes
            for first in range(0, len(part), step):
                piece = part[first : first + step]
                if first:
                    starts = np.linalg.matrix_power(predictor, first)
                zero = replace(piece, u=np.zeros_like(piece.u), y=np.where(piece.known, 0.0, np.nan))
                columns = [
                    residuals(model, zero if k < order else replace(zero, y=zero.y + axes[k, order:]), x0=start[:order])
                    for k, start in enumerate(starts.T)
                ]
                # only known outputs after the initialisation window count
                known = piece.known & (np.arange(first, first + len(piece)) >= part.window)[:, None]
                rows = np.stack([one[known] for one in (*columns, errors[first : first + step])], axis=1)
                if not np.isfinite(rows).all() or np.abs(rows[:, :-1]).max(initial=0.0) > ENDLESS:
                    return np.zeros(model.ny), np.inf, np.inf
                # a triangular factor has the least squares of all its rows
                table = rows if len(part) <= step else np.asarray(np.linalg.qr(np.vstack((table, rows)), mode="r"))
        if model.order:
            free, others = table[:, : model.order], table[:, model.order :]
            table = others - free @ np.linalg.lstsq(free, others, rcond=None)[0]
        steps, errors = table[:, :-1], table[:, -1]
        gram, moment, total = gram + steps.T @ steps, moment + steps.T @ errors, total + float(errors @ errors)
    offset: FloatArray = np.linalg.lstsq(gram, moment, rcond=1e-10)[0].astype(np.float64)
    return offset, total, total - float(moment @ offset)
