"""State-space models by the subspace methods and gradient searches of other packages, as records of ours.

Every function takes a record and an order; a model without innovation gain is one that its package gives none with.
SLICOT's options that ask for the gain are left alone (`test_state_space.py`).
"""

from collections.abc import Callable

import numpy as np

import sysid

Method = Callable[[sysid.IOData, int], sysid.StateSpace]


def sippy(weighting: str) -> Method:
    """SIPPY's N4SID, MOESP, CVA and PARSIM, 20 block rows as is its default."""
    from sippy_unipi import system_identification

    def fit(data: sysid.IOData, order: int) -> sysid.StateSpace:
        m = system_identification(data.y, data.u, weighting, SS_fixed_order=order, SS_D_required=True)
        return sysid.StateSpace(m.A, m.B, m.C, m.D, m.K, data.dt)

    return fit


def slicot(data: sysid.IOData, order: int) -> sysid.StateSpace:
    """SLICOT's N4SID through ctrlsys, 20 block rows."""
    import ctrlsys

    rows, nu, ny = 20, data.nu, data.ny
    u, y = np.asfortranarray(data.u), np.asfortranarray(data.y)
    factor = ctrlsys.ib01ad("N", "C", "N", "O", "N", "N", rows, nu, ny, u, y, 0.0, -1.0)[1]
    A, C, B, D = ctrlsys.ib01bd("N", "A", "N", rows, order, nu, ny, len(u), factor, 0.0)[:4]
    return sysid.StateSpace(A, B, C, D, None, data.dt)


def nfoursid(data: sysid.IOData, order: int) -> sysid.StateSpace:
    """nfoursid, 20 block rows; the gain belongs to the covariances that it gives."""
    import pandas
    from nfoursid.nfoursid import NFourSID
    from scipy.linalg import solve_discrete_are

    inputs, outputs = [f"u{j}" for j in range(data.nu)], [f"y{j}" for j in range(data.ny)]
    table = pandas.DataFrame(np.hstack((data.u, data.y)), columns=inputs + outputs)
    search = NFourSID(table, output_columns=outputs, input_columns=inputs, num_block_rows=20)
    search.subspace_identification()
    m, noise = search.system_identification(rank=order)
    R, S, Q = noise[: data.ny, : data.ny], noise[data.ny :, : data.ny], noise[data.ny :, data.ny :]
    P = solve_discrete_are(m.a.T, m.c.T, Q, R, s=S)
    K = np.linalg.solve(m.c @ P @ m.c.T + R, m.c @ P @ m.a.T + S.T).T
    return sysid.StateSpace(m.a, m.b, m.c, m.d, K, data.dt)


def control_era(data: sysid.IOData, order: int) -> sysid.StateSpace:
    """python-control: pulse response by least squares, 200 values, and the eigensystem realization algorithm."""
    import control

    pulses = control.markov(data.y.T, data.u.T, 200)
    m = control.eigensys_realization(pulses, order)[0]
    return sysid.StateSpace(m.A, m.B, m.C, m.D, None, data.dt)


def jax_sysid(data: sysid.IOData, order: int) -> sysid.StateSpace:
    """jax-sysid, double precision: L-BFGS on the simulation error, initial state fitted."""
    import jax

    jax.config.update("jax_enable_x64", True)
    from jax_sysid.models import LinearModel

    model = LinearModel(order, data.ny, data.nu, feedthrough=True)
    model.loss(rho_x0=0.0, rho_th=0.0)
    model.optimization(adam_epochs=1000, lbfgs_epochs=2000, iprint=-1)
    u, y = data.u / data.u.std(axis=0), data.y / data.y.std(axis=0)
    model.fit(y, u)
    A, B, C, D = (np.asarray(m) for m in model.params[:4])
    ratio = data.y.std(axis=0)[:, None] / data.u.std(axis=0)
    return sysid.StateSpace(A, B / data.u.std(axis=0), C * data.y.std(axis=0)[:, None], D * ratio, None, data.dt)
