"""Two-stage identification in a loop, from the part of the input that an external reference explains."""

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.models.estimate import Estimate
from sysid.models.predict import predict, residuals
from sysid.polynomial.arx import arx
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.oe import oe
from sysid.polynomial.orders import make_orders
from sysid.polynomial.polynomial_estimate import directions
from sysid.polynomial.prediction_error import linearise, output_errors
from sysid.polynomial.regressors import arx_regressors
from sysid.polynomial.robust_covariance import long_run_covariance
from sysid.records.arguments import whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidWarning
from sysid.records.external_signals import external_signals

ORDERS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)  # of the model of the input, of which AIC selects one
ROWS_PER_COEFFICIENT = 10  # least number of samples per coefficient of it: noise that it explains is bias


def two_stage(
    data: IOData | Sequence[IOData],
    nb: int | Sequence[int],
    nf: int | Sequence[int],
    nk: int | Sequence[int],
    reference: ArrayLike | Sequence[ArrayLike],
    *,
    order: int | None = None,
) -> Estimate:
    """Fit y = B(q)/F(q) u + v under feedback, by means of an external reference [VanDenHof1993].

    The first stage is an ARX model from the reference to each input, the second `oe` from the inputs that it simulates,
    which v does not reach, to the output. It needs no model of v and does not use the controller. `bj`, `polyest` and
    `pem_ss` of the measured input are more accurate where their model of v is right, and biased where it is not.

    The covariance allows for v of any colour and for the errors of the first stage.

    Args:
        data: One experiment, or several that share the model.
        nb: Number of coefficients of B, one for all inputs or one per input.
        nf: Degree of F, likewise.
        nk: Delay in samples, likewise; nk = 1 means y(t) depends on u(t-1) first, nk = 0 gives a direct term.
        reference: Signals that excite the loop from outside, independent of v (N,) or (N, nr), at least as many as
            inputs; for several experiments, a sequence with one array for each.
        order: Of the ARX models of the first stage; by default AIC selects it, up to 32.

    Returns:
        The estimate; parameters b1.., f1... Its residuals are those of the measured input.

    Raises:
        SysidError: Constant input or reference, several outputs, missing samples, orders negative or too many for the
            data, a reference of another length.

    Warns:
        SysidWarning: As `oe`.
    """
    experiments = as_experiments(data)
    references = external_signals("reference", data, reference)
    simulated = [e.u.copy() for e in experiments]
    stages = []
    for j in range(experiments[0].nu):
        loop = [IOData(r, e.u[:, j], e.dt, window=e.window) for r, e in zip(references, experiments, strict=True)]
        stages.append(_input_model(loop, order))
        for u, e in zip(simulated, loop, strict=True):
            u[:, j] = predict(stages[-1], e, steps=None)[:, 0]
    projected = [replace(e, u=u) for e, u in zip(experiments, simulated, strict=True)]
    estimate = oe(projected, nb, nf, nk, coloured=False)
    orders = make_orders(experiments[0].nu, nb=nb, nf=nf, nk=nk)
    _, b, _, _, f = orders.split(estimate.parameters)
    half = directions(linearise(projected, orders, estimate.parameters))[0]
    columns = output_errors(projected, orders, estimate.parameters, InitialConditions.ESTIMATED)
    sensitivities = [part[:, :-1] @ half for part in columns]
    # terms of the error: those of oe, and what the errors of the first stage, least squares too, add to them
    series = [np.zeros((len(e), half.shape[1])) for e in experiments]
    for terms, part, own in zip(series, columns, sensitivities, strict=True):
        terms[-len(own) :] = own * part[:, -1:]
    for j, stage in enumerate(stages):
        rows = [_regressors(e, j, r, stage) for e, r in zip(experiments, references, strict=True)]
        path = b[j], np.convolve(f[j], np.concatenate(([1.0], stage.parameters[: stage.orders["na"]])))
        cross: FloatArray | float = 0.0
        for own, e, r in zip(sensitivities, projected, references, strict=True):
            moved = scipy.signal.lfilter(*path, _regressors(e, j, r, stage), axis=0)
            cross = cross + own[-len(moved) :].T @ moved[-len(own) :]
        weight = np.linalg.pinv(sum(row.T @ row for row in rows)) @ np.transpose(cross)
        for terms, row, e in zip(series, rows, experiments, strict=True):
            errors = e.u[-len(row) :, j] - row @ stage.parameters
            terms[-len(row) :] -= (row @ weight) * errors[:, None]
    v = np.concatenate([residuals(estimate, e) for e in experiments])
    return replace(
        estimate,
        method="two_stage",
        covariance=half @ long_run_covariance(series) @ half.T,
        noise_variance=v.T @ v / (len(v) - orders.count),
        residuals=v,
        diagnostics={**estimate.diagnostics, "first_stage_orders": tuple(stage.orders["na"] for stage in stages)},
    )


def _input_model(loop: Sequence[IOData], order: int | None) -> Estimate:
    """ARX model from the references to an input."""
    nr, samples = loop[0].nu, sum(len(e) - e.window for e in loop)
    most = (samples // ROWS_PER_COEFFICIENT - nr) // (1 + nr)
    tried = [n for n in ORDERS if n <= max(most, 1)] if order is None else [whole_number("order", order, 1)]
    with warnings.catch_warnings():
        # of the orders that are tried, most are too large or too small
        warnings.simplefilter("ignore", SysidWarning)
        return min((arx(loop, n, n + 1, 0) for n in tried), key=lambda estimate: estimate.aic)


def _regressors(e: IOData, j: int, r: FloatArray, stage: Estimate) -> FloatArray:
    n, nr = stage.orders["na"], r.shape[1]
    return arx_regressors(e.u[:, j], r, n, (n + 1,) * nr, (0,) * nr, max(n, e.window))
