"""Simulation: the output that the input alone makes, or input and noise."""

import numpy as np
from numpy.typing import ArrayLike

from sysid.models.delta_method import standard_directions
from sysid.models.estimate import Estimate
from sysid.models.recursion import state_trajectory
from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray, real_array
from sysid.records.errors import SysidError


def simulate(
    model: StateSpace | Estimate, u: ArrayLike, *, x0: ArrayLike | None = None, rng: np.random.Generator | None = None
) -> FloatArray:
    """Output of x(t+1) = A x + B u + K e, y = C x + D u + e; without `rng` there is no noise, e = 0.

    Args:
        model: The model, or an estimate of it.
        u: Inputs (N, nu); 1-D for one input.
        x0: State at the first sample (n,); zero when None. (`predict` and `compare` estimate it instead.)
        rng: Source of normal innovations e with the model's innovation covariance: another realisation of the
            disturbance every time.

    Returns:
        Outputs (N, ny).

    Raises:
        SysidError: Inputs or initial state that do not fit the model; noise of a model without innovation covariance.
    """
    m = as_model(model)
    inputs, start = as_inputs(m, u), as_state(m, x0)
    if rng is None:
        return output(m, inputs, start)
    if not isinstance(rng, np.random.Generator):
        raise SysidError(f"rng: expected a numpy.random.Generator, got {type(rng).__name__}")
    if m.innovation_covariance is None:
        raise SysidError(
            "the model has no innovation covariance, so that the size of its noise is not known; "
            "dataclasses.replace(model, innovation_covariance=...) gives it one"
        )
    e = rng.standard_normal((len(inputs), m.ny)) @ standard_directions(m.innovation_covariance).T
    states = state_trajectory(m.A, inputs @ m.B.T + e @ m.gain.T, start)
    return states @ m.C.T + inputs @ m.D.T + e


def output(model: StateSpace, u: FloatArray, x0: FloatArray) -> FloatArray:
    """Output for checked inputs."""
    return state_trajectory(model.A, u @ model.B.T, x0) @ model.C.T + u @ model.D.T


def as_model(model: StateSpace | Estimate) -> StateSpace:
    """The state-space model itself.

    Raises:
        SysidError: Something else was given.
    """
    if isinstance(model, Estimate):
        return model.model
    if not isinstance(model, StateSpace):
        raise SysidError(f"expected a StateSpace or an Estimate, got {type(model).__name__}")
    return model


def as_inputs(model: StateSpace, u: ArrayLike) -> FloatArray:
    """Inputs as (N, nu), checked against the model.

    Raises:
        SysidError: Wrong shape, NaN.
    """
    out = real_array("u", u)
    if out.ndim == 1:
        out = out[:, None]
    if out.ndim != 2 or out.shape[1] != model.nu or not len(out):
        raise SysidError(f"u: expected shape (N, {model.nu}), time first, got {np.shape(u)}")
    return out


def as_state(model: StateSpace, x0: ArrayLike | None) -> FloatArray:
    """Initial state (n,), zero when None.

    Raises:
        SysidError: Wrong length, NaN.
    """
    if x0 is None:
        return np.zeros(model.order)
    out = np.atleast_1d(real_array("x0", x0))
    if out.shape != (model.order,):
        raise SysidError(f"x0: expected one value per state, shape ({model.order},), got {out.shape}")
    return out
