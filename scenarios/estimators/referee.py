"""A second implementation of prediction-error identification that shares nothing with the toolbox's search.

Residuals by SciPy's filters, a Jacobian by differences, SciPy's own trust-region search, simple starts: slow and plain,
so that an error in one of the two shows in their difference.
"""

import numpy as np
from scipy.optimize import OptimizeResult, least_squares
from scipy.signal import lfilter

from scenarios.estimators.outcome import Answer
from scenarios.estimators.task import Task, require
from sysid import IOData
from sysid.models import innovations_form
from sysid.polynomial.orders import Orders, make_orders
from sysid.records.arrays import FloatArray

LONG = 30
"""Order of the long ARX model from which a search starts, where the record allows it."""

EDGE = 0.9999
"""Roots of C and F stay within this radius: beyond it errors are infinite, which the search takes as a wall."""

SHORT_SEARCH = 8
"""Evaluations by which starts are compared."""

MOST_EVALUATIONS = 200
TOLERANCE = 1e-11


def referee(data: IOData, task: Task) -> Answer:
    """Fit by minimising the sum of squared one-step prediction errors [Ljung1999, sec. 3.2 and 10.2].

    Initial conditions are free: the responses of C and F to what was before are projected out of the errors, and the
    first samples, whose past is not known, are no errors.

    Args:
        data: One input, one output.
        task: With orders.

    Returns:
        The model, its polynomials and the covariance of their parameters from the curvature at the minimum.

    Raises:
        NotImplementedError: Several inputs or outputs, or open orders.
        ValueError: No search converged.
    """
    require(task, task.structure, data, inputs=1, no_choice="this method does not choose them")
    orders = dict(task.orders)
    if task.structure == "ss":
        # A state space of n states is an ARMAX model of n.
        orders = dict.fromkeys(("na", "nb", "nc"), orders["order"]) | {"nk": 1}
    degrees = make_orders(1, **orders)
    u, y = data.u[:, 0], data.y[:, 0]
    drafts = [_search(u, y, degrees, start, SHORT_SEARCH) for start in _starts(u, y, degrees)]
    # A start beyond the wall has no finite errors, and no search begins from it.
    finite = [draft for draft in drafts if draft is not None]
    if not finite:
        raise ValueError("no start has finite prediction errors")
    best_draft = min(finite, key=lambda draft: float(draft.cost))
    best = _search(u, y, degrees, best_draft.x, MOST_EVALUATIONS)
    if best is None or best.status == 0:
        raise ValueError(f"the search did not end within {MOST_EVALUATIONS} evaluations")
    # SciPy's cost is half the sum of squares.
    variance = 2.0 * float(best.cost) / (len(best.fun) - len(best.x))
    # The QR factor of the Jacobian J: forming J' J would square its condition number.
    triangle = np.linalg.qr(best.jac, mode="r")
    inverse = np.linalg.inv(triangle)
    polynomials = degrees.polynomials(best.x)
    return Answer(innovations_form(polynomials, data.dt, variance), polynomials, variance * inverse @ inverse.T)


def errors(u: FloatArray, y: FloatArray, degrees: Orders, theta: FloatArray) -> FloatArray:
    """Prediction errors e = D/C (A y - B/F u), free initial conditions projected out.

    Args:
        u: Input (N,).
        y: Output (N,).
        degrees: Orders of the polynomials.
        theta: Parameters.

    Returns:
        (N - s,), s the samples whose past the record does not hold; infinite where C or F is unstable.
    """
    A, (B,), C, D, (F,) = degrees.split(theta)
    first = max(len(A), len(B)) - 1
    lost = first + len(D) - 1
    if not (_stable(C) and _stable(F)):
        return np.full(len(y) - lost, np.inf)
    disturbance = lfilter(A, [1.0], y)[first:] - lfilter([1.0], F, lfilter(B, [1.0], u)[first:])
    # A convolution with D needs the samples before it too: those of the unknown past are cut off, not taken as zero.
    whitened = lfilter([1.0], C, lfilter(D, [1.0], disturbance)[len(D) - 1 :])
    # Initial conditions of 1/F and 1/C enter the errors through the impulse responses of these filters.
    pulse = np.zeros(len(disturbance))
    pulse[0] = 1.0
    after_f = lfilter(D, [1.0], lfilter([1.0], F, pulse))
    after_c = lfilter([1.0], C, pulse[: len(whitened)])
    columns = []
    for k in range(len(F) - 1):
        columns.append(lfilter([1.0], C, _delayed(after_f, k)[len(D) - 1 :]))
    columns += [_delayed(after_c, k) for k in range(degrees.nc)]
    if columns:
        table = np.array(columns).T
        # The responses may be nearly dependent: singular values below 1e-12 of the largest are rounding.
        whitened = whitened - table @ np.linalg.lstsq(table, whitened, rcond=1e-12)[0]
    return np.asarray(whitened)


