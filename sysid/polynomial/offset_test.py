"""A test for a constant in the outputs that a fitted model lacks."""

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sysid.models.predict import residuals
from sysid.models.state_space import StateSpace
from sysid.polynomial.correlation import ERRORS_PER_COEFFICIENT, colour, relative_spectrum
from sysid.polynomial.error_jacobian import error_jacobian
from sysid.polynomial.fit_with_offset import unexplained_offset
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.orders import Orders
from sysid.polynomial.prediction_error import Linearisation, LinearModel, linearise, minimise
from sysid.polynomial.trends import OFFSET
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import Message, SysidWarning

MATERIAL = 0.05  # offset, relative to the deviation of the output, from which on it biases a gain noticeably
CERTAIN = 30.0  # evidence, chi-squared with a degree of freedom for each output: five deviations
LONGEST = 20_000  # samples of a record that are looked at: a transient at the beginning moves the mean of no longer one
REFINEMENTS = 15  # steps of a fit with a constant, which shows whether the one without lacks it
EXACT = 1e-20  # sum of squares of the errors, relative to that of the outputs, that is rounding

MISSING_OFFSET = "missing-offset"  # code of the message on an offset that the errors keep
ADVICE = "; oe, arx, armax, bj, tfest and procest take offset=True"


def offset_messages(
    model: StateSpace, experiments: Sequence[IOData], errors: Sequence[FloatArray] | None = None
) -> list[str]:
    """Describe the constant that one-step errors show, the most certain of all experiments.

    A record that begins far from its level keeps a constant when its mean is subtracted, as the transient belongs to
    the mean. Nothing in the fit tells it: the gain gives way. The evidence is the decrease of the squared errors by a
    constant in the output, the initial state free, over their spectrum at 0 Hz. The one-step `errors` of each
    experiment (N, ny), from any initial state, need not be computed again where they are known.
    """
    if not model.nu:
        return []
    best, evidence, where = np.zeros(model.ny), 0.0, ""
    for k, experiment in enumerate(experiments):
        record = experiment[: experiment.window + LONGEST]
        known_errors = None if errors is None else errors[k][: len(record)]
        offset, found = _evidence(model, record, known_errors)
        if found > evidence:
            best, evidence = offset, found
            where = f" in experiment {experiment.name or k + 1}" if len(experiments) > 1 else ""
    return offset_message(best, evidence, where, experiments[0].output_names or ())


def offset_message(offset: FloatArray, evidence: float, where: str, names: Sequence[str]) -> list[str]:
    """The message on an offset of each output (ny,), if the evidence is enough."""
    if evidence <= CERTAIN:
        return []
    levels = ", ".join(f"about {level:.4g} in {name}" for name, level in zip(names, offset, strict=True))
    text = (
        f"the errors{where} keep an offset of the output, {levels}, which the model lacks: its gain and slow poles are "
        f"biased, as where the mean of a transient was subtracted{ADVICE}"
    )
    return [Message(text, MISSING_OFFSET, offset=ADVICE)]


def missing_constant(experiments: Sequence[IOData], orders: Orders, at: Linearisation) -> list[str]:
    """Message on a constant of the output that a polynomial model lacks, by a fit with one, refined for a few steps.

    The parameters move: those of an output-error model follow the transient that a constant leaves, and nothing is seen
    as long as they stay.
    """
    if max(map(len, experiments)) > LONGEST or not orders.nb:
        return []
    with_constant = replace(orders, trend=OFFSET)
    energy = sum(float(e.y[:, 0] @ e.y[:, 0]) for e in experiments)
    if not at.cost > EXACT * energy:
        return []
    start = linearise(experiments, with_constant, at.theta)
    _, promised = LinearModel.at(start, None).step(0.0)
    free = start.errors - orders.count - start.transients
    if free < 1 or (at.cost - start.cost + promised) * free <= CERTAIN * max(start.cost - promised, 0.0):
        return []
    refined = minimise(experiments, with_constant, start, max_iterations=REFINEMENTS).at
    errors, constants = [], []
    for experiment in experiments:
        jacobian = error_jacobian(experiment, with_constant, refined.theta, InitialConditions.ESTIMATED)
        errors.append(jacobian.columns[:, -1])
        constants.append(float(jacobian.trend[0]))
    return constant_messages(experiments, at, refined, errors, constants)


def constant_messages(
    experiments: Sequence[IOData],
    at: Linearisation,
    refined: Linearisation,
    errors: Sequence[FloatArray],
    constants: Sequence[float],
) -> list[str]:
    """Message on a constant of the only output that a model lacks, from fits without and with one.

    Args:
        experiments: The data.
        at: The minimum without constants.
        refined: A minimum with them.
        errors: Its errors (N_i,) of each experiment.
        constants: Its constants.
    """
    free = refined.errors - len(refined.theta) - refined.transients
    energy = sum(float(np.nansum(experiment.y**2)) for experiment in experiments)
    if free < 1 or not refined.cost > EXACT * energy:
        return []
    decrease = (at.cost - refined.cost) / (refined.cost / free) / len(experiments)
    evidence, place = 0.0, 0
    for k, (experiment, constant) in enumerate(zip(experiments, constants, strict=True)):
        is_larger = not evidence or abs(constant) > abs(constants[place])
        if is_larger and is_material(np.array([constant]), experiment):
            place, evidence = k, decrease / max(spectrum_at_zero(errors[k][:, None]), 1.0)
    where = f" in experiment {experiments[place].name or place + 1}" if len(experiments) > 1 else ""
    return offset_message(np.array([constants[place]]), evidence, where, experiments[0].output_names or ())


def _evidence(model: StateSpace, record: IOData, errors: FloatArray | None) -> tuple[FloatArray, float]:
    """Constant of each output (ny,) that explains most of the errors, and its evidence; 0 where it cannot be told."""
    samples = int(record.known[record.window :].sum())
    free = samples - model.order - model.ny
    none = np.zeros(model.ny)
    if free < ERRORS_PER_COEFFICIENT:
        return none, 0.0
    offset, before, after = unexplained_offset(model, [record], None if errors is None else [errors])
    exact = EXACT * float(np.nansum(record.y**2))
    if not np.isfinite(before) or not after > exact:
        return none, 0.0
    evidence = (before - after) / (after / free) / model.ny
    if evidence <= CERTAIN:
        return none, 0.0
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", SysidWarning)
        errors = residuals(model, record.subtract(y=offset))[record.window :]
    if not np.isfinite(errors[record.known[record.window :]]).all():
        return none, 0.0
    return offset, float(is_material(offset, record)) * evidence / max(spectrum_at_zero(errors), 1.0)


def is_material(offset: FloatArray, record: IOData) -> bool:
    """Whether an offset of the outputs (ny,) is large enough beside their movements to bias a gain noticeably."""
    return bool((np.abs(offset) > MATERIAL * np.nanstd(record.y[record.window :], axis=0)).any())


def spectrum_at_zero(errors: FloatArray) -> float:
    """Largest spectrum at 0 Hz of errors (N, ny), NaN where missing, relative to that of white ones."""
    return max(relative_spectrum(*colour(column), 0.0) for column in errors.T)
