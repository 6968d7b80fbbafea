"""Autoregressive models of time series."""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
import scipy

from sysid.models.estimate import Estimate
from sysid.polynomial.correlation import covariance_function
from sysid.polynomial.data_checks import check_means
from sysid.polynomial.least_squares import solve
from sysid.polynomial.orders import make_orders
from sysid.polynomial.polynomial_estimate import check_enough_data, check_single_output, make_estimate
from sysid.polynomial.regressors import complete_rows, lagged, output_lags
from sysid.records.arguments import shown
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, warn_each

Approach = Literal["fb", "ls", "burg", "yw"]


def ar(data: IOData | Sequence[IOData], na: int, *, approach: Approach = "fb") -> Estimate:
    """Fit A(q) y = e to a time series [Ljung1999, sec. 4.2; Kay1988, ch. 7].

    The approaches agree to order 1/N in their coefficients. They differ on short records, sharp peaks above all.

    Args:
        data: One experiment without input, or several that share the model. With "fb" and "ls", equations with a
            missing output are omitted.
        na: Degree of A.
        approach: "fb": least squares of forward and backward prediction errors, the sharpest on sinusoids; "ls": of the
            forward ones alone, exact without noise; "burg": the same as "fb", order by order, always stable [Burg1975];
            "yw": Yule-Walker equations of the biased sample covariances, always stable, biased near the unit circle:
            with poles 0.95 exp(+-0.3i) and 120 samples, 95 % intervals hold the truth in 33 % of records.

    Returns:
        The estimate; parameters a1... The covariance is that of least squares, which all approaches share to first
        order; the variance is that of the forward errors.

    Raises:
        SysidError: Data with an input, several outputs, an order too large for the data, an unknown approach.

    Warns:
        SysidWarning: A mean that dominates, rank deficient regressors, an unstable model ("fb", "ls").
    """
    if approach not in get_args(Approach):
        raise SysidError(f"approach must be one of {', '.join(get_args(Approach))}; got {shown(approach)}")
    experiments = as_series(data, missing=approach in ("fb", "ls"))
    orders = make_orders(0, na=na)
    na = orders.na
    messages = check_means(experiments, na)
    check_enough_data(experiments, orders, transients=0)
    # the samples before the first equation only initialise it
    parts = [e.y[orders.first_row(e.window) - na :, 0] for e in experiments]
    rows, target = _equations(parts, na)
    fit = solve(rows, target[:, None])
    messages += fit.rank_message()
    if approach == "ls":
        a = fit.solution[:, 0]
    elif approach == "fb":
        both, ends = _equations([*parts, *(part[::-1] for part in parts)], na)
        a = solve(both, ends[:, None]).solution[:, 0]
    else:
        a = burg(parts, na) if approach == "burg" else yule_walker(parts, na)
    variance = float(np.sum((target - rows @ a) ** 2)) / (len(rows) - na)
    warn_each(messages)
    return make_estimate(
        "ar",
        experiments,
        orders,
        {"na": na},
        theta=a,
        covariance=variance * fit.inverse_gram,
        variance=variance,
        diagnostics={"approach": approach, **fit.diagnostics},
        messages=messages,
    )


def as_series(data: IOData | Sequence[IOData], *, missing: bool) -> tuple[IOData, ...]:
    """Experiments of a time series with one output; inputs are refused."""
    experiments = as_experiments(data, missing=missing, series=True)
    if experiments[0].nu:
        raise SysidError(
            f"expected a time series, got {experiments[0].nu} input(s): IOData(None, y, dt) has none, arx and armax "
            "model the effect of inputs"
        )
    check_single_output(experiments)
    return experiments


def _equations(parts: Sequence[FloatArray], na: int) -> tuple[FloatArray, FloatArray]:
    """Rows [-y(t-1) ... -y(t-na)] and y(t) of all parts, those with a missing sample omitted."""
    rows = np.vstack([-lagged(part, output_lags(na), na) for part in parts])
    target = np.concatenate([part[na:] for part in parts])
    known = complete_rows(rows, target, na)
    return rows[known], target[known]


def yule_walker(parts: Sequence[FloatArray], na: int) -> FloatArray:
    """Coefficients (na,) by the Yule-Walker equations with biased sample covariances, always of a stable model."""
    columns = [part[:, None] for part in parts]
    r = covariance_function(columns, columns, na)[na:, 0, 0]
    return np.asarray(-scipy.linalg.solve_toeplitz(r[:-1], r[1:])) if na and r[0] > 0.0 else np.zeros(na)


def burg(parts: Sequence[FloatArray], na: int) -> FloatArray:
    """Coefficients (na,) by reflection coefficients that minimise forward and backward errors in turn [Burg1975]."""
    a, forward, backward = np.ones(1), list(parts), list(parts)
    for _ in range(na):
        pairs = [(f[1:], b[:-1]) for f, b in zip(forward, backward, strict=True)]
        power = sum(float(f @ f + b @ b) for f, b in pairs)
        k = -2.0 * sum(float(f @ b) for f, b in pairs) / power if power > 0.0 else 0.0
        forward, backward = [f + k * b for f, b in pairs], [b + k * f for f, b in pairs]
        a = np.append(a, 0.0) + k * np.append(a, 0.0)[::-1]
    return np.asarray(a[1:])
