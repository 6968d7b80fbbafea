"""Instrumental variables with instruments of one's own."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from sysid.models.estimate import Estimate
from sysid.polynomial.data_checks import check_excitation, check_means
from sysid.polynomial.instrumental_variables import (
    WHITE,
    disturbance_whitener,
    instrumental_estimate,
    solve_with_instruments,
)
from sysid.polynomial.orders import make_orders, orders_apart
from sysid.polynomial.polynomial_estimate import check_enough_data, check_single_output
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError
from sysid.records.external_signals import external_signals


@orders_apart
def ivx(
    data: IOData | Sequence[IOData],
    na: int,
    nb: int | Sequence[int],
    nk: int | Sequence[int],
    x: ArrayLike | Sequence[ArrayLike],
) -> Estimate:
    """Fit A(q) y = B(q) u + v, v of any colour, with instruments of one's own [Ljung1999, sec. 7.6; Soderstrom1989].

    The instruments take the place of y, or of y and u, in the regressors of `arx`; the estimate makes the disturbance v
    uncorrelated with them. It is consistent if they correlate with the regressors and not with v. In open loop, the
    input is its own instrument, and x an output without disturbance, as a model simulates it. Under feedback the input
    depends on v: then x needs columns for the inputs too, such as signals that a model of the loop simulates from the
    reference, or delayed copies of it. Without x, in open loop, `iv4` makes its own instruments.

    The disturbance model of the estimate is 1/A, as for ARX. The covariance allows for the colour of v, by an
    autoregressive model, its inverse in the diagnostics as `whitener`.

    Args:
        data: One experiment, or several that share the model. Equations with a missing output are omitted.
        na: Degree of A.
        nb: Number of coefficients of B, one for all inputs or one per input.
        nk: Delay in samples, likewise; nk = 1 means y(t) depends on u(t-1) first, nk = 0 gives a direct term.
        x: Instruments in place of the output (N,) or (N, 1), or of output and inputs (N, 1 + nu); for several
            experiments, a sequence with one array for each.

    Returns:
        The estimate; parameters a1.., b1...

    Raises:
        SysidError: Constant input, several outputs, orders negative or too many for the data, instruments of another
            length or number.

    Warns:
        SysidWarning: The input excites too little, means do not fit the dynamics, or the instruments are dependent.
    """
    experiments = as_experiments(data, missing=True)
    check_single_output(experiments)
    nu = experiments[0].nu
    orders = make_orders(nu, na=na, nb=nb, nk=nk)
    signals = external_signals("x", data, x)
    if signals[0].shape[1] not in (1, 1 + nu):
        raise SysidError(f"x: expected 1 or {1 + nu} columns, in place of y or of y and u, got {signals[0].shape[1]}")
    instruments = signals
    if signals[0].shape[1] == 1:
        # in open loop the inputs are their own instruments
        instruments = [np.hstack((z, e.u)) for z, e in zip(signals, experiments, strict=True)]
    messages = check_excitation(experiments, orders.nb) + check_means(experiments, orders.na)
    usable = check_enough_data(experiments, orders, transients=0)
    fit, *_ = solve_with_instruments(experiments, orders, instruments, WHITE)
    whitener = disturbance_whitener(experiments, orders, fit.solution[:, 0], usable)
    fit, shape, weights = solve_with_instruments(experiments, orders, instruments, WHITE, colour=whitener)
    return instrumental_estimate("ivx", experiments, orders, fit, shape, weights, whitener, messages, filtered=False)
