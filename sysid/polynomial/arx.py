"""ARX models by linear least squares."""

import warnings
from collections.abc import Sequence
from functools import partial

import numpy as np

from sysid.models.estimate import Estimate
from sysid.polynomial.excitation import check_excitation
from sysid.polynomial.lagged_products import lagged_products, solution
from sysid.polynomial.least_squares import solve
from sysid.polynomial.operating_point import check_means
from sysid.polynomial.orders import make_orders
from sysid.polynomial.polynomial_estimate import check_enough_data, check_single_output, make_estimate
from sysid.polynomial.regressors import arx_regressors, input_lags, output_lags
from sysid.polynomial.robust_covariance import sandwich
from sysid.records.arguments import truth_value
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning


def arx(
    data: IOData | Sequence[IOData],
    na: int,
    nb: int | Sequence[int],
    nk: int | Sequence[int] = 1,
    *,
    coloured: bool = False,
) -> Estimate:
    """Fit A(q) y = B(q) u + e by least squares [Ljung1999, sec. 4.2, 7.3].

    Args:
        data: One experiment, or several that share the model. Outputs may be missing: equations that touch one are
            left out.
        na: Degree of A.
        nb: Number of coefficients of B, one for all inputs or one per input.
        nk: Delay in samples, likewise; nk = 1 means y(t) depends on u(t-1) first, nk = 0 gives a direct term.
        coloured: Whether the covariance allows for prediction errors that are not white, as where the orders are too
            small: a "sandwich" [Ljung1999, ch. 9]. It then tells the spread about the parameters that the
            criterion leads to, which need not be the true ones. The estimate itself is the same.

    Returns:
        The estimate; parameters a1.., b1...

    Raises:
        SysidError: Constant input, several outputs, orders negative or too many for the data.

    Warns:
        SysidWarning: The input excites too little, means that do not fit the dynamics, rank deficient regressors.
    """
    coloured = truth_value("coloured", coloured)
    experiments = as_experiments(data, missing=not coloured)
    check_single_output(experiments)
    orders = make_orders(experiments[0].nu, na=na, nb=nb, nk=nk)
    texts = check_excitation(experiments, orders.nb) + check_means(experiments, orders.na)
    check_enough_data(experiments, orders, transients=0)
    starts = [orders.first_row(e.window) for e in experiments]
    phi = np.vstack(
        [
            arx_regressors(e.y[:, 0], e.u, orders.na, orders.nb, orders.nk, start)
            for e, start in zip(experiments, starts, strict=True)
        ]
    )
    target = np.concatenate([e.y[start:] for e, start in zip(experiments, starts, strict=True)])
    # rows that touch a missing output are left out
    known = np.isfinite(phi).all(axis=1) & np.isfinite(target[:, 0])
    if known.sum() <= orders.count:
        raise SysidError(
            f"too many missing samples: {int(known.sum())} of {len(phi)} rows touch none, "
            f"{orders.count} parameters need more"
        )
    if not known.all():
        phi, target = phi[known], target[known]
    fit = solve(phi, target)
    variance = float(fit.residual_gram[0, 0]) / (len(phi) - orders.count)
    if fit.rank < orders.count:
        texts.append(
            f"the regressors have rank {fit.rank} for {orders.count} parameters: the solution of least norm is given"
        )
    covariance = variance * fit.inverse_gram
    if coloured:
        covariance = sandwich(experiments, orders, fit.solution[:, 0], covariance, variance)
    for text in texts:
        warnings.warn(text, SysidWarning, stacklevel=2)
    return make_estimate(
        "arx",
        experiments,
        orders,
        {"na": orders.na, "nb": orders.nb, "nk": orders.nk},
        theta=fit.solution[:, 0],
        covariance=covariance,
        variance=variance,
        diagnostics={"condition": fit.condition, "rank": fit.rank, "iterations": 0, "converged": True},
        texts=texts,
    )


def arx_solution(
    y: Sequence[FloatArray],
    u: Sequence[FloatArray],
    na: int,
    nb: Sequence[int],
    nk: Sequence[int],
    starts: Sequence[int],
) -> FloatArray:
    """Bare least-squares parameters, for iterations that begin with an ARX fit.

    Args:
        y: Output per experiment (N,).
        u: Inputs per experiment (N, nu).
        na: Degree of A.
        nb: Coefficients of B per input.
        nk: Delay per input.
        starts: First row per experiment.

    Returns:
        Parameters (na + sum(nb),).
    """
    lags = [output_lags(na), *(input_lags(n, k) for n, k in zip(nb, nk, strict=True))]
    most = max(na, *(n + k - 1 for n, k in zip(nb, nk, strict=True)))
    if most <= min(starts):
        signals = (np.column_stack((yi, ui)) for yi, ui in zip(y, u, strict=True))
        products = sum(lagged_products(s, most, start) for s, start in zip(signals, starts, strict=True))
        found = solution(np.asarray(products), lags, [1.0] + [0.0] * len(nb))
        if found is not None:
            found[:na] *= -1.0
            return found
    build = partial(arx_regressors, na=na, nb=nb, nk=nk)
    phi = np.vstack([build(yi, ui, start=s) for yi, ui, s in zip(y, u, starts, strict=True)])
    target = np.concatenate([yi[s:] for yi, s in zip(y, starts, strict=True)])
    return solve(phi, target[:, None]).solution[:, 0]
