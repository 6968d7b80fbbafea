"""Likelihood fit of transfer functions to records: output errors by Levenberg-Marquardt, delays in real numbers."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.continuous.known_parameters import Known, known_parameters
from sysid.continuous.output_error_criterion import TIGHT, OutputError
from sysid.continuous.output_error_search import OutputFit, lowest_minimum
from sysid.continuous.stability_limit import MARGIN, distance_to_axis
from sysid.continuous.structures import PathStructure, RealisePaths, names_of_paths
from sysid.continuous.unstable_plant import unstable_plant_messages
from sysid.frequency.far_delay import far_delay
from sysid.models.continuous import Resampled
from sysid.models.continuous_estimate import ContinuousEstimate
from sysid.models.data_summary import DataSummary
from sysid.models.predict import residuals
from sysid.models.repeated_errors import count_repetition_once
from sysid.polynomial.data_checks import check_excitation, check_means
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.least_squares import scaled_triangle
from sysid.polynomial.offset_test import LONGEST, REFINEMENTS, constant_messages
from sysid.polynomial.outliers import outlier_messages
from sysid.polynomial.polynomial_estimate import COLOUR, ILL_CONDITIONED, directions
from sysid.polynomial.prediction_error import coloured_information, levenberg_marquardt
from sysid.records.arguments import real_number, shown, truth_value, whole_number
from sysid.records.arrays import FloatArray, real_array
from sysid.records.data import IOData, as_experiments, complete_parts
from sysid.records.errors import SysidError, warn_each

AT_THE_LIMIT = 4.0  # times the least distance of poles from the imaginary axis, within which they are at the limit
LONGEST_DELAY = 30  # samples, the default limit on delays that are estimated, where nothing shows a longer one


def output_error_estimate(
    method: str,
    data: IOData | Sequence[IOData],
    structures_of: Callable[[int, int], tuple[tuple[PathStructure, ...], ...]],
    orders: Mapping[str, Any],
    *,
    max_delay: float | None,
    max_iterations: int,
    coloured: bool,
    initial_conditions: InitialConditions | str,
    offset: bool,
    start: ArrayLike | None = None,
    fixed: Mapping[str, float] | None = None,
) -> ContinuousEstimate:
    """Check the data, fit output by output, and return the estimate.

    Errors of several outputs may be correlated: the covariance of parameters of two outputs is that of their errors
    times (J1' J1)^-1 J1' J2 (J2' J2)^-1. `structures_of` maps the numbers of outputs and inputs to the structures, one
    row per output; `orders` are what the estimate reports; options are those of `tfest`.
    """
    coloured, offset = truth_value("coloured", coloured), truth_value("offset", offset)
    max_iterations = whole_number("max_iterations", max_iterations, 1)
    experiments = as_experiments(data, missing=True)
    initial_conditions = InitialConditions.of(initial_conditions)
    if initial_conditions is InitialConditions.BACKCAST:
        raise SysidError(f"{method} has no noise model to backcast: initial_conditions must be 'estimated' or 'zero'")
    free = initial_conditions is InitialConditions.ESTIMATED
    intersample = _common_intersample(experiments)
    rows = structures_of(experiments[0].ny, experiments[0].nu)
    if max_delay is None:
        estimated = any(structure.delay is None for row in rows for structure in row)
        max_delay = longest_delay(experiments) if estimated else 0.0
    max_delay = _checked_delay("max_delay", max_delay, experiments)
    known = known_parameters(fixed, names_of_paths(rows), rows)
    for row, known_of_output in zip(rows, known, strict=True):
        _check_structures(row, known_of_output, experiments, free, offset)
    messages = _excitation_messages(experiments, rows, free=free, offset=offset)
    starts = _starts_of_outputs(start, rows)
    fits = []
    for i, row in enumerate(rows):
        single = [e.select(outputs=[i]) for e in experiments]
        criterion = OutputError(single, row, max_delay, free, offset, known=known[i])
        _check_enough(criterion)
        fits.append(lowest_minimum(criterion, max_iterations, starts[i]))
    theta = np.concatenate([fit.minimum.at.theta for fit in fits])
    covariance, noise, condition = _covariances(fits, coloured)
    levels = [fit.offsets() for fit in fits] if offset else []
    if offset:
        experiments = tuple(e.subtract(y=level) for e, *level in zip(experiments, *levels, strict=True))
    summary = DataSummary.of(experiments)
    realise = RealisePaths(rows, summary, intersample, noise)
    messages += _fit_messages(method, fits, realise, theta, np.sqrt(np.diag(covariance)), condition)
    if not any("offset" in message for message in messages):
        messages += itertools.chain.from_iterable(map(_missing_constant, fits))
    messages += itertools.chain.from_iterable(map(_outliers, fits))
    warn_each(messages, stacklevel=2)
    sampled = Resampled(realise)
    model = sampled(theta)
    estimate = ContinuousEstimate(
        model=model,
        polynomials=None,
        parameters=theta,
        parameter_names=realise.names,
        covariance=covariance,
        noise_variance=noise,
        residuals=np.concatenate([residuals(model, e) for e in experiments]),
        method=method,
        orders=orders,
        diagnostics=_diagnostics(fits, levels, condition, messages),
        data=summary,
        realise=sampled,
        realise_continuous=realise,
    )
    return count_repetition_once(estimate, experiments)


def _starts_of_outputs(start: ArrayLike | None, rows: tuple[tuple[PathStructure, ...], ...]) -> list[FloatArray | None]:
    """Parameters of each output at which its search begins; None where it finds its own."""
    if start is None:
        return [None] * len(rows)
    counts = [sum(len(structure.names) for structure in row) for row in rows]
    theta = real_array("start", start)
    if theta.shape != (sum(counts),) or not np.isfinite(theta).all():
        raise SysidError(f"start: expected the {sum(counts)} parameters of the structure, got {shown(start)}")
    return list(np.split(theta, np.cumsum(counts)[:-1]))


def _missing_constant(fit: OutputFit) -> list[str]:
    """Message on a constant of an output that its model lacks, by a fit with one, refined for a few steps."""
    criterion, at = fit.criterion, fit.minimum.at
    integrates = any(structure.integrators for structure in criterion.structures)
    if criterion.offset or not criterion.free or integrates or max(map(len, criterion.experiments)) > LONGEST:
        return []
    with_constant = replace(criterion, offset=True)
    start = with_constant(at.theta)
    if start is None or not at.cost > 0.0:
        return []
    energy = sum(float(np.nansum(experiment.y**2)) for experiment in criterion.experiments)
    refined = levenberg_marquardt(with_constant, start, energy, max_iterations=REFINEMENTS).at
    errors, constants = [], []
    for experiment in criterion.experiments:
        columns, _, constant = with_constant.columns(experiment, refined.theta)
        errors.append(columns[:, -1])
        constants.append(constant)
    return constant_messages(criterion.experiments, at, refined, errors, constants)


def _outliers(fit: OutputFit) -> list[str]:
    """Message on outliers among the errors that count."""
    criterion, theta = fit.criterion, fit.minimum.at.theta
    errors = [_all_samples(criterion, experiment, theta)[:, -1] for experiment in criterion.experiments]
    for experiment, of_record in zip(criterion.experiments, errors, strict=True):
        of_record[: criterion.first(experiment)] = np.nan
    return outlier_messages(errors, criterion.experiments)


def longest_delay(experiments: Sequence[IOData]) -> float:
    """Largest delay that is tried by default, s: longer where one input shows a delay beyond it."""
    shortest = _shortest(experiments)
    limit = min(LONGEST_DELAY, shortest // 10)
    if experiments[0].nu * experiments[0].ny == 1:
        parts = complete_parts(experiments)
        far = far_delay(parts, limit) if parts else None
        if far is not None:
            limit = min(far + LONGEST_DELAY, shortest // 2)
    return experiments[0].dt * limit


def _common_intersample(experiments: Sequence[IOData]) -> str:
    """Input between samples, held or linear, that all experiments share."""
    intersample = experiments[0].intersample
    if any(e.intersample != intersample for e in experiments):
        raise SysidError(f"experiments must share one intersample, got {[e.intersample for e in experiments]}")
    return intersample


def _shortest(experiments: Sequence[IOData]) -> int:
    """Samples of the shortest record behind its window."""
    return min(len(e) - e.window for e in experiments)


def _checked_delay(name: str, delay: object, experiments: Sequence[IOData]) -> float:
    """A delay within half the shortest record, s: behind it too few samples would show the response."""
    limit = 0.5 * _shortest(experiments) * experiments[0].dt
    expected = f"lie between 0 and half the shortest record, {limit:g} s"
    return real_number(name, delay, expected, lambda value: 0.0 <= value <= limit)


def hides_delay(structure: PathStructure) -> bool:
    """Whether a held input shows its delay only to whole samples: it has as many zeros as poles."""
    return structure.poles == structure.zeros and structure.delay is None


def _check_structures(
    structures: Sequence[PathStructure], known: Known, experiments: Sequence[IOData], free: bool, offset: bool
) -> None:
    """Refuse offsets and delays that the data cannot show."""
    if offset and free and any(structure.integrators for structure in structures):
        raise SysidError(
            "offset: the free initial state of an integrator is a constant already; offset=True goes with "
            "initial_conditions='zero'"
        )
    last, hidden = -1, False
    for structure in structures:
        last += len(structure.names)
        delay = known.get(last) if structure.delay is None else structure.delay
        if delay is not None:
            _checked_delay("delay", delay, experiments)
        hidden |= hides_delay(structure) and delay is None
    if hidden and experiments[0].intersample == "zoh":
        raise SysidError(
            "a held input shows the delay of a transfer function with as many zeros as poles only to whole "
            "samples: try fewer zeros, or a known delay"
        )


def _excitation_messages(
    experiments: Sequence[IOData], rows: tuple[tuple[PathStructure, ...], ...], *, free: bool, offset: bool
) -> list[str]:
    """Warnings of inputs that excite too few frequencies for the orders, and of means that are not removed."""
    needed = []
    for of_input in zip(*rows, strict=True):
        needed.append(max(structure.poles + structure.zeros + 1 for structure in of_input))
    messages = check_excitation(experiments, needed, rest=not free)
    if not offset:
        messages += check_means(experiments, max(structure.poles for row in rows for structure in row))
    return messages


def _fit_messages(
    method: str,
    fits: Sequence[OutputFit],
    realise: RealisePaths,
    theta: FloatArray,
    deviations: FloatArray,
    condition: float,
) -> list[str]:
    """Warnings of searches that did not converge, of delays at their limits, and of parameters in doubt."""
    messages, begin = [], 0
    for fit, output in zip(fits, realise.data.output_names, strict=True):
        criterion, minimum = fit.criterion, fit.minimum
        if not minimum.converged:
            messages.append(f"{method} did not converge for output {output}: {minimum.reason}")
        end = begin + criterion.sizes[-1]
        values, spread = criterion.split(theta[begin:end]), criterion.split(deviations[begin:end])
        for j, structure in enumerate(criterion.structures):
            messages += structure.warnings(values[j], spread[j])
        if fit.early:
            messages.append(
                f"the inputs of output {output} move in the first samples above all, whose errors do not count because "
                "the input before the record is unknown (that it was held there does not agree with them): a smaller "
                "max_delay, a record that begins earlier or initial_conditions='zero' uses them"
            )
        messages += unstable_plant_messages(fit, output) or _edge_messages(fit, output)
        at_limits = _delay_messages(fit, realise.names[begin:end])
        messages += at_limits
        # a delay at its limit has no derivative, which makes the condition large by itself
        if not at_limits and condition > ILL_CONDITIONED and minimum.at.cost > 0.0:
            messages.append(f"the parameters are poorly determined: condition number {condition:.2g} of the Jacobian")
        begin = end
    return messages


def _edge_messages(fit: OutputFit, output: str) -> list[str]:
    """Warning of poles that the search left at the imaginary axis."""
    criterion = fit.criterion
    limit = AT_THE_LIMIT * MARGIN / criterion.experiments[0].dt
    distances = []
    for structure, path in zip(criterion.structures, criterion.transfers(fit.minimum.at.theta), strict=True):
        distances.append(distance_to_axis(path.a[structure.integrators :]))
    if min(distances) > limit:
        return []
    return [
        f"a pole of output {output} is at the edge of stability, undamped or unstable: intervals may be wrong; "
        "armax(data, ...) and arx(data, ...) estimate unstable plants too"
    ]


def _delay_messages(fit: OutputFit, names: Sequence[str]) -> list[str]:
    """Warnings of delays at their limits; `names` are those of the parameters of the output."""
    criterion, theta = fit.criterion, fit.minimum.at.theta
    messages = []
    for k in criterion.delays():
        delay = f"the delay {names[k]}"
        if theta[k] == 0.0:
            messages.append(f"{delay} is at its lower limit 0: intervals are approximate")
        elif theta[k] >= criterion.longest - TIGHT * criterion.experiments[0].dt:
            messages.append(f"{delay} is at its limit {criterion.longest:g} s: a larger max_delay may fit better")
    return messages


def _diagnostics(
    fits: Sequence[OutputFit], levels: list[list[float]], condition: float, messages: list[str]
) -> dict[str, Any]:
    """What the estimate reports of the searches."""
    minima = [fit.minimum for fit in fits]
    effective = {}
    if any(fit.criterion.known for fit in fits):
        effective["effective_parameters"] = float(sum(len(fit.criterion.free_parameters) for fit in fits))
    return {
        **effective,
        "condition": condition,
        "iterations": sum(minimum.iterations for minimum in minima),
        "converged": all(minimum.converged for minimum in minima),
        "reason": "; ".join(minimum.reason for minimum in minima),
        "offsets": tuple(map(tuple, levels)),
        "input_before": tuple(_input_before(fit.criterion) for fit in fits),
        "initial_estimates": sum(fit.starts for fit in fits),
        "sum_of_squares": tuple(minimum.at.cost for minimum in minima),
        "warnings": tuple(messages),
    }


def _input_before(criterion: OutputError) -> str:
    """What the fit assumes about the inputs before the record, in a word."""
    if not criterion.free:
        return "zero"
    return "held" if criterion.held else "unknown"


def _check_enough(criterion: OutputError) -> None:
    """Refuse data with fewer errors than unknowns."""
    states = int(criterion.offset)
    if criterion.free:
        states += sum(structure.poles for structure in criterion.structures)
    usable, count = criterion.usable(), len(criterion.free_parameters)
    if sum(usable) <= count + states * len(usable) or min(usable) <= states:
        raise SysidError(
            f"too many orders for the data: {count} parameters and {states} initial states and offsets per experiment "
            f"from {sum(usable)} usable samples in {len(usable)} experiment(s)"
        )


@dataclass(frozen=True, eq=False)
class OutputCovariance:
    """Covariance of the parameters of one output, and what those of two outputs follow from.

    Attributes:
        variance: Of the errors.
        covariance: Of the parameters (p, p).
        influence: J (J' J)^-1, of the projected derivatives J of all samples (N, p).
        errors: Of all samples, zero where none counts (N,).
        condition: Condition number of the derivatives.
    """

    variance: float
    covariance: FloatArray
    influence: FloatArray
    errors: FloatArray
    condition: float


def _covariances(fits: Sequence[OutputFit], coloured: bool) -> tuple[FloatArray, FloatArray, float]:
    """Covariance of all parameters, that of the errors (ny, ny), and the largest condition number."""
    outputs = [_covariance_of_output(fit, coloured) for fit in fits]
    noise = np.diag([output.variance for output in outputs])
    covariance = scipy.linalg.block_diag(*(output.covariance for output in outputs))
    begin = np.cumsum([0, *(len(output.covariance) for output in outputs)])
    for i, j in itertools.permutations(range(len(fits)), 2):
        first, second = outputs[i], outputs[j]
        noise[i, j] = _covariance_of_errors(first, second)
        cross = noise[i, j] * first.influence.T @ second.influence
        covariance[begin[i] : begin[i + 1], begin[j] : begin[j + 1]] = cross
    return covariance, noise, max(output.condition for output in outputs)


def _covariance_of_errors(first: OutputCovariance, second: OutputCovariance) -> float:
    """Covariance of the errors of two outputs: their correlation where both are known, times the deviations."""
    common = (first.errors != 0.0) & (second.errors != 0.0)
    sizes = np.linalg.norm(first.errors[common]) * np.linalg.norm(second.errors[common])
    correlation = first.errors @ second.errors / sizes if sizes else 0.0
    return float(np.sqrt(first.variance * second.variance) * correlation)


def _covariance_of_output(fit: OutputFit, coloured: bool) -> OutputCovariance:
    """Covariance of the parameters of one output, with the colour of the errors taken into account if asked for."""
    criterion, at = fit.criterion, fit.minimum.at
    theta, delays = at.theta.copy(), criterion.delays()
    # a delay fixed at 0 has the interval of a free one, by the derivative from the right
    theta[delays] = np.maximum(theta[delays], 2.0 * TIGHT * criterion.experiments[0].dt)
    estimated = criterion.free_parameters
    tables = []
    for experiment in criterion.experiments:
        tables.append(_all_samples(criterion, experiment, theta)[:, [*estimated, -1]])
    columns = np.nan_to_num(np.vstack(tables))
    triangle, lengths = scaled_triangle(columns, guarded=len(estimated))
    half, condition = directions(replace(at, triangle=triangle[:-1, :-1], scale=lengths[:-1]))
    variance = at.cost / (at.errors - len(estimated) - at.transients)
    # errors of any colour in a criterion for white ones [White1982]: (J' J)^-1 = half half', between which theirs goes
    middle = np.eye(half.shape[1])
    if coloured and at.cost > 0.0:
        # at most a coefficient of the colour for twenty errors
        counted = [table[criterion.first(e) :] for e, table in zip(criterion.experiments, tables, strict=True)]
        middle = coloured_information(counted, min(COLOUR, at.errors // 20), half)
    # parameters that are known have no variance
    every = np.eye(len(theta))[:, estimated]
    covariance = every @ (variance * half @ middle @ half.T) @ every.T
    influence = columns[:, :-1] @ half @ half.T @ every.T
    return OutputCovariance(variance, covariance, influence, columns[:, -1], condition)


def _all_samples(criterion: OutputError, experiment: IOData, theta: FloatArray) -> FloatArray:
    """Derivatives and errors with a row for every sample, so that those of several outputs go together (N, p + 1).

    Zeros where no error counts, NaN for the error of a missing output.
    """
    first = criterion.first(experiment)
    table = np.zeros((len(experiment), len(theta) + 1))
    table[first:, -1] = np.nan
    table[first:][experiment.known[first:, 0]] = criterion.columns(experiment, theta)[0]
    return table
