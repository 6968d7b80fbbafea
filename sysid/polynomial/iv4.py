"""The four-stage instrumental-variable method."""

import warnings
from collections.abc import Sequence

import numpy as np

from sysid.models.estimate import Estimate
from sysid.models.polynomials import stabilised
from sysid.polynomial.arx import arx
from sysid.polynomial.data_checks import check_excitation, check_means
from sysid.polynomial.error_jacobian import path_responses
from sysid.polynomial.instrumental_variables import (
    WHITE,
    disturbance_whitener,
    instrumental_estimate,
    solve_with_instruments,
)
from sysid.polynomial.long_arx import arx_solution
from sysid.polynomial.orders import Orders, make_orders, orders_apart
from sysid.polynomial.polynomial_estimate import check_enough_data, check_single_output
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidWarning


@orders_apart
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

    # from a table of products, which gaps would spoil; `arx` is slower and omits incomplete equations
    if all(e.complete for e in experiments):
        theta = arx_solution(y, u, orders.na, orders.nb, orders.nk, rows)
    else:
        with warnings.catch_warnings():
            # instruments follow from any model near the truth, whatever its intervals
            warnings.simplefilter("ignore", SysidWarning)
            theta = arx(experiments, orders.na, orders.nb, orders.nk).parameters
    fit, *_ = solve_with_instruments(experiments, orders, _simulated_instruments(experiments, orders, theta), WHITE)
    theta = fit.solution[:, 0]
    whitener = disturbance_whitener(experiments, orders, theta, usable)
    fit, shape, weights = solve_with_instruments(
        experiments, orders, _simulated_instruments(experiments, orders, theta), whitener
    )
    return instrumental_estimate("iv4", experiments, orders, fit, shape, weights, whitener, messages, filtered=True)


def _simulated_instruments(experiments: Sequence[IOData], orders: Orders, theta: FloatArray) -> list[FloatArray]:
    """Instruments: outputs of the stabilised model and the inputs of each experiment (N, 1 + nu)."""
    a, b, *_ = orders.split(theta)
    denominators = [stabilised(a)] * len(b)
    instruments = []
    for experiment in experiments:
        output = sum(path_responses(experiment.u, b, denominators))
        instruments.append(np.column_stack([output, experiment.u]))
    return instruments