def _search(
    u: FloatArray, y: FloatArray, degrees: Orders, start: FloatArray, evaluations: int
) -> OptimizeResult | None:
    if not np.isfinite(errors(u, y, degrees, start)).all():
        return None
    return least_squares(
        lambda theta: errors(u, y, degrees, theta),
        start,
        method="trf",
        x_scale="jac",
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        gtol=TOLERANCE,
        max_nfev=evaluations,
    )


def _starts(u: FloatArray, y: FloatArray, degrees: Orders) -> list[FloatArray]:
    """From an ARX model of the structure's own orders, and from a long one [HannanRissanen1982]."""
    (nb,), (nf,), (nk,) = degrees.nb, degrees.nf, degrees.nk
    poles, nc = max(degrees.na, nf), degrees.nc
    past_outputs, past_inputs = range(1, poles + 1), range(nk, nk + nb)
    simple = _regression(y, [(y, past_outputs), (u, past_inputs)])
    innovations, clean = _long_model(u, y, poles)
    # Where B and A have their poles apart, the clean output shows the dynamics alone; with a C of ARMAX the estimated
    # innovations are regressors too.
    if nf or not nc:
        reduced = _regression(clean, [(clean, past_outputs), (u, past_inputs)])
    else:
        reduced = _regression(y, [(y, past_outputs), (u, past_inputs), (innovations, range(1, nc + 1))])
    return [_start(u, y, innovations, degrees, fit) for fit in (simple, reduced)]


def _long_model(u: FloatArray, y: FloatArray, poles: int) -> tuple[FloatArray, FloatArray]:
    """Estimates of the innovations and of the output without noise, from a long ARX model."""
    n = max(min(LONG, len(y) // 20), poles)
    coefficients = _regression(y, [(y, range(1, n + 1)), (u, range(1, n + 1))])
    a, b = _monic(-coefficients[:n]), np.concatenate(([0.0], coefficients[n:]))
    innovations = lfilter(a, [1.0], y) - lfilter(b, [1.0], u)
    # The first n have a past that the record does not hold.
    innovations[:n] = 0.0
    return innovations, lfilter(b, _reflected(a), u)


def _start(u: FloatArray, y: FloatArray, innovations: FloatArray, degrees: Orders, fit: FloatArray) -> FloatArray:
    """Parameters of the structure from a regression on past outputs and inputs, and perhaps innovations."""
    (nb,), (nf,), (nk,) = degrees.nb, degrees.nf, degrees.nk
    nc, nd, poles = degrees.nc, degrees.nd, max(degrees.na, nf)
    dynamics, b = _monic(-fit[:poles]), fit[poles : poles + nb]
    c, d = np.zeros(nc), np.zeros(nd)
    if not nf:
        if len(fit) > poles + nb:
            c = fit[poles + nb :]
        return np.concatenate((dynamics[1:], b, _reflected(_monic(c))[1:], d))
    f = _reflected(dynamics)
    disturbance = y - lfilter(np.concatenate((np.zeros(nk), b)), f, u)
    if nc or nd:
        noise = _regression(disturbance, [(disturbance, range(1, nd + 1)), (innovations, range(1, nc + 1))])
        d, c = -noise[:nd], noise[nd:]
    return np.concatenate((np.zeros(degrees.na), b, _reflected(_monic(c))[1:], d, f[1:]))


def _regression(target: FloatArray, signals: list[tuple[FloatArray, range]]) -> FloatArray:
    """Least squares of a signal on lags of others, where all of them are known."""
    first = max(max(lags, default=0) for _, lags in signals)
    columns = []
    for signal, lags in signals:
        columns += [signal[first - lag : len(signal) - lag] for lag in lags]
    return np.asarray(np.linalg.lstsq(np.array(columns).T, target[first:], rcond=None)[0])


def _monic(coefficients: FloatArray) -> FloatArray:
    return np.concatenate(([1.0], coefficients))


def _delayed(signal: FloatArray, lag: int) -> FloatArray:
    return np.concatenate((np.zeros(lag), signal[: len(signal) - lag]))


def _stable(polynomial: FloatArray) -> bool:
    return bool((np.abs(np.roots(polynomial)) < EDGE).all())


def _reflected(polynomial: FloatArray) -> FloatArray:
    """Roots outside the unit circle mirrored into it, those near it drawn in."""
    roots = np.roots(polynomial).astype(complex)
    outside = np.abs(roots) > 1.0
    roots[outside] = 1.0 / roots[outside].conj()
    # A start at the very edge would have a Jacobian that the wall beyond it spoils.
    near = np.abs(roots) > 0.99
    roots[near] *= 0.99 / np.abs(roots[near])
    short = np.atleast_1d(np.poly(roots).real)
    return np.concatenate((short, np.zeros(len(polynomial) - len(short))))
