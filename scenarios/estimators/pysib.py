"""Estimators of pysib: one input, one output; they claim no covariance.

Where a search ends in a predictor that is not stable, its variant with filtered data is run, as its warning advises.
"""

import warnings

import numpy as np

from scenarios.estimators.answer import Answer
from scenarios.estimators.refusals import only_given_orders, only_one_channel, only_structure
from scenarios.estimators.task import STRUCTURES, Task
from sysid import IOData, Polynomials
from sysid.models import innovations_form


def arx(data: IOData, task: Task) -> Answer:
    """Least squares."""
    return _fitted("arx", None, data, task)


def armax(data: IOData, task: Task) -> Answer:
    """Prediction error from the ARX model."""
    return _fitted("armax", "armax_filtered", data, task)


def oe(data: IOData, task: Task) -> Answer:
    """Prediction error from the ARX model."""
    return _fitted("oe", "oe_filtered", data, task)


def bj(data: IOData, task: Task) -> Answer:
    """Prediction error from the ARX model."""
    return _fitted("bj", "bj_filtered", data, task)


def _fitted(structure: str, filtered: str | None, data: IOData, task: Task) -> Answer:
    only_structure(task, structure)
    only_one_channel(data)
    only_given_orders(task, "it has no criterion of orders")
    import pysib

    orders = [task.orders[name] for name in STRUCTURES[structure]]
    u, y = data.u[:, 0].copy(), data.y[:, 0].copy()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        _, found = getattr(pysib, structure)(u, y, *orders)
        if filtered is not None and any("unit circle" in str(one.message) for one in caught):
            _, found = getattr(pysib, filtered)(u, y, *orders)
    polynomials = Polynomials(*(np.asarray(found[name], dtype=float) for name in "ABCDF"))
    return Answer(innovations_form(polynomials, data.dt), polynomials)
