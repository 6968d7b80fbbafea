"""nfoursid: subspace identification after Verhaegen and Verdult."""

from contextlib import suppress

import numpy as np
from scipy.linalg import solve_discrete_are

from scenarios.estimators.answer import Answer
from scenarios.estimators.refusals import only_given_orders, only_structure
from scenarios.estimators.task import Task
from sysid import IOData, StateSpace

LEAST_ROWS, ROWS_PER_ORDER = 20, 2
"""Block rows: more than the order, as its documentation asks."""


def n4sid(data: IOData, task: Task) -> Answer:
    """Model of the order asked for; its users read an order off a diagram of eigenvalues."""
    only_structure(task, "ss")
    only_given_orders(task, "an order is read off a diagram by eye")
    return Answer(subspace(data, task.orders["order"]))


def subspace(data: IOData, order: int) -> StateSpace:
    """Model with the Kalman gain that belongs to its covariances, D as it comes out.

    Args:
        data: The record.
        order: Number of states.
    """
    import pandas
    from nfoursid.nfoursid import NFourSID

    inputs, outputs = [f"u{j}" for j in range(data.nu)], [f"y{j}" for j in range(data.ny)]
    table = pandas.DataFrame(np.hstack((data.u, data.y)), columns=inputs + outputs)
    rows = max(LEAST_ROWS, ROWS_PER_ORDER * order)
    search = NFourSID(table, output_columns=outputs, input_columns=inputs, num_block_rows=rows)
    search.subspace_identification()
    m, noise = search.system_identification(rank=order)
    R, S, Q = noise[: data.ny, : data.ny], noise[data.ny :, : data.ny], noise[data.ny :, data.ny :]
    K = None
    # Of a record without noise no gain is left to be found.
    with suppress(ValueError, np.linalg.LinAlgError):
        P = solve_discrete_are(m.a.T, m.c.T, Q, R, s=S)
        K = np.linalg.solve(m.c @ P @ m.c.T + R, m.c @ P @ m.a.T + S.T).T
    return StateSpace(m.a, m.b, m.c, m.d, K, data.dt)
