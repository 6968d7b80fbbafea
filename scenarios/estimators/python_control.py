"""python-control: pulse response by least squares, then the eigensystem realisation."""

import control

from scenarios.estimators.answer import Answer
from scenarios.estimators.refusals import only_given_orders, only_structure
from scenarios.estimators.task import Task
from sysid import IOData, StateSpace

PULSES, MOST_COLUMNS = 200, 0.2
"""Values of the pulse response, and the columns of inputs, as a part of the samples, at most."""


def era(data: IOData, task: Task) -> Answer:
    """`markov` and `eigensys_realization`; no model of the noise, no covariance."""
    only_structure(task, "ss")
    only_given_orders(task, "it has no criterion of orders")
    return Answer(realised(data, task.orders["order"]))


def realised(data: IOData, order: int) -> StateSpace:
    """Model from the pulse response, D as it comes out.

    Args:
        data: The record; equations that reach before it are left out.
        order: Number of states.
    """
    count = min(PULSES, int(MOST_COLUMNS * len(data) / data.nu))
    pulses = control.markov(data.y.T, data.u.T, count, truncate=True)
    # A square Hankel matrix of all values but D: by default it would have but twice the order of rows.
    found, _ = control.eigensys_realization(pulses, order, m=(count - 1) // 2, n=(count - 1) // 2)
    return StateSpace(found.A, found.B, found.C, found.D, None, data.dt)
