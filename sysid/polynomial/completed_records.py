"""Records with their missing outputs filled in: where the fit of a record with gaps may begin, not where it ends."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sysid.polynomial.long_arx import LongArx, arx_errors, long_arx_family, long_arx_order
from sysid.polynomial.missing_outputs import MissingOutputs
from sysid.polynomial.orders import Orders
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

ROUNDS = 12
SETTLED = 1e-2  # change of what is filled in, as a part of the errors, that ends them


def completed(experiments: Sequence[IOData], orders: Orders) -> tuple[IOData, ...]:
    """Fill gaps with conditional means under a long ARX model that is fitted to the filled record, in turns.

    Args:
        experiments: Single-output experiments.
        orders: The structure that is to be fitted.
    """
    if all(e.complete for e in experiments):
        return tuple(experiments)
    n = long_arx_order(experiments, orders, 3)
    filled = tuple(replace(e, y=_interpolated(e), missing=False) for e in experiments)
    for _ in range(ROUNDS):
        model = long_arx_family(filled, orders, n).model(n)
        better = tuple(_conditional_mean(model, e, f) for e, f in zip(experiments, filled, strict=True))
        moved = sum(float(np.sum((a.y - b.y) ** 2)) for a, b in zip(better, filled, strict=True))
        errors = sum(float(np.sum(model.errors(e)[model.skip :] ** 2)) for e in better)
        filled = better
        if moved <= SETTLED**2 * errors:
            break
    return filled


def _interpolated(experiment: IOData) -> FloatArray:
    known = experiment.known[:, 0]
    times = np.arange(len(experiment))
    return np.interp(times, times[known], experiment.y[known, 0])


def _conditional_mean(model: LongArx, experiment: IOData, filled: IOData) -> IOData:
    """Fill from `skip` on; before it the errors are not known, and what was filled in stays."""
    known = experiment.known
    y = filled.y.copy()
    y[model.skip :][~known[model.skip :]] = 0.0
    errors = arx_errors(replace(filled, y=y), model.a, model.b)[model.skip :]
    gaps = MissingOutputs.of(known[model.skip :], model.a[:, None, None])
    if gaps.count:
        y[model.skip :][~known[model.skip :]] = -gaps.best(errors[:, None, None])[:, 0]
    return replace(filled, y=y)
