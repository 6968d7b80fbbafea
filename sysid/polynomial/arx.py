"""ARX models by linear least squares."""

import warnings
from collections.abc import Sequence

import numpy as np

from sysid.models.estimate import Estimate
from sysid.polynomial.data_checks import check_excitation, check_means
from sysid.polynomial.least_squares import solve
from sysid.polynomial.orders import make_orders
from sysid.polynomial.polynomial_estimate import check_enough_data, check_single_output, make_estimate
from sysid.polynomial.regressors import arx_regressors
from sysid.polynomial.robust_covariance import sandwich
from sysid.records.arguments import truth_value
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
        data: One experiment, or several that share the model. Equations with a missing output are omitted.
        na: Degree of A.
        nb: Number of coefficients of B, one for all inputs or one per input.
        nk: Delay in samples, likewise; nk = 1 means y(t) depends on u(t-1) first, nk = 0 gives a direct term.
        coloured: Whether the covariance allows for prediction errors that are not white, as with too small orders, by
            the "sandwich" formula [Ljung1999, ch. 9]. It is then the spread about the limit of the estimate, which need
            not be the true parameters. The estimate itself is the same.

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
    messages = check_excitation(experiments, orders.nb) + check_means(experiments, orders.na)
    check_enough_data(experiments, orders, transients=0)
    starts = [orders.first_row(e.window) for e in experiments]
    phi = np.vstack(
        [
            arx_regressors(e.y[:, 0], e.u, orders.na, orders.nb, orders.nk, start)
            for e, start in zip(experiments, starts, strict=True)
        ]
    )
    target = np.concatenate([e.y[start:] for e, start in zip(experiments, starts, strict=True)])
    known = np.isfinite(phi).all(axis=1) & np.isfinite(target[:, 0])
    if known.sum() <= orders.count:
        raise SysidError(
            f"too many missing samples: {int(known.sum())} of {len(phi)} rows are complete, "
            f"{orders.count} parameters need more"
        )
    if not known.all():
        phi, target = phi[known], target[known]
    fit = solve(phi, target)
    variance = float(fit.residual_gram[0, 0]) / (len(phi) - orders.count)
    if fit.rank < orders.count:
        messages.append(
            f"the regressors have rank {fit.rank} for {orders.count} parameters: this is the least-norm solution"
        )
    covariance = variance * fit.inverse_gram
    if coloured:
        covariance = sandwich(experiments, orders, fit.solution[:, 0], covariance, variance)
    for message in messages:
        warnings.warn(message, SysidWarning, stacklevel=2)
    return make_estimate(
        "arx",
        experiments,
        orders,
        orders.select("na", "nb", "nk"),
        theta=fit.solution[:, 0],
        covariance=covariance,
        variance=variance,
        diagnostics={"condition": fit.condition, "rank": fit.rank, "iterations": 0, "converged": True},
        messages=messages,
    )
