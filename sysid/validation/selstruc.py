"""Choice of ARX orders and delay, all candidates from one factorisation."""

from collections.abc import Iterable, Sequence
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
    """Fit every ARX structure of a grid and rank them [Ljung1999, sec. 16.4].

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
    candidates = [
        make_orders(nu, na=a, nb=_spread(b, nu), nk=_spread(k, nu))
        for a, b, k in product(_choices("na", na), _choices("nb", nb), _choices("nk", nk))
    ]
    if validation is not None and folds:
        raise SysidError(f"expected validation data or folds, not both; got folds = {folds}")
    every = _union(candidates)
    warn_each(check_excitation(experiments, [0] * nu))
    rows = check_enough_data(experiments, every, transients=0)
    folds = whole_number("folds", folds, 0, rows)
    if folds == 1:
        raise SysidError("folds must be 0, or a whole number of parts >= 2, got 1")
    columns = np.vstack([_columns(e, every) for e in experiments])
    power = float(np.mean(columns[:, -1] ** 2))
    # columns of about equal length for the factorisation; losses are scaled back
    lengths = np.sqrt(np.mean(columns**2, axis=0))
    lengths[lengths == 0.0] = 1.0
    columns /= lengths
    whole = triangular_factor(columns)
    pairs: list[tuple[FloatArray, FloatArray]] = []
    held_rows = rows
    if validation is not None:
        others = as_experiments(validation)
        if (others[0].nu, others[0].ny) != (nu, 1):
            raise SysidError(f"validation data need {nu} input(s) and 1 output, got {others[0].nu} and {others[0].ny}")
        others = tuple(in_sequence_of(experiments[0], e, owner="the data", other="the validation data") for e in others)
        check_enough_data(others, every, transients=0)
        pairs = [(whole, np.vstack([_columns(e, every) for e in others]) / lengths)]
        held_rows = len(pairs[0][1])
    elif folds:
        factors = [triangular_factor(part) for part in np.array_split(columns, folds)]
        rest = (triangular_factor(np.vstack(factors[:k] + factors[k + 1 :])) for k in range(folds))
        pairs = list(zip(rest, factors, strict=True))

    loss, checked = [], []
    for candidate in candidates:
        index = _index(candidate, every)
        columns_used = np.append(index, whole.shape[1] - 1)
        factor = np.asarray(np.linalg.qr(whole[:, columns_used], mode="r"))
        loss.append(float(factor[-1, -1] * lengths[-1]) ** 2 / rows)
        squares = 0.0 if pairs else np.nan
        for fit, other in pairs:
            theta, *_ = np.linalg.lstsq(fit[:, index], fit[:, -1], rcond=None)
            squares += float(np.sum((other[:, -1] - other[:, index] @ theta) ** 2))
        checked.append(squares * lengths[-1] ** 2 / held_rows)
    return make_table(
        ("na", "nb", "nk"),
        [tuple(c.select("na", "nb", "nk").values()) for c in candidates],
        [c.count for c in candidates],
        loss,
        checked,
        samples=rows,
        power=power,
    )


def _choices(name: str, value: Any) -> list[Any]:
    scalar = isinstance(value, str | bytes) or (isinstance(value, np.ndarray) and not value.ndim)
    entries = list(value) if isinstance(value, Iterable) and not scalar else [whole_number(name, value, 0)]
    if not entries:
        raise SysidError(f"{name}: expected at least one value to try, got none")
    return entries


def _spread(entry: int | tuple[int, ...], nu: int) -> tuple[int, ...]:
    return (entry,) * nu if isinstance(entry, int | np.integer) else tuple(entry)


def _union(candidates: Sequence[Orders]) -> Orders:
    """Smallest structure with the regressors of all candidates."""
    nu = len(candidates[0].nb)
    nk = tuple(min(c.nk[j] for c in candidates) for j in range(nu))
    nb = tuple(max(c.nk[j] + c.nb[j] for c in candidates) - nk[j] for j in range(nu))
    return make_orders(nu, na=max(c.na for c in candidates), nb=nb, nk=nk)


def _columns(e: IOData, orders: Orders) -> FloatArray:
    """Regressors, and the output as last column."""
    start = orders.first_row(e.window)
    phi = arx_regressors(e.y[:, 0], e.u, orders.na, orders.nb, orders.nk, start)
    return np.hstack((phi, e.y[start:]))


def _index(candidate: Orders, every: Orders) -> np.ndarray[tuple[int], np.dtype[np.int_]]:
    parts = [np.arange(candidate.na)]
    offset = every.na
    for nb, nk, all_nb, all_nk in zip(candidate.nb, candidate.nk, every.nb, every.nk, strict=True):
        parts.append(offset + nk - all_nk + np.arange(nb))
        offset += all_nb
    return np.concatenate(parts)
