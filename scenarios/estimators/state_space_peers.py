"""Other packages that identify state-space models: python-control, SLICOT, nfoursid, SIPPY's N4SID, jax-sysid."""

import os
from contextlib import suppress
from functools import partial
from typing import Any

import control
import numpy as np
from scipy.linalg import solve_discrete_are

from scenarios.estimators.outcome import Answer
from scenarios.estimators.task import Task, require
from sysid import IOData, StateSpace
from sysid.models import add_delay

PULSES, MOST_COLUMNS = 200, 0.2
"""Of python-control: values of the pulse response, and the most columns of inputs, as a share of the samples."""

LEAST_ROWS, ROWS_PER_ORDER = 20, 2
LARGEST_GAP = -1.0
"""Tolerance by which SLICOT takes the order at the largest gap between logarithms of singular values."""

N4SID, MOESP, BOTH = ("N", "N"), ("M", "M"), ("M", "C")
"""Routes of SLICOT: METH of IB01AD and of IB01BD; the third takes A and C from MOESP, B and D from N4SID.

Without noise the least-squares problem of N4SID lacks full rank, and the model is wrong. B and D of MOESP are wrong in
version 1.1.1 of ctrlsys, also without noise. Octave has the third route as `moen4`.
"""

FLAGS = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
"""Of the compiler of jax-sysid: one thread."""

ADAM_STEPS, LBFGS_STEPS = 1000, 2000
"""Of jax-sysid: without gradient descent before it, L-BFGS often ends in another minimum."""


def control_era(data: IOData, task: Task) -> Answer:
    """python-control: pulse response by least squares (`markov`), then `eigensys_realization`, D as it comes out.

    Equations that reach before the record are left out.
    """
    require(task, "ss", no_choice="it has no criterion of orders")
    count = min(PULSES, int(MOST_COLUMNS * len(data) / data.nu))
    pulses = control.markov(data.y.T, data.u.T, count, truncate=True)
    # A square Hankel matrix of all values but D: by default it would have only twice the order of rows.
    m, _ = control.eigensys_realization(pulses, task.orders["order"], m=(count - 1) // 2, n=(count - 1) // 2)
    return Answer(StateSpace(m.A, m.B, m.C, m.D, None, data.dt))


def slicot_subspace(route: tuple[str, str], data: IOData, task: Task) -> Answer:
    """SLICOT through ctrlsys, D as it comes out, no gain.

    Options for covariances or the gain are not used: with several outputs they corrupt memory in version 1.1.1.

    Args:
        route: `N4SID`, `MOESP` or `BOTH`.
        data: The record.
        task: With the number of states, or the highest of them and then that at the largest gap of singular values.
    """
    require(task, "ss")
    import ctrlsys

    order, nu, ny = task.orders.get("order"), data.nu, data.ny
    rows = block_rows(task)
    u, y = np.asfortranarray(data.u), np.asfortranarray(data.y)
    # 'M' in the third place: B and D of the MOESP route the MOESP way; the N4SID route ignores it.
    n, factor, *_, failed = ctrlsys.ib01ad(route[0], "C", "M", "O", "N", "N", rows, nu, ny, u, y, 0.0, LARGEST_GAP)
    if failed:
        raise RuntimeError(f"IB01AD ended with INFO = {failed}")
    n = min(int(n), task.most_order) if order is None else order
    A, C, B, D, *_, failed = ctrlsys.ib01bd(route[1], "A", "N", rows, n, nu, ny, len(u), factor, 0.0)
    if failed:
        raise RuntimeError(f"IB01BD ended with INFO = {failed}")
    return Answer(StateSpace(A, B, C, D, None, data.dt))


def block_rows(task: Task) -> int:
    """Block rows of the subspace methods: more than the order, as their manuals ask."""
    return max(LEAST_ROWS, ROWS_PER_ORDER * task.orders.get("order", task.most_order))


def nfoursid_n4sid(data: IOData, task: Task) -> Answer:
    """nfoursid: subspace identification after Verhaegen and Verdult, D as it comes out.

    The Kalman gain is that which belongs to its covariances.
    """
    require(task, "ss", no_choice="an order is read off a diagram by eye")
    import pandas
    from nfoursid.nfoursid import NFourSID

    inputs, outputs = [f"u{j}" for j in range(data.nu)], [f"y{j}" for j in range(data.ny)]
    table = pandas.DataFrame(np.hstack((data.u, data.y)), columns=inputs + outputs)
    search = NFourSID(table, output_columns=outputs, input_columns=inputs, num_block_rows=block_rows(task))
    search.subspace_identification()
    m, noise = search.system_identification(rank=task.orders["order"])
    # Its joint covariance has the noise of the outputs before that of the states.
    R, S = noise[: data.ny, : data.ny], noise[data.ny :, : data.ny]
    Q = noise[data.ny :, data.ny :]
    K = None
    # A record without noise leaves no gain to be computed.
    with suppress(ValueError, np.linalg.LinAlgError):
        P = solve_discrete_are(m.a.T, m.c.T, Q, R, s=S)
        innovation_covariance = m.c @ P @ m.c.T + R
        K = np.linalg.solve(innovation_covariance, m.c @ P @ m.a.T + S.T).T
    return Answer(StateSpace(m.a, m.b, m.c, m.d, K, data.dt))


def sippy_n4sid(data: IOData, task: Task, *, weighting: str = "N4SID", direct: bool = False) -> Answer:
    """SIPPY: subspace projection with a Kalman gain.

    Args:
        data: The record.
        task: Order, or the highest of those among which BIC chooses.
        weighting: `N4SID`, `MOESP`, `CVA` or `PARSIM-K`.
        direct: Whether D is estimated.
    """
    require(task, "ss")
    from sippy_unipi import system_identification

    rows = block_rows(task)
    orders: dict[str, Any] = {"SS_fixed_order": task.orders.get("order")}
    if task.chooses:
        orders = {"SS_orders": [1, task.most_order], "IC": "BIC"}
    m = system_identification(
        data.y.copy(), data.u.copy(), weighting, tsample=data.dt, SS_f=rows, SS_p=rows, SS_D_required=direct, **orders
    )
    # Without a gain it returns an empty one.
    gain = m.K if np.size(m.K) else None
    return Answer(StateSpace(m.A, m.B, m.C, m.D, gain, data.dt))


def jax_sysid_oe(data: IOData, task: Task) -> Answer:
    """jax-sysid: output error with as many states as the structure has, a delay beyond one sample moved to the input.

    It cannot hold single coefficients at zero: where B has fewer coefficients than F, its model has more parameters.
    """
    require(task, "oe", delayed=True, no_choice="it has no criterion of orders")
    n, shift = task.orders, task.orders["nk"] - 1
    late = data if not shift else IOData(data.u[:-shift], data.y[shift:], data.dt)
    return Answer(add_delay(jax_output_error(late, max(n["nf"], n["nb"]), direct=False), shift))


def jax_output_error(data: IOData, order: int, *, direct: bool) -> StateSpace:
    """Model by jax-sysid that minimises the simulation error in 64 bits, initial state fitted, no penalties.

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
    D = np.zeros((data.ny, data.nu))
    if direct:
        D = np.asarray(model.params[3]) * of_y[:, None] / of_u
    return StateSpace(A, B / of_u, C * of_y[:, None], D, None, data.dt)


slicot_moen4, slicot_n4sid, slicot_moesp = (partial(slicot_subspace, route) for route in (BOTH, N4SID, MOESP))
