"""The recursion behind `rarx`, `rarmax` and `roe`: prediction errors, sample by sample.

Regressors are lags of outputs and inputs, and of what the model itself makes: its errors (ARMAX) or its simulated
outputs (OE). The gradient is the same regressors filtered by 1/C or 1/F of the moment [Ljung1999, sec. 11.4].
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sysid.adaptation import Adaptation
from sysid.arrays import FloatArray, real_array
from sysid.data import IOData, as_experiments
from sysid.errors import SysidError
from sysid.excitation import check_excitation
from sysid.orders import Orders
from sysid.polynomial_estimate import check_enough_data, check_single_output, make_estimate
from sysid.recursive_estimate import RecursiveEstimate

# initial variance of a parameter whose regressor has a mean square of one; less where regressors depend on parameters,
# since the first steps would be wild ones
DIFFUSE, CAUTIOUS = 1e6, 1e2
HALVINGS = 12


@dataclass(frozen=True, eq=False)
class Channel:
    """A signal whose lags stand among the regressors.

    Attributes:
        place: Where its lags stand.
        sign: With which they enter the prediction.
        denominator: Where the coefficients of the filter stand that makes gradients of it; an empty slice for none.
        signal: Its samples as they enter, (N,); None when the model makes them.
        paths: Places whose sum is the simulated output; none for the errors.
    """

    place: slice
    sign: float
    denominator: slice
    signal: FloatArray | None
    paths: tuple[slice, ...] = ()


def recurse(
    method: str,
    data: IOData,
    orders: Orders,
    asked: Mapping[str, Any],
    adaptation: Adaptation,
    start: ArrayLike | None,
) -> RecursiveEstimate:
    """Run along a record. A step that would make C or an F unstable is halved until it does not.

    Args:
        method: Name of the estimator.
        data: One experiment with one output.
        orders: ARX, ARMAX or OE structure.
        asked: Orders as the user knows them.
        adaptation: Rule of the gain.
        start: Parameters to begin with (p,); zero when None.

    Raises:
        SysidError: Several experiments or outputs, missing samples, a constant input, too many orders, a start that
            does not fit.
    """
    if not isinstance(data, IOData):
        raise SysidError(f"recursive estimators run along one IOData record, got {type(data).__name__}")
    as_experiments(data)
    check_single_output([data])
    texts = check_excitation([data], orders.nb)
    check_enough_data([data], orders, transients=0)
    p = orders.count
    adaptation.check(p)
    theta = np.zeros(p) if start is None else real_array("start", start)
    if theta.shape != (p,):
        raise SysidError(f"start: expected {p} parameters ({', '.join(orders.names)}), got shape {theta.shape}")
    channels = _channels(data, orders)
    denominators = sorted({(c.denominator.start, c.denominator.stop) for c in channels})
    if not _stable(theta, denominators):
        raise SysidError(f"start: expected C and F stable, got {dict(zip(orders.names, theta, strict=True))}")

    y, samples, first = data.y[:, 0], len(data), orders.first_row(data.window)
    ignorance = DIFFUSE if all(c.signal is not None for c in channels) else CAUTIOUS
    P = np.diag(ignorance / _mean_squares(data, channels, p))
    phi, psi = np.zeros(p), np.zeros(p)
    histories = [[0.0] * (c.denominator.stop - c.denominator.start) for c in channels]
    made = [0.0] * len(channels)
    trajectory, residuals = np.empty((samples, p)), np.zeros((samples, 1))
    squares = weight = energy = 0.0
    shortened = 0
    for t in range(samples):
        phi[1:], psi[1:] = phi[:-1].copy(), psi[:-1].copy()
        for c, own, past in zip(channels, made, histories, strict=True):
            value = filtered = own if c.signal is None else float(c.signal[t])
            if past:
                filtered -= sum(f * x for f, x in zip(theta[c.denominator].tolist(), past, strict=True))
                past.insert(0, filtered)
                past.pop()
            phi[c.place.start], psi[c.place.start] = c.sign * value, c.sign * filtered
        after = 0.0
        if t >= first:
            error = float(y[t] - phi @ theta)
            gain, P = adaptation.step(P, psi, t - first)
            step = gain * error
            halvings = 0
            while halvings < HALVINGS and not _stable(theta + step, denominators):
                step = 0.5 * step
                halvings += 1
            shortened += halvings > 0
            if halvings < HALVINGS:
                theta = theta + step
            residuals[t] = error
            after = float(y[t] - phi @ theta)
            # for least squares the sum of prior times posterior errors is the sum of squares of the whole fit
            decay = adaptation.decay(t - first)
            squares = decay * squares + error * after
            weight = decay * weight + 1.0
            energy += float(psi @ psi)
        trajectory[t] = theta
        made = [sum(float(phi[s] @ theta[s]) for s in c.paths) if c.paths else after for c in channels]
    rows = samples - first
    variance = max(squares, 0.0) / max(weight - p, 1.0)
    final = make_estimate(
        method,
        [data],
        orders,
        asked,
        theta=theta,
        covariance=adaptation.covariance(P, energy / rows, variance, rows),
        variance=variance,
        diagnostics={"adaptation": adaptation, "shortened": shortened},
        texts=texts,
    )
    return RecursiveEstimate(trajectory, orders.names, residuals, final, shortened)


def _channels(data: IOData, orders: Orders) -> list[Channel]:
    """Layout of the regressors; `y` delayed by one sample, inputs by nk."""
    sizes = [orders.na, *orders.nb, orders.nc, *orders.nf]
    edges = [0, *np.cumsum(sizes).tolist()]
    places = [slice(a, b) for a, b in pairwise(edges)]
    nu = len(orders.nb)
    inputs, noise, dynamics = places[1 : 1 + nu], places[1 + nu], places[2 + nu :]
    out = [Channel(places[0], -1.0, noise, _delayed(data.y[:, 0], 1))]
    for j, (b, f) in enumerate(zip(inputs, dynamics, strict=True)):
        out.append(Channel(b, 1.0, f if orders.nf[j] else noise, _delayed(data.u[:, j], orders.nk[j])))
        out.append(Channel(f, -1.0, f, None, (b, f)))
    out.append(Channel(noise, 1.0, noise, None))
    return [c for c in out if c.place.stop > c.place.start]


def _delayed(signal: FloatArray, lag: int) -> FloatArray:
    return np.concatenate((np.zeros(lag), signal[: len(signal) - lag]))


def _mean_squares(data: IOData, channels: Sequence[Channel], p: int) -> FloatArray:
    """Mean square of each regressor (p,); what the model makes is as large as the output, at most."""
    out = np.ones(p)
    for c in channels:
        signal = data.y[:, 0] if c.signal is None else c.signal
        out[c.place] = float(np.mean(signal**2)) or 1.0
    return out


def _stable(theta: FloatArray, denominators: Sequence[tuple[int, int]]) -> bool:
    """Whether all reflection coefficients of every denominator are below one (the step-down recursion of Schur)."""
    for begin, end in denominators:
        row = theta[begin:end].tolist()
        while row:
            k = row.pop()
            if not abs(k) < 1.0:
                return False
            row = [(x - k * z) / (1.0 - k * k) for x, z in zip(row, reversed(row), strict=True)]
    return True
