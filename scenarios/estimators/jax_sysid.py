"""jax-sysid: an output-error fit of a state-space model by L-BFGS, in 64 bits."""

import os

import numpy as np

from scenarios.estimators.answer import Answer
from scenarios.estimators.delayed_model import delayed
from scenarios.estimators.refusals import only_delayed, only_given_orders, only_structure
from scenarios.estimators.task import Task
from sysid import IOData, StateSpace

FLAGS = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
"""Of its compiler: one thread."""

ADAM_STEPS, LBFGS_STEPS = 1000, 2000
"""First by gradient descent, then by L-BFGS: without the first it often ends in another minimum."""


def oe(data: IOData, task: Task) -> Answer:
    """Output error: as many states as the structure has, a delay beyond one sample taken from the input.

    It cannot hold single coefficients at zero: where B has fewer coefficients than F, its model has more parameters.
    """
    only_structure(task, "oe")
    only_delayed(task)
    only_given_orders(task, "it has no criterion of orders")
    n, shift = task.orders, task.orders["nk"] - 1
    late = data if not shift else IOData(data.u[:-shift], data.y[shift:], data.dt)
    model = output_error(late, max(n["nf"], n["nb"]), direct=False)
    return Answer(delayed(model, shift))


def output_error(data: IOData, order: int, *, direct: bool) -> StateSpace:
    """Model that minimises the simulation error, the initial state fitted, without penalties on either.

    Args:
        data: The record; channels are scaled to one, their means stay.
        order: Number of states.
        direct: Whether D is estimated.
    """
    # Read when the compiler loads.
    os.environ.setdefault("XLA_FLAGS", FLAGS)
    import jax
    from jax_sysid.models import LinearModel

    jax.config.update("jax_enable_x64", True)
    model = LinearModel(order, data.ny, data.nu, feedthrough=direct)
    model.loss(rho_x0=0.0, rho_th=0.0)
    model.optimization(adam_epochs=ADAM_STEPS, lbfgs_epochs=LBFGS_STEPS, iprint=-1)
    of_u, of_y = np.std(data.u, axis=0), np.std(data.y, axis=0)
    model.fit(data.y / of_y, data.u / of_u)
    A, B, C = (np.asarray(matrix) for matrix in model.params[:3])
    D = np.asarray(model.params[3]) * of_y[:, None] / of_u if direct else np.zeros((data.ny, data.nu))
    return StateSpace(A, B / of_u, C * of_y[:, None], D, None, data.dt)
