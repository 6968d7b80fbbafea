"""Estimation of a model together with constant output offsets: its operating point."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from sysid.models.companion_form import CompanionForm
from sysid.models.estimate import Estimate
from sysid.models.predict import residuals
from sysid.models.recursion import free_response
from sysid.models.state_space import StateSpace
from sysid.polynomial.least_squares import scaled_triangle
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError, SysidWarning

ROUNDS = 12  # limit on the alternations between model and offset
WORTH = 1e-4  # least decrease of the power of the errors, relative to it, for a further round
EXACT = 1e-24  # power of the errors, relative to the output, that is rounding alone
ENDLESS = 1e8  # largest response of the predictor that is used; an unstable predictor determines no offset
LARGEST_RATIO = 0.95  # largest ratio of consecutive steps that is extrapolated as a geometric series


DIED_OUT = 1e-100  # response to an initial state before an initialisation window's end: least squares would overflow
SINGULAR = 1e-10  # singular value of the sensitivities to offsets, relative to the largest, that determines nothing

SETTLED = 1e-14
"""Response to an initial state, relative to its first sample, that is negligible."""

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


def runs(parts: Sequence[IOData]) -> list[list[int]]:
    """Places of the parts of each run, by its name: runs have operating points of their own, parts of one do not."""
    places: dict[str, list[int]] = {}
    for k, part in enumerate(parts):
        places.setdefault(part.name, []).append(k)
    return list(places.values())


def subtract_means(parts: Sequence[IOData]) -> tuple[IOData, ...]:
    """Subtract from each run the means of all its parts: those of a single part differ from them only by chance."""
    subtracted = list(parts)
    for places in runs(parts):
        u = np.concatenate([parts[k].u for k in places]).mean(axis=0)
        y = np.nanmean(np.concatenate([parts[k].y for k in places]), axis=0)
        for k in places:
            subtracted[k] = parts[k].subtract(u=u, y=y)
    return tuple(subtracted)


def fit_with_offset(
    run: Callable[[Sequence[IOData]], Estimate], parts: Sequence[IOData], *, found: Estimate | None = None
) -> OffsetFit:
    """Estimate a model together with a constant on every output of each run.

    The mean output of a record with a transient is not the output at the mean input. So the remaining constant is
    estimated from the one-step errors of the model, and the model again without it, as long as the errors decrease.

    Args:
        run: The estimator.
        parts: Records with the same channels; outputs may be missing.
        found: What the estimator gives of the records about their means, where that is known.

    Returns:
        Model and records.
    """
    shifted = subtract_means(parts)
    estimate, least_error = run(shifted) if found is None else found, np.inf
    output_power = sum(float(np.nansum(record.y**2)) for record in shifted)
    result, last_offsets = OffsetFit(estimate, shifted), np.zeros((len(parts), parts[0].ny))
    for _ in range(ROUNDS):
        offsets, error, error_without_offset = unexplained_offsets(estimate.model, shifted)
        # an extrapolation that went too far, or a predictor that is not stable
        if not error < least_error:
            break
        least_error, result = error, OffsetFit(estimate, shifted)
        if not error - error_without_offset > WORTH * error or error < EXACT * output_power:
            break
        step, last_offsets = _extrapolated(offsets, last_offsets), offsets
        shifted = tuple(record.subtract(y=own) for record, own in zip(shifted, step, strict=True))
        try:
            estimate = run(shifted)
        except SysidError:
            break
    return result


def _extrapolated(step: FloatArray, last_step: FloatArray) -> FloatArray:
    """Sum of a geometric series of steps (Aitken extrapolation); the step itself if the ratio is no such."""
    size = float(np.sum(last_step * last_step))
    ratio = float(np.sum(step * last_step)) / size if size > 0.0 else 0.0
    return step / (1.0 - ratio) if 0.0 < ratio < LARGEST_RATIO else step


def unexplained_offsets(model: StateSpace, parts: Sequence[IOData]) -> tuple[FloatArray, float, float]:
    """`unexplained_offset` of each run, a row for each of its parts (parts, ny), and the sums over all runs."""
    offsets, before, after = np.zeros((len(parts), model.ny)), 0.0, 0.0
    for places in runs(parts):
        offset, error, error_without_offset = unexplained_offset(model, [parts[k] for k in places])
        offsets[places] = offset
        before, after = before + error, after + error_without_offset
    return offsets, before, after


def unexplained_offset(
    model: StateSpace, parts: Sequence[IOData], one_step_errors: Sequence[FloatArray] | None = None
) -> tuple[FloatArray, float, float]:
    """Constant offset of every output (ny,) that explains most of the one-step errors, with free initial states.

    Returned beside it: the sums of squares of the errors before and after. Zeros and infinite sums if the predictor
    diverges. The one-step errors of each part (N, ny) from any initial state are computed where they are not known.
    """
    gram, moment, total = np.zeros((model.ny, model.ny)), np.zeros(model.ny), 0.0
    for k, record in enumerate(parts):
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", SysidWarning)
            table = _error_table(model, record, None if one_step_errors is None else one_step_errors[k])
        if table is None:
            return np.zeros(model.ny), np.inf, np.inf
        if model.order:
            by_states, others = table[:, : model.order], table[:, model.order :]
            by_states = by_states[:, np.abs(by_states).max(axis=0, initial=0.0) > DIED_OUT]
            table = others - by_states @ np.linalg.lstsq(by_states, others, rcond=None)[0]
        by_offsets, errors = table[:, :-1], table[:, -1]
        gram, moment = gram + by_offsets.T @ by_offsets, moment + by_offsets.T @ errors
        total = total + float(errors @ errors)
    offset: FloatArray = np.linalg.lstsq(gram, moment, rcond=SINGULAR)[0].astype(np.float64)
    return offset, total, total - float(moment @ offset)


def unexplained_lines(model: StateSpace, parts: Sequence[IOData]) -> tuple[FloatArray, ...]:
    """Straight line in every output of each part (N_i, ny) that explains most of its one-step errors.

    Initial states are free. Lines of a predictor that diverges are zero.
    """
    return tuple(_unexplained_line(model, part) for part in parts)


def _unexplained_line(model: StateSpace, record: IOData) -> FloatArray:
    """Straight line in every output (N, ny) of one record."""
    samples, order, ny = len(record), model.order, model.ny
    rise = np.linspace(-1.0, 1.0, samples)
    at_rest = replace(record, u=np.zeros_like(record.u), y=np.where(record.known, 0.0, np.nan))
    counted = record.known.copy()
    counted[: record.window] = False
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", SysidWarning)
        columns = _unit_errors(model, record, np.eye(order + ny))
        for unit in np.eye(ny):
            rising = replace(at_rest, y=at_rest.y + rise[:, None] * unit)
            columns.append(residuals(model, rising, x0=np.zeros(order)))
        errors = residuals(model, record, x0=np.zeros(order))
    table = np.stack([column[counted] for column in columns], axis=1)
    if not np.isfinite(table).all() or not np.isfinite(errors[counted]).all():
        return np.zeros((samples, ny))
    if np.abs(table).max(initial=0.0) > ENDLESS * samples:
        return np.zeros((samples, ny))
    # scaled: states of other units than the outputs would pass for rounding
    sizes = np.linalg.norm(table, axis=0)
    sizes[sizes <= DIED_OUT] = np.inf
    solution = np.linalg.lstsq(table / sizes, errors[counted], rcond=SINGULAR)[0] / sizes
    constants, slopes = solution[order : order + ny], solution[order + ny :]
    return np.asarray(constants + rise[:, None] * slopes)


def _error_table(model: StateSpace, record: IOData, errors: FloatArray | None) -> FloatArray | None:
    """One-step errors by a unit of each initial state and each offset, and those of the record, as columns.

    The rows (rows, order + ny + 1) are the known outputs after the initialisation window; those of a long record are
    replaced by their triangular factor. None if the predictor diverges.
    """
    order = model.order
    if errors is None or not np.isfinite(errors[record.known]).all():
        errors = residuals(model, record, x0=np.zeros(order))
    # the predictor with the constant outputs as further states
    predictor = np.eye(order + model.ny)
    predictor[:order] = np.hstack((model.A - model.gain @ model.C, model.gain))
    # after a gap the predictor is another one
    block = BLOCK if record.complete else len(record)
    unit_errors = partial(_unit_errors, model)
    if record.complete and CompanionForm.of(model.A) is None:
        settled = _settled_error_table(model, record, errors)
        if settled is not None:
            return settled
        unit_errors = partial(_unit_errors_by_powers, model, predictor)
    table, starts = np.empty((0, order + model.ny + 1)), np.eye(order + model.ny)
    for first in range(0, len(record), block):
        piece = record[first : first + block]
        if first:
            starts = np.linalg.matrix_power(predictor, first)
        columns = [*unit_errors(piece, starts), errors[first : first + block]]
        # only known outputs after the initialisation window count
        in_time = np.arange(first, first + len(piece)) >= record.window
        counted = piece.known & in_time[:, None]
        rows = np.stack([column[counted] for column in columns], axis=1)
        if not np.isfinite(rows).all() or np.abs(rows[:, :-1]).max(initial=0.0) > ENDLESS:
            return None
        if len(record) <= block:
            return rows
        # a triangular factor has the least squares of all its rows
        table = np.asarray(np.linalg.qr(np.vstack((table, rows)), mode="r"))
    return table


def _settled_error_table(model: StateSpace, record: IOData, errors: FloatArray) -> FloatArray | None:
    """`_error_table` of a complete record that outlasts the initial state; None if it does not.

    Afterwards the error by a unit of each offset is constant, G, and m rows have the least squares of a few: the sum of
    (e - G o)^2 is m (mean(e) - G o)^2 plus that of (e - mean(e))^2.
    """
    order, ny = model.order, model.ny
    by_states = free_response(model.A - model.gain @ model.C, model.C, len(record))
    end = len(by_states)
    scale = float(np.abs(by_states[:1]).max(initial=0.0))
    if end >= len(record) - record.window or not np.abs(by_states[-1:]).max(initial=0.0) <= SETTLED * scale:
        return None
    by_offsets = np.tile(np.eye(ny), (end + 1, 1, 1))
    by_offsets[1:] -= np.cumsum(by_states @ model.gain, axis=0)
    first = min(record.window, end)
    transient = np.concatenate((-by_states, by_offsets[:-1], errors[:end, :, None]), axis=2)[first:]
    rest = errors[max(record.window, end) :]
    mean = rest.mean(axis=0)
    constant = np.sqrt(len(rest)) * np.hstack((np.zeros((ny, order)), by_offsets[-1], mean[:, None]))
    remainder = np.zeros((1, order + ny + 1))
    remainder[0, -1] = np.linalg.norm(rest - mean)
    table = np.vstack((transient.reshape(-1, order + ny + 1), constant, remainder))
    if not np.isfinite(table).all() or np.abs(table[:, :-1]).max(initial=0.0) > ENDLESS * np.sqrt(len(rest)):
        return None
    triangle, lengths = scaled_triangle(table)
    return triangle * lengths


def _unit_errors(model: StateSpace, piece: IOData, starts: FloatArray) -> list[FloatArray]:
    """One-step errors (N, ny) of a piece without inputs, by a unit of each initial state and each constant output.

    The columns of `starts` are the states at the beginning of the piece, which those at the beginning of the record led
    to, and the constant outputs.
    """
    at_rest = replace(piece, u=np.zeros_like(piece.u), y=np.where(piece.known, 0.0, np.nan))
    errors = []
    for k, start in enumerate(starts.T):
        constant = at_rest if k < model.order else replace(at_rest, y=at_rest.y + start[model.order :])
        errors.append(residuals(model, constant, x0=start[: model.order]))
    return errors


def _unit_errors_by_powers(
    model: StateSpace, predictor: FloatArray, piece: IOData, starts: FloatArray
) -> list[FloatArray]:
    """`_unit_errors` of complete records by powers of the predictor, for all units at once.

    Filters keep more digits where poles of polynomial models lie close together.
    """
    to_errors = np.hstack((-model.C, np.eye(model.ny)))
    responses = free_response(predictor, to_errors, len(piece))
    table = np.zeros((len(piece), model.ny, len(starts)))
    table[: len(responses)] = responses @ starts
    if len(responses) < len(piece) and np.abs(responses[-1:]).max(initial=0.0) > ENDLESS:
        # the predictor diverges, and the response ends where it is too large
        table[len(responses) :] = np.inf
    return list(np.moveaxis(table, 2, 0))
