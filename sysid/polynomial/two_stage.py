"""Two-stage identification in a loop, from the part of the input that an external reference explains."""

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.models.estimate import Estimate
from sysid.models.predict import predict, residuals
from sysid.models.repeated_errors import beyond_independent, mean_period, repeated_errors
from sysid.polynomial.arx import arx
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.oe import oe
from sysid.polynomial.orders import Orders, make_orders
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
    stages, projected = _first_stage(experiments, references, order)
    estimate = oe(projected, nb, nf, nk, coloured=False)
    orders = make_orders(experiments[0].nu, nb=nb, nf=nf, nk=nk)
    v = np.concatenate([residuals(estimate, e) for e in experiments])
    return replace(
        estimate,
        method="two_stage",
        covariance=_covariance(experiments, references, stages, projected, orders, estimate.parameters),
        noise_variance=v.T @ v / (len(v) - orders.count),
        residuals=v,
        diagnostics={**estimate.diagnostics, "first_stage_orders": tuple(stage.orders["na"] for stage in stages)},
    )


def _first_stage(
    experiments: Sequence[IOData], references: Sequence[FloatArray], order: int | None
) -> tuple[list[Estimate], list[IOData]]:
    """Models from the references to each input, and the experiments with the inputs that these simulate."""
    simulated = [e.u.copy() for e in experiments]
    stages = []
    for j in range(experiments[0].nu):
        loop = []
        for reference, e in zip(references, experiments, strict=True):
            loop.append(IOData(reference, e.u[:, j], e.dt, window=e.window))
        stages.append(_input_model(loop, order))
        for u, record in zip(simulated, loop, strict=True):
            u[:, j] = predict(stages[-1], record, steps=None)[:, 0]
    return stages, [replace(e, u=u) for e, u in zip(experiments, simulated, strict=True)]


def _input_model(loop: Sequence[IOData], order: int | None) -> Estimate:
    """ARX model from the references to an input."""
    nr, samples = loop[0].nu, sum(len(e) - e.window for e in loop)
    highest = (samples // ROWS_PER_COEFFICIENT - nr) // (1 + nr)
    candidate_orders = [n for n in ORDERS if n <= max(highest, 1)]
    if order is not None:
        candidate_orders = [whole_number("order", order, 1)]
    with warnings.catch_warnings():
        # of the orders that are tried, most are too large or too small
        warnings.simplefilter("ignore", SysidWarning)
        return min((arx(loop, n, n + 1, 0) for n in candidate_orders), key=lambda estimate: estimate.aic)


def _covariance(
    experiments: Sequence[IOData],
    references: Sequence[FloatArray],
    stages: Sequence[Estimate],
    projected: Sequence[IOData],
    orders: Orders,
    theta: FloatArray,
) -> FloatArray:
    """Covariance of the parameters (p, p), for a disturbance of any colour and the errors of the first stage.

    With L L' = (J' J)^-1, the error of the parameters is L times the sum over time of L' psi(t) e(t), to which the
    errors of the first stage add terms. The covariance of the sum is the long-run covariance of these terms.
    """
    half = directions(linearise(projected, orders, theta))[0]
    tables = output_errors(projected, orders, theta, InitialConditions.ESTIMATED)
    sensitivities = [table[:, :-1] @ half for table in tables]
    terms = [np.zeros((len(e), half.shape[1])) for e in experiments]
    for term, table, sensitivity in zip(terms, tables, sensitivities, strict=True):
        term[-len(sensitivity) :] = sensitivity * table[:, -1:]
    _, b, _, _, f = orders.split(theta)
    for j, stage in enumerate(stages):
        # errors of the stage's parameters change the simulated input through 1/A of the stage, the output through B/F
        stage_a = np.concatenate(([1.0], stage.parameters[: stage.orders["na"]]))
        path = b[j], np.convolve(f[j], stage_a)
        cross: FloatArray | float = 0.0
        for sensitivity, e, reference in zip(sensitivities, projected, references, strict=True):
            output_changes = scipy.signal.lfilter(*path, _regressors(e, j, reference, stage), axis=0)
            cross = cross + sensitivity[-len(output_changes) :].T @ output_changes[-len(sensitivity) :]
        # these errors are least squares too: (X' X)^-1 times the sum of x(t) times the error of the input
        rows = [_regressors(e, j, reference, stage) for e, reference in zip(experiments, references, strict=True)]
        weight = np.linalg.pinv(sum(row.T @ row for row in rows)) @ np.transpose(cross)
        for term, row, e in zip(terms, rows, experiments, strict=True):
            input_errors = e.u[-len(row) :, j] - row @ stage.parameters
            term[-len(row) :] -= (row @ weight) * input_errors[:, None]
    of_sum = long_run_covariance(terms)
    by_reference = [IOData(r, e.y, e.dt, window=e.window) for r, e in zip(references, experiments, strict=True)]
    repeated = repeated_errors(by_reference, terms)
    if repeated is not None and repeated.is_significant:
        samples, of_independent = sum(map(len, terms)), of_sum
        for group in repeated.groups:
            # what is the same in all periods adds up with their number, not with its root
            of_mean = group.count**2 * long_run_covariance([mean_period(group, terms)])
            of_sum = of_sum + beyond_independent(of_mean, group.count * group.period / samples * of_independent)
    return half @ of_sum @ half.T


def _regressors(e: IOData, j: int, reference: FloatArray, stage: Estimate) -> FloatArray:
    """Regressors of a stage, of one input of a record and the references, without the samples that only initialise."""
    n, nr = stage.orders["na"], reference.shape[1]
    return arx_regressors(e.u[:, j], reference, n, (n + 1,) * nr, (0,) * nr, max(n, e.window))
