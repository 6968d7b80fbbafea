"""Choice of ARX orders and delay, all candidates from one factorisation."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from sysid.polynomial.data_checks import check_excitation
from sysid.polynomial.least_squares import triangular_factor
from sysid.polynomial.orders import Orders, make_orders
from sysid.polynomial.polynomial_estimate import check_enough_data, check_single_output
from sysid.polynomial.regressors import arx_regressors
from sysid.records.arguments import whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments, in_sequence_of
from sysid.records.errors import SysidError, warn_each
from sysid.validation.structure_scan import StructureTable, make_table

Choices = int | Sequence[int] | Sequence[tuple[int, ...]]


def selstruc(
    data: IOData | Sequence[IOData],
    na: int | Sequence[int],
    nb: Choices,
    nk: Choices = 1,
    *,
    validation: IOData | Sequence[IOData] | None = None,
    folds: int = 0,
) -> StructureTable:
    """Fit and rank every ARX structure of a grid: MATLAB's `arxstruc` and `selstruc` in one [Ljung1999, sec. 16.4].

    One QR factorisation of all regressors replaces the data: each candidate is a least-squares problem on some columns
    of its triangle. Every candidate is judged on the same samples.

    Args:
        data: One experiment, or several that share the model; one output.
        na: Degrees of A to try.
        nb: Numbers of coefficients of B to try; with several inputs each entry holds for all of them, or is a tuple.
        nk: Delays to try, likewise.
        validation: Validation data for the one-step errors.
        folds: Number of consecutive parts for cross-validation instead, each part predicted by a model fitted to the
            others; 0 for none.

    Returns:
        Every candidate with all criteria, the best in validation first, or by BIC without validation data.

    Raises:
        SysidError: Constant input, several outputs, nothing to try, too many orders for the data, or both
            `validation` and `folds`.
    """
    experiments = as_experiments(data)
    check_single_output(experiments)
    nu = experiments[0].nu
    candidates = []
    for a, b, k in product(_choices("na", na), _choices("nb", nb), _choices("nk", nk)):
        candidates.append(make_orders(nu, na=a, nb=_per_input(b, nu), nk=_per_input(k, nu)))
    if validation is not None and folds:
        raise SysidError(f"expected validation data or folds, not both; got folds = {folds}")
    union = _union(candidates)
    warn_each(check_excitation(experiments, [0] * nu))
    # the regressors begin where all their lags are in the record, so there are no initial conditions to estimate
    rows = check_enough_data(experiments, union, transients=0)
    folds = whole_number("folds", folds, 0, rows)
    if folds == 1:
        raise SysidError("folds must be 0, or a whole number of parts >= 2, got 1")
    columns = np.vstack([_columns(e, union) for e in experiments])
    power = float(np.mean(columns[:, -1] ** 2))
    # columns of about equal length for the factorisation; losses are scaled back
    lengths = np.sqrt(np.mean(columns**2, axis=0))
    lengths[lengths == 0.0] = 1.0
    columns /= lengths
    factor = triangular_factor(columns)
    judged: list[_FitAndCheck] = []
    judged_rows = rows
    if validation is not None:
        held_out = _validation_columns(experiments[0], validation, union) / lengths
        judged, judged_rows = [_FitAndCheck(factor, held_out)], len(held_out)
    elif folds:
        judged = _folds(columns, folds)

    loss, checked = [], []
    for candidate in candidates:
        index = _index(candidate, union)
        # the last entry of the triangle is the root of the sum of squares that the other columns leave
        used = np.append(index, factor.shape[1] - 1)
        triangle = np.asarray(np.linalg.qr(factor[:, used], mode="r"))
        loss.append(float(triangle[-1, -1] * lengths[-1]) ** 2 / rows)
        squares = 0.0 if judged else np.nan
        for pair in judged:
            squares += pair.squared_errors(index)
        checked.append(squares * lengths[-1] ** 2 / judged_rows)
    return make_table(
        ("na", "nb", "nk"),
        [tuple(c.select("na", "nb", "nk").values()) for c in candidates],
        [c.count for c in candidates],
        loss,
        checked,
        samples=rows,
        power=power,
    )


@dataclass(frozen=True, eq=False)
class _FitAndCheck:
    """Regressors and output, last, of the data of a fit and of those that it is judged on, or triangles of both."""

    fit: FloatArray
    check: FloatArray

    def squared_errors(self, index: "np.ndarray[tuple[int], np.dtype[np.int_]]") -> float:
        """Sum of squared errors of a model of some regressors."""
        theta, *_ = np.linalg.lstsq(self.fit[:, index], self.fit[:, -1], rcond=None)
        return float(np.sum((self.check[:, -1] - self.check[:, index] @ theta) ** 2))


def _folds(columns: FloatArray, folds: int) -> list[_FitAndCheck]:
    """Triangles of the other parts, and of the part itself, for consecutive parts of the rows."""
    factors = [triangular_factor(rows) for rows in np.array_split(columns, folds)]
    pairs = []
    for k, factor in enumerate(factors):
        # the triangle of stacked triangles is that of the stacked rows
        others = np.vstack(factors[:k] + factors[k + 1 :])
        pairs.append(_FitAndCheck(triangular_factor(others), factor))
    return pairs


def _validation_columns(first: IOData, validation: IOData | Sequence[IOData], union: Orders) -> FloatArray:
    """Regressors and output of validation data, channels in the sequence of the data of the fit."""
    records = as_experiments(validation)
    nu, ny = records[0].nu, records[0].ny
    if (nu, ny) != (first.nu, 1):
        raise SysidError(f"validation data need {first.nu} input(s) and 1 output, got {nu} and {ny}")
    in_sequence = [in_sequence_of(first, e, owner="the data", other="the validation data") for e in records]
    check_enough_data(in_sequence, union, transients=0)
    return np.vstack([_columns(e, union) for e in in_sequence])


def _choices(name: str, value: Any) -> list[Any]:
    """Values to try, from one or several."""
    # a text, and an array of no dimension, are refused as numbers; to iterate over them would fail less clearly
    scalar = isinstance(value, str | bytes) or (isinstance(value, np.ndarray) and not value.ndim)
    if scalar or not isinstance(value, Iterable):
        return [whole_number(name, value, 0)]
    choices = list(value)
    if not choices:
        raise SysidError(f"{name}: expected at least one value to try, got none")
    return choices


def _per_input(order: int | tuple[int, ...], nu: int) -> tuple[int, ...]:
    """An order for each input, from one for all or one for each."""
    return tuple(order) if isinstance(order, Iterable) else (whole_number("order", order, 0),) * nu


def _union(candidates: Sequence[Orders]) -> Orders:
    """Smallest structure with the regressors of all candidates."""
    nb, nk = [], []
    for j in range(len(candidates[0].nb)):
        earliest = min(c.nk[j] for c in candidates)
        latest = max(c.nk[j] + c.nb[j] for c in candidates)
        nk.append(earliest)
        nb.append(latest - earliest)
    return make_orders(len(nb), na=max(c.na for c in candidates), nb=tuple(nb), nk=tuple(nk))


def _columns(e: IOData, orders: Orders) -> FloatArray:
    """Regressors, and the output as last column."""
    start = orders.first_row(e.window)
    phi = arx_regressors(e.y[:, 0], e.u, orders.na, orders.nb, orders.nk, start)
    return np.hstack((phi, e.y[start:]))


def _index(candidate: Orders, union: Orders) -> "np.ndarray[tuple[int], np.dtype[np.int_]]":
    """Columns of a candidate's regressors among those of all candidates."""
    blocks = [np.arange(candidate.na)]
    begin = union.na
    for j, (nb, nk) in enumerate(zip(candidate.nb, candidate.nk, strict=True)):
        blocks.append(begin + nk - union.nk[j] + np.arange(nb))
        begin += union.nb[j]
    return np.concatenate(blocks)
