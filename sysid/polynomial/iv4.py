"""The four-stage instrumental-variable method."""

import warnings
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from sysid.models.estimate import Estimate
from sysid.models.polynomials import stabilised
from sysid.polynomial.arx import arx
from sysid.polynomial.data_checks import check_excitation, check_means
from sysid.polynomial.least_squares import LeastSquares, solve
from sysid.polynomial.long_arx import arx_errors, arx_solution
from sysid.polynomial.orders import Orders, make_orders
from sysid.polynomial.polynomial_estimate import check_enough_data, check_single_output, make_estimate
from sysid.polynomial.regressors import arx_regressors, lagged, output_lags
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning

ROWS_PER_COEFFICIENT = 10  # least number of samples per coefficient of the disturbance model


def iv4(data: IOData | Sequence[IOData], na: int, nb: int | Sequence[int], nk: int | Sequence[int] = 1) -> Estimate:
    """Fit A(q) y = B(q) u + v, v of any colour, with simulated outputs as instruments [Ljung1999, sec. 15.3].

    The four stages: least squares; instruments from that model; an autoregressive model L of the remaining disturbance
    v; filtered data with instruments from the second model. If L describes v, the last stage reaches the accuracy of
    the prediction-error method without a search [Soderstrom1989, ch. 8]. Open loop only: the input must be independent
    of v.

    The disturbance model of the estimate is 1/A, as for ARX: its `noise_variance` and residuals are those of A y - B u,
    which need not be white. The whitener L is in the diagnostics.

    Args:
        data: One experiment, or several that share the model. Rows with a missing output, also within reach of the
            whitener, are omitted; `armax` and `bj` use every known output.
        na: Degree of A.
        nb: Number of coefficients of B, one for all inputs or one per input.
        nk: Delay in samples, likewise; nk = 1 means y(t) depends on u(t-1) first, nk = 0 gives a direct term.

    Returns:
        The estimate; parameters a1.., b1...

    Raises:
        SysidError: Constant input, several outputs, orders negative or too many for the data.

    Warns:
        SysidWarning: The input excites too little, means do not fit the dynamics, or the instruments hardly correlate
            with the regressors.
    """
    experiments = as_experiments(data, missing=True)
    check_single_output(experiments)
    orders = make_orders(experiments[0].nu, na=na, nb=nb, nk=nk)
    messages = check_excitation(experiments, [n + orders.na for n in orders.nb]) + check_means(experiments, orders.na)
    usable = check_enough_data(experiments, orders, transients=0)
    rows = [orders.first_row(e.window) for e in experiments]
    y, u = [e.y[:, 0] for e in experiments], [e.u for e in experiments]

    if all(e.complete for e in experiments):
        theta = arx_solution(y, u, orders.na, orders.nb, orders.nk, rows)
    else:
        theta = arx(experiments, orders.na, orders.nb, orders.nk).parameters
    theta = _instrumented(experiments, orders, theta, np.ones(1)).solution[:, 0]
    order = min(orders.count, min(usable, *(len(e) for e in experiments)) // ROWS_PER_COEFFICIENT)
    whitener = _whitener(_disturbances(experiments, orders, theta), order)
    fit = _instrumented(experiments, orders, theta, whitener)

    theta = fit.solution[:, 0]
    disturbances = _disturbances(experiments, orders, theta)
    innovations = _known(np.concatenate([scipy.signal.lfilter(whitener, [1.0], v)[order:] for v in disturbances]))
    errors = [_known(v) for v in disturbances]
    freedom = max(len(innovations) - orders.count, 1)
    if fit.rank < orders.count:
        messages.append(
            f"the instruments have rank {fit.rank} for {orders.count} parameters: this is the least-norm solution"
        )
    for message in messages:
        warnings.warn(message, SysidWarning, stacklevel=2)
    return make_estimate(
        "iv4",
        experiments,
        orders,
        orders.select("na", "nb", "nk"),
        theta=theta,
        covariance=float(innovations @ innovations) / freedom * fit.inverse_gram,
        variance=sum(float(v @ v) for v in errors) / (sum(len(v) for v in errors) - orders.count),
        diagnostics={
            "condition": fit.condition,
            "rank": fit.rank,
            "iterations": 0,
            "converged": True,
            "whitener": whitener,
        },
        messages=messages,
    )


def _instrumented(
    experiments: Sequence[IOData], orders: Orders, theta: FloatArray, whitener: FloatArray
) -> LeastSquares:
    """Solve Z' (y - Phi theta) = 0 on data filtered by the whitener, Z with outputs simulated by `theta`.

    An orthonormal basis Q replaces Z: Q' Phi is no worse conditioned than Phi, and the covariance is that of least
    squares with the regressors Q' Phi.
    """
    a, b, *_ = orders.split(theta)
    stable = stabilised(a)
    order = len(whitener) - 1
    instruments, regressors, targets = [], [], []
    for e in experiments:
        clean = np.asarray(sum(scipy.signal.lfilter(bj, stable, e.u[:, j]) for j, bj in enumerate(b)))
        x, y = scipy.signal.lfilter(whitener, [1.0], clean), scipy.signal.lfilter(whitener, [1.0], e.y[:, 0])
        u = scipy.signal.lfilter(whitener, [1.0], e.u, axis=0)
        # the filter starts from zeros: its first samples are no data
        start = orders.first_row(e.window) + order
        instruments.append(arx_regressors(x, u, orders.na, orders.nb, orders.nk, start))
        regressors.append(arx_regressors(y, u, orders.na, orders.nb, orders.nk, start))
        targets.append(y[start:])
    z, phi, target = np.vstack(instruments), np.vstack(regressors), np.concatenate(targets)
    if not all(e.complete for e in experiments):
        # the filters have finite memory: a missing output affects only the rows within its reach
        complete = np.isfinite(phi).all(axis=1) & np.isfinite(target)
        _check_enough(complete, orders.count)
        z, phi, target = z[complete], phi[complete], target[complete]
    lengths = np.linalg.norm(z, axis=0)
    basis, _ = np.linalg.qr(z / np.where(lengths > 0.0, lengths, 1.0))
    return solve(basis.T @ phi, (basis.T @ target)[:, None])


def _disturbances(experiments: Sequence[IOData], orders: Orders, theta: FloatArray) -> list[FloatArray]:
    """A y - B u of each experiment, from the first row without samples from before the record."""
    a, b, *_ = orders.split(theta)
    return [arx_errors(e, a, b)[orders.first_row(e.window) :] for e in experiments]


def _whitener(disturbances: Sequence[FloatArray], order: int) -> FloatArray:
    """Autoregressive model 1, l1, ... of the disturbances by least squares (order + 1,)."""
    phi = np.vstack([-lagged(v, output_lags(order), order) for v in disturbances])
    target = np.concatenate([v[order:] for v in disturbances])
    complete = np.isfinite(phi).all(axis=1) & np.isfinite(target)
    if not complete.all():
        _check_enough(complete, order)
        phi, target = phi[complete], target[complete]
    return np.concatenate(([1.0], solve(phi, target[:, None]).solution[:, 0]))


def _check_enough(complete: NDArray[np.bool_], unknown: int) -> None:
    if complete.sum() <= unknown:
        raise SysidError(
            f"too many missing samples: {int(complete.sum())} of {len(complete)} rows are complete, {unknown} "
            "coefficients need more; armax, bj and oe use every known output"
        )


def _known(signal: FloatArray) -> FloatArray:
    return signal[np.isfinite(signal)]
