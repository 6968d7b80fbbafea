"""Instrumental variables: estimates of A y = B u + v from instruments that are independent of the disturbance v."""

from collections.abc import Sequence

import numpy as np
import scipy

from sysid.models.estimate import Estimate
from sysid.polynomial.least_squares import LeastSquares, solve
from sysid.polynomial.long_arx import arx_errors
from sysid.polynomial.orders import Orders
from sysid.polynomial.polynomial_estimate import make_estimate
from sysid.polynomial.regressors import arx_equations, complete_rows, lagged, output_lags
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import warn_each

ROWS_PER_COEFFICIENT = 10  # least number of samples per coefficient of the disturbance model
DEPENDENT = 1e-10  # remainder of an instrument, relative to it, after those before it are subtracted
WHITE = np.ones(1)


def instrumented(
    experiments: Sequence[IOData],
    orders: Orders,
    instruments: Sequence[FloatArray],
    whitener: FloatArray,
    colour: FloatArray = WHITE,
) -> tuple[LeastSquares, FloatArray]:
    """Solve Z' (y - Phi theta) = 0 on data filtered by the whitener 1, l1, ...

    An orthonormal basis Q replaces Z: Q' Phi is no worse conditioned than Phi, and the estimate is that of least
    squares with the regressors Q' Phi. The instruments (N, 1 + nu) take the place of [y, u] in the regressors Z. The
    filtered disturbance is white noise filtered by the inverse of the colour 1, c1, ... Returned beside the fit: the
    covariance of theta (p, p) for white noise of variance 1 [Soderstrom1989, sec. 8.2].
    """
    order = len(whitener) - 1
    # the filter starts from zeros: its first samples are no data
    starts = [orders.first_row(e.window) + order for e in experiments]
    y, u, x = (
        [scipy.signal.lfilter(whitener, [1.0], signal, axis=0) for signal in signals]
        for signals in ([e.y[:, 0] for e in experiments], [e.u for e in experiments], instruments)
    )
    phi, target = arx_equations(y, u, orders.na, orders.nb, orders.nk, starts)
    z, _ = arx_equations([one[:, 0] for one in x], [one[:, 1:] for one in x], orders.na, orders.nb, orders.nk, starts)
    # the filters have finite memory: a missing output affects only the rows within its reach
    complete = complete_rows(phi, target, orders.count)
    if not complete.all():
        z, phi, target = z[complete], phi[complete], target[complete]
    lengths = np.linalg.norm(z, axis=0)
    basis, triangle = np.linalg.qr(z / np.where(lengths > 0.0, lengths, 1.0))
    basis[:, np.abs(np.diag(triangle)) < DEPENDENT] = 0.0
    regressors = basis.T @ phi
    fit = solve(regressors, (basis.T @ target)[:, None])
    if len(colour) == 1:
        return fit, fit.inverse_gram
    whole = np.zeros((len(complete), basis.shape[1]))
    whole[complete] = basis
    ends = np.cumsum([len(e) - start for e, start in zip(experiments, starts, strict=True)])
    parts = np.split(whole, ends[:-1])
    filtered = np.vstack([scipy.signal.lfilter([1.0], colour, part, axis=0) for part in parts])
    half = filtered @ regressors @ fit.inverse_gram
    return fit, half.T @ half


def disturbances(experiments: Sequence[IOData], orders: Orders, theta: FloatArray) -> list[FloatArray]:
    """A y - B u of each experiment, from the first row without samples from before the record."""
    a, b, *_ = orders.split(theta)
    return [arx_errors(e, a, b)[orders.first_row(e.window) :] for e in experiments]


def disturbance_whitener(experiments: Sequence[IOData], orders: Orders, theta: FloatArray, usable: int) -> FloatArray:
    """Autoregressive model 1, l1, ... of the disturbances by least squares, as many coefficients as parameters."""
    order = min(orders.count, min(usable, *(len(e) for e in experiments)) // ROWS_PER_COEFFICIENT)
    parts = disturbances(experiments, orders, theta)
    phi = np.vstack([-lagged(v, output_lags(order), order) for v in parts])
    target = np.concatenate([v[order:] for v in parts])
    complete = complete_rows(phi, target, order)
    if not complete.all():
        phi, target = phi[complete], target[complete]
    return np.concatenate(([1.0], solve(phi, target[:, None]).solution[:, 0]))


def instrumental_estimate(
    method: str,
    experiments: Sequence[IOData],
    orders: Orders,
    fit: LeastSquares,
    shape: FloatArray,
    whitener: FloatArray,
    messages: list[str],
) -> Estimate:
    """Warn, and return the estimate; its covariance is `shape` times the variance of the whitened disturbance."""
    theta = fit.solution[:, 0]
    parts = disturbances(experiments, orders, theta)
    innovations = _known(np.concatenate([scipy.signal.lfilter(whitener, [1.0], v)[len(whitener) - 1 :] for v in parts]))
    errors = [_known(v) for v in parts]
    freedom = max(len(innovations) - orders.count, 1)
    messages = messages + fit.rank_message("instruments")
    warn_each(messages, stacklevel=3)
    return make_estimate(
        method,
        experiments,
        orders,
        orders.select("na", "nb", "nk"),
        theta=theta,
        covariance=float(innovations @ innovations) / freedom * shape,
        variance=sum(float(v @ v) for v in errors) / (sum(len(v) for v in errors) - orders.count),
        diagnostics={**fit.diagnostics, "whitener": whitener},
        messages=messages,
    )


def _known(signal: FloatArray) -> FloatArray:
    return signal[np.isfinite(signal)]
