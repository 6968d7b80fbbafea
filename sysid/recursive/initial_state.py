"""Where a recursion begins: at nothing, at parameters, at an estimate, or where another one stopped."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from sysid.models.estimate import Estimate
from sysid.polynomial.orders import Orders
from sysid.records.arrays import FloatArray, real_array
from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.recursive.adaptation import Adaptation
from sysid.recursive.channels import Channel, stable
from sysid.recursive.recursive_estimate import RecursiveEstimate, RecursiveState

CAUTIOUS = 1e2
"""Initial variance where regressors depend on parameters: the first steps would be wild ones."""

Start = ArrayLike | Estimate | RecursiveEstimate | RecursiveState | None


def begin(
    data: IOData,
    orders: Orders,
    channels: Sequence[Channel],
    adaptation: Adaptation,
    start: Start,
    P0: ArrayLike | None,
) -> RecursiveState:
    """State before the first sample.

    Args:
        data: The record.
        orders: The structure.
        channels: What is regressed on.
        adaptation: Rule of the gain.
        start: Parameters (p,), an estimate of the same structure, or what to go on from; zero when None.
        P0: Initial P: a number, one per parameter, or a matrix.

    Raises:
        SysidError: A start or a P0 that does not fit, or a start that is not stable.
    """
    p = orders.count
    adaptation.check(p)
    if isinstance(start, RecursiveEstimate):
        start = start.state
    if isinstance(start, RecursiveState):
        return _resumed(data, orders, adaptation, start, P0)
    squares = weight = 0.0
    if isinstance(start, Estimate):
        _check_structure(orders, start)
        theta = np.array(start.parameters)
        variance = float(start.noise_variance[0, 0])
        # errors that the estimate has seen count as if the recursion had
        weight = float(len(start.residuals))
        squares = variance * max(weight - p, 1.0)
    else:
        theta = np.zeros(p) if start is None else real_array("start", start).copy()
        if theta.shape != (p,):
            raise SysidError(f"start: expected {p} parameters ({', '.join(orders.names)}), got shape {theta.shape}")
    if not stable(theta, {c.denominator for c in channels}):
        raise SysidError(f"start: expected C and F stable, got {dict(zip(orders.names, theta, strict=True))}")
    if P0 is not None:
        P = _matrix("P0", P0, p)
    elif isinstance(start, Estimate) and variance > 0.0 and np.isfinite(start.covariance).all():
        P = adaptation.prior(start.covariance, variance)
    else:
        linear = all(c.signal is not None for c in channels)
        P = np.diag((adaptation.diffuse if linear else CAUTIOUS) / _mean_squares(data, channels, p))
    return RecursiveState(
        orders=orders,
        adaptation=adaptation,
        theta=theta,
        memory=adaptation.enter(P),
        phi=np.zeros(p),
        psi=np.zeros(p),
        filters=tuple(np.zeros(c.denominator[1] - c.denominator[0]) for c in channels),
        made=(0.0,) * len(channels),
        tails=tuple(np.zeros(c.delay) for c in channels),
        dt=data.dt,
        squares=squares,
        weight=weight,
    )


def _resumed(
    data: IOData, orders: Orders, adaptation: Adaptation, state: RecursiveState, P0: ArrayLike | None
) -> RecursiveState:
    if state.orders != orders:
        raise SysidError(f"start: expected a recursion of {orders}, got one of {state.orders}")
    if not np.isclose(data.dt, state.dt, rtol=1e-6, atol=0.0):
        raise SysidError(f"start: expected samples every {state.dt} s as before, got {data.dt} s")
    if P0 is not None:
        return replace(state, adaptation=adaptation, memory=adaptation.enter(_matrix("P0", P0, orders.count)))
    if adaptation == state.adaptation:
        return state
    return replace(state, adaptation=adaptation, memory=adaptation.enter(state.scaled_covariance))


def _check_structure(orders: Orders, start: Estimate) -> None:
    if start.parameter_names != orders.names or start.polynomials is None:
        raise SysidError(
            f"start: expected an estimate with parameters {', '.join(orders.names)}, got one by {start.method} with "
            f"{', '.join(start.parameter_names)}"
        )
    delays = np.atleast_1d(start.orders.get("nk", orders.nk))
    if tuple(int(k) for k in np.broadcast_to(delays, len(orders.nk))) != orders.nk:
        raise SysidError(f"start: expected an estimate with nk = {orders.nk}, got {start.orders['nk']}")


def _matrix(name: str, value: ArrayLike, p: int) -> FloatArray:
    given = real_array(name, value)
    P = np.diag(np.broadcast_to(given, p)) if given.ndim < 2 and given.shape in ((), (p,)) else given
    if P.shape != (p, p):
        raise SysidError(f"{name}: expected a number, ({p},) or {(p, p)}, got shape {given.shape}")
    if not np.allclose(P, P.T, rtol=1e-9) or not (np.diag(P) > 0.0).all():
        raise SysidError(f"{name} must be symmetric with variances above 0, got {value!r}")
    return np.array(P, dtype=float)


def _mean_squares(data: IOData, channels: Sequence[Channel], p: int) -> FloatArray:
    """Mean square of each regressor (p,); what the model makes is as large as the output, at most."""
    out = np.ones(p)
    for c in channels:
        signal = data.y[:, 0] if c.signal is None else c.signal
        out[c.place] = float(np.mean(signal**2)) or 1.0
    return out
