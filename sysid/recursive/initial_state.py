"""Initial state of recursive estimators, and the channels that their regressors are built from."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from sysid.models.estimate import Estimate
from sysid.models.polynomials import distance_bound
from sysid.models.predict import channels_in
from sysid.polynomial.orders import Orders
from sysid.records.arrays import FloatArray, real_array
from sysid.records.channels import listed
from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.recursive.adaptation import Adaptation
from sysid.recursive.recursive_estimate import RecursiveEstimate, RecursiveState

Denominator = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Channel:
    """A signal whose lags are regressors.

    Attributes:
        place: Indices of its lags among the regressors.
        sign: Sign of the lags in the prediction.
        denominator: Range of the parameters of the filter that turns regressors into gradients; empty for none.
        signal: Its samples (N,); None if the model generates them.
        delay: Delay in samples.
        paths: Places whose sum is the simulated output; empty for the errors.
    """

    place: slice
    sign: float
    denominator: Denominator
    signal: FloatArray | None
    delay: int = 0
    paths: tuple[slice, ...] = ()


def regressed_channels(data: IOData, orders: Orders) -> list[Channel]:
    """Layout of the regressors of an ARX, ARMAX or OE model."""
    of_a, of_b, of_c, _, of_f = orders.ranges
    c_range = of_c.start, of_c.stop
    channels = [Channel(of_a, -1.0, c_range, data.y[:, 0], 1)]
    for j, (of_bj, of_fj) in enumerate(zip(of_b, of_f, strict=True)):
        f_range = of_fj.start, of_fj.stop
        denominator = f_range if orders.nf[j] else c_range
        channels.append(Channel(of_bj, 1.0, denominator, data.u[:, j], orders.nk[j]))
        channels.append(Channel(of_fj, -1.0, f_range, None, 0, (of_bj, of_fj)))
    channels.append(Channel(of_c, 1.0, c_range, None))
    # an order of 0 gives no regressor
    return [channel for channel in channels if channel.place.stop > channel.place.start]


def has_stable_denominators(theta: FloatArray, denominators: Iterable[Denominator]) -> bool:
    """Whether every denominator is stable."""
    polynomials = ([1.0, *theta[begin:end].tolist()] for begin, end in denominators)
    return all(distance_bound(polynomial) > 0.0 for polynomial in polynomials)


CAUTIOUS = 1e2  # initial variance if regressors depend on parameters: a larger one makes the first steps erratic

Start = ArrayLike | Estimate | RecursiveEstimate | RecursiveState | None


def starting_state(
    data: IOData,
    orders: Orders,
    channels: Sequence[Channel],
    adaptation: Adaptation,
    start: Start,
    P0: ArrayLike | None,
) -> RecursiveState:
    """State before the first sample: from zero, parameters, an estimate of the same structure, or a recursion."""
    p = orders.count
    adaptation.check(p)
    if isinstance(start, RecursiveEstimate):
        start = start.state
    if isinstance(start, RecursiveState):
        return _resumed_state(data, orders, adaptation, start, P0)
    squares = weight = 0.0
    if isinstance(start, Estimate):
        _check_structure(data, orders, start)
        theta = np.array(start.parameters)
        variance = float(start.noise_variance[0, 0])
        # the samples of the estimate count as samples of the recursion
        weight = float(len(start.residuals))
        squares = variance * max(weight - p, 1.0)
    else:
        theta = np.zeros(p) if start is None else real_array("start", start).copy()
        if theta.shape != (p,):
            raise SysidError(f"start: expected {p} parameters ({', '.join(orders.names)}), got shape {theta.shape}")
    if not has_stable_denominators(theta, {c.denominator for c in channels}):
        raise SysidError(f"start: expected C and F stable, got {dict(zip(orders.names, theta, strict=True))}")
    if P0 is not None:
        P = _covariance_matrix("P0", P0, p)
    elif isinstance(start, Estimate) and variance > 0.0 and np.isfinite(start.covariance).all():
        P = adaptation.prior(start.covariance, variance)
    else:
        linear = all(c.signal is not None for c in channels)
        variance_at_unit_signal = adaptation.diffuse if linear else CAUTIOUS
        P = np.diag(variance_at_unit_signal / _mean_squares(data, channels, p))
    filters, tails = [], []
    for channel in channels:
        begin, end = channel.denominator
        filters.append(np.zeros(end - begin))
        tails.append(np.zeros(channel.delay))
    return RecursiveState(
        orders=orders,
        adaptation=adaptation,
        theta=theta,
        memory=adaptation.enter(P),
        phi=np.zeros(p),
        psi=np.zeros(p),
        filters=tuple(filters),
        generated=(0.0,) * len(channels),
        tails=tuple(tails),
        dt=data.dt,
        squares=squares,
        weight=weight,
    )


def _resumed_state(
    data: IOData, orders: Orders, adaptation: Adaptation, state: RecursiveState, P0: ArrayLike | None
) -> RecursiveState:
    """State of an earlier recursion, its P replaced or in the memory of another rule."""
    if state.orders != orders:
        raise SysidError(f"start: expected a recursion of {orders}, got one of {state.orders}")
    if not np.isclose(data.dt, state.dt, rtol=1e-6, atol=0.0):
        raise SysidError(f"start: expected samples every {state.dt} s as before, got {data.dt} s")
    if P0 is not None:
        return replace(
            state, adaptation=adaptation, memory=adaptation.enter(_covariance_matrix("P0", P0, orders.count))
        )
    if adaptation == state.adaptation:
        return state
    return replace(state, adaptation=adaptation, memory=adaptation.enter(state.scaled_covariance))


def _check_structure(data: IOData, orders: Orders, start: Estimate) -> None:
    """Refuse an estimate whose parameters have another meaning."""
    if start.parameter_names != orders.names or start.polynomials is None:
        raise SysidError(
            f"start: expected an estimate with parameters {', '.join(orders.names)}, got one by {start.method} with "
            f"{', '.join(start.parameter_names)}"
        )
    delays = np.atleast_1d(start.orders.get("nk", orders.nk))
    if tuple(int(k) for k in np.broadcast_to(delays, len(orders.nk))) != orders.nk:
        raise SysidError(f"start: expected an estimate with nk = {orders.nk}, got {start.orders['nk']}")
    inputs, _ = channels_in(start.model, data)
    if inputs != sorted(inputs):
        raise SysidError(
            f"start: its parameters are of the inputs {listed(start.model.input_names)} in this sequence, got data "
            f"with {listed(data.input_names)}; data.select(inputs={list(start.model.input_names or ())}) sorts them"
        )


def _covariance_matrix(name: str, value: ArrayLike, p: int) -> FloatArray:
    """Covariance matrix (p, p) from a number for all parameters, one for each, or a matrix."""
    array = real_array(name, value)
    P = np.diag(np.broadcast_to(array, p)) if array.shape in ((), (p,)) else array
    if P.shape != (p, p):
        raise SysidError(f"{name}: expected a number, ({p},) or {(p, p)}, got shape {array.shape}")
    if not np.allclose(P, P.T, rtol=1e-9) or not (np.diag(P) > 0.0).all():
        raise SysidError(f"{name} must be symmetric with variances above 0, got {value!r}")
    return np.array(P, dtype=float)


def _mean_squares(data: IOData, channels: Sequence[Channel], p: int) -> FloatArray:
    """Mean square of each regressor (p,); signals of the model are at most as large as the output."""
    mean_squares = np.ones(p)
    for channel in channels:
        signal = data.y[:, 0] if channel.signal is None else channel.signal
        # a channel of zeros gives no scale
        mean_squares[channel.place] = float(np.mean(signal**2)) or 1.0
    return mean_squares
