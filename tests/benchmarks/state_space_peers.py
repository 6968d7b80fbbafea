"""State-space models by the subspace methods and gradient searches of other packages, as records of ours.

Every function takes a record and an order; a model without innovation gain is one that its package gives none with.
SLICOT's options that ask for the gain are left alone (`test_state_space.py`).
"""

from collections.abc import Callable

import numpy as np

import sysid
from scenarios.estimators.task import Task

Method = Callable[[sysid.IOData, int], sysid.StateSpace]


def sippy(weighting: str) -> Method:
    """SIPPY's N4SID, MOESP, CVA and PARSIM."""
    from scenarios.estimators.state_space_peers import sippy_subspace

    return lambda data, order: sippy_subspace(data, asked(order), weighting, direct=True)


def slicot(data: sysid.IOData, order: int) -> sysid.StateSpace:
    """SLICOT's N4SID through ctrlsys."""
    from scenarios.estimators.state_space_peers import N4SID, slicot_subspace

    return slicot_subspace(N4SID, data, order, order)


def nfoursid(data: sysid.IOData, order: int) -> sysid.StateSpace:
    """nfoursid; the gain belongs to the covariances that it gives."""
    from scenarios.estimators.state_space_peers import nfoursid_subspace

    return nfoursid_subspace(data, order)


def control_era(data: sysid.IOData, order: int) -> sysid.StateSpace:
    """python-control: pulse response by least squares, 200 values, and the eigensystem realization algorithm."""
    import control

    pulses = control.markov(data.y.T, data.u.T, 200)
    m = control.eigensys_realization(pulses, order)[0]
    return sysid.StateSpace(m.A, m.B, m.C, m.D, None, data.dt)


def jax_sysid(data: sysid.IOData, order: int) -> sysid.StateSpace:
    """jax-sysid, double precision: the simulation error, initial state fitted."""
    from scenarios.estimators.state_space_peers import jax_output_error

    return jax_output_error(data, order, direct=True)


def asked(order: int) -> Task:
    """The task of a state-space model."""
    return Task("ss", {"order": order}, order, np.ones(1))
