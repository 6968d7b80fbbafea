"""SLICOT's subspace identification through ctrlsys.

Its options that ask for covariances or the Kalman gain are left alone: with several outputs they corrupt the memory of
the process in version 1.1.1.
"""

import numpy as np

from scenarios.estimators.answer import Answer
from scenarios.estimators.refusals import only_structure
from scenarios.estimators.task import Task
from sysid import IOData, StateSpace

LEAST_ROWS, ROWS_PER_ORDER = 20, 2
"""Block rows: more than the order, as its manual asks."""

LARGEST_GAP = -1.0
"""Tolerance by which it takes the order at the largest gap between logarithms of singular values."""


N4SID, MOESP, BOTH = ("N", "N"), ("M", "M"), ("M", "C")
"""Routes: METH of IB01AD and of IB01BD; the third takes A and C from MOESP, B and D from N4SID."""


def moen4(data: IOData, task: Task) -> Answer:
    """Its combined route, as Octave has it under this name."""
    return _answered(BOTH, data, task)


def n4sid(data: IOData, task: Task) -> Answer:
    """Its N4SID route; without noise its least-squares problem has no full rank, and the model is another."""
    return _answered(N4SID, data, task)


def moesp(data: IOData, task: Task) -> Answer:
    """Its MOESP route, whose B and D are wrong in version 1.1.1 of the wrapper, also of records without noise."""
    return _answered(MOESP, data, task)


def subspace(route: tuple[str, str], data: IOData, order: int | None, most_order: int) -> StateSpace:
    """Model by a subspace method, D as it comes out, no gain.

    Args:
        route: `N4SID`, `MOESP` or `BOTH`.
        data: The record.
        order: Number of states; None for that at the largest gap of the singular values.
        most_order: The highest order then.
    """
    import ctrlsys

    rows, nu, ny = max(LEAST_ROWS, ROWS_PER_ORDER * (order or most_order)), data.nu, data.ny
    u, y = np.asfortranarray(data.u), np.asfortranarray(data.y)
    # 'M' in the third place: B and D of the MOESP route the MOESP way; the N4SID route does not look at it.
    found, factor, *_, failed = ctrlsys.ib01ad(route[0], "C", "M", "O", "N", "N", rows, nu, ny, u, y, 0.0, LARGEST_GAP)
    if failed:
        raise RuntimeError(f"IB01AD ended with INFO = {failed}")
    n = min(int(found), most_order) if order is None else order
    A, C, B, D, *_, failed = ctrlsys.ib01bd(route[1], "A", "N", rows, n, nu, ny, len(u), factor, 0.0)
    if failed:
        raise RuntimeError(f"IB01BD ended with INFO = {failed}")
    return StateSpace(A, B, C, D, None, data.dt)


def _answered(route: tuple[str, str], data: IOData, task: Task) -> Answer:
    only_structure(task, "ss")
    return Answer(subspace(route, data, task.orders.get("order"), task.most_order))
