"""Instrumental variables: estimates of A y = B u + v from instruments that are independent of the disturbance v."""

from collections.abc import Sequence

import numpy as np
import scipy

from sysid.models.estimate import Estimate
from sysid.models.repeated_errors import repeated_in_weighted_sum
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


def solve_with_instruments(
    experiments: Sequence[IOData],
    orders: Orders,
    instruments: Sequence[FloatArray],
    whitener: FloatArray,
    colour: FloatArray = WHITE,
) -> tuple[LeastSquares, FloatArray, list[FloatArray]]:
    """Solve the instrumental-variable equations Z' (y - Phi theta) = 0 on data filtered by the whitener 1, l1, ...

    An orthonormal basis Q replaces Z: Q' Phi is no worse conditioned than Phi, and the estimate is that of least
    squares with the regressors Q' Phi. The instruments (N, 1 + nu) take the place of [y, u] in the regressors Z. The
    filtered disturbance is white noise filtered by the inverse of the colour 1, c1, ... Returned beside the fit: the
    covariance of theta (p, p) for white noise of variance 1 [Soderstrom1989, sec. 8.2], and the weights of the filtered
    disturbance in theta, of each experiment (N_i, p).
    """
    order = len(whitener) - 1
    # the filter starts from zeros: its first samples are no data
    starts = [orders.first_row(e.window) + order for e in experiments]
    y = _filter_signals(whitener, [e.y[:, 0] for e in experiments])
    u = _filter_signals(whitener, [e.u for e in experiments])
    phi, target = arx_equations(y, u, orders.na, orders.nb, orders.nk, starts)
    x = _filter_signals(whitener, instruments)
    y_instruments, u_instruments = [xi[:, 0] for xi in x], [xi[:, 1:] for xi in x]
    z, _ = arx_equations(y_instruments, u_instruments, orders.na, orders.nb, orders.nk, starts)
    # the filters have finite memory: a missing output affects only the rows within its reach
    complete = complete_rows(phi, target, orders.count)
    if not complete.all():
        z, phi, target = z[complete], phi[complete], target[complete]
    lengths = np.linalg.norm(z, axis=0)
    basis, triangle = np.linalg.qr(z / np.where(lengths > 0.0, lengths, 1.0))
    basis[:, np.abs(np.diag(triangle)) < DEPENDENT] = 0.0
    regressors = basis.T @ phi
    fit = solve(regressors, (basis.T @ target)[:, None])
    # rows that were omitted come back as zeros: the correlation of v reaches across them
    in_time = np.zeros((len(complete), basis.shape[1]))
    in_time[complete] = basis
    ends = np.cumsum([len(e) - start for e, start in zip(experiments, starts, strict=True)])
    by_experiment = np.split(in_time, ends[:-1])
    onto_parameters = regressors @ fit.inverse_gram
    weights = []
    for start, rows in zip(starts, by_experiment, strict=True):
        weights.append(np.vstack((np.zeros((start, orders.count)), rows @ onto_parameters)))
    if len(colour) == 1:
        return fit, fit.inverse_gram, weights
    coloured = np.vstack([scipy.signal.lfilter([1.0], colour, rows, axis=0) for rows in by_experiment])
    half = coloured @ regressors @ fit.inverse_gram
    return fit, half.T @ half, weights


def _filter_signals(whitener: FloatArray, signals: Sequence[FloatArray]) -> list[FloatArray]:
    return [scipy.signal.lfilter(whitener, [1.0], signal, axis=0) for signal in signals]


def disturbances(experiments: Sequence[IOData], orders: Orders, theta: FloatArray) -> list[FloatArray]:
    """A y - B u of each experiment, from the first row without samples from before the record."""
    a, b, *_ = orders.split(theta)
    return [arx_errors(e, a, b)[orders.first_row(e.window) :] for e in experiments]


def disturbance_whitener(experiments: Sequence[IOData], orders: Orders, theta: FloatArray, usable: int) -> FloatArray:
    """Autoregressive model 1, l1, ... of the disturbances by least squares, as many coefficients as parameters."""
    shortest = min(len(e) for e in experiments)
    order = min(orders.count, min(usable, shortest) // ROWS_PER_COEFFICIENT)
    signals = disturbances(experiments, orders, theta)
    phi = np.vstack([-lagged(v, output_lags(order), order) for v in signals])
    target = np.concatenate([v[order:] for v in signals])
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
    weights: Sequence[FloatArray],
    whitener: FloatArray,
    messages: list[str],
    *,
    filtered: bool,
) -> Estimate:
    """Give warnings and assemble the estimate, its covariance `shape` times the whitened disturbance's variance.

    The `weights` in the parameters are those of the disturbance, or of the whitened one where the equations were
    `filtered`; errors of either that repeat with the input count once.
    """
    theta = fit.solution[:, 0]
    signals = disturbances(experiments, orders, theta)
    # the whitener's first samples are its transient
    whitened = [v[len(whitener) - 1 :] for v in _filter_signals(whitener, signals)]
    innovations = _without_gaps(np.concatenate(whitened))
    freedom = max(len(innovations) - orders.count, 1)
    errors = [_without_gaps(v) for v in signals]
    energy = sum(float(v @ v) for v in errors)
    messages = messages + fit.rank_message("instruments")
    warn_each(messages, stacklevel=3)
    covariance = float(innovations @ innovations) / freedom * shape
    diagnostics = {**fit.diagnostics, "whitener": whitener}
    weighted = whitened if filtered else signals
    in_time = [np.pad(np.nan_to_num(v), (len(e) - len(v), 0)) for e, v in zip(experiments, weighted, strict=True)]
    repeated = repeated_in_weighted_sum(experiments, weights, in_time, covariance)
    if repeated is not None:
        diagnostics |= {**repeated[1].diagnostics, "covariance_of_independent_errors": covariance}
        covariance = covariance + repeated[0]
    return make_estimate(
        method,
        experiments,
        orders,
        orders.select("na", "nb", "nk"),
        theta=theta,
        covariance=covariance,
        variance=energy / (sum(map(len, errors)) - orders.count),
        diagnostics=diagnostics,
        messages=messages,
        repetition_counted=True,
    )


def _without_gaps(signal: FloatArray) -> FloatArray:
    return signal[np.isfinite(signal)]
