"""Estimates of polynomial models: checks before the fit, the prediction-error fit, and the public record."""

import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

from sysid.models.data_summary import DataSummary
from sysid.models.estimate import Estimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.models.polynomials import Polynomials, innovations_form
from sysid.models.predict import residuals
from sysid.models.record_hash import record_hash
from sysid.models.repeated_errors import count_repetition_once
from sysid.models.state_space import StateSpace
from sysid.polynomial.constraints import Constraint, FixedRows, constrained_search, fixed_coefficients
from sysid.polynomial.data_checks import after_rest, check_excitation, check_means, constant_inputs
from sysid.polynomial.error_jacobian import jacobian_of_record
from sysid.polynomial.error_threshold import HuberFit, checked_error_threshold, huber_fit
from sysid.polynomial.focus import Focus, checked_focus
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.initial_estimates import check_room_to_start, fill_gaps, initial_estimates
from sysid.polynomial.interval_warnings import interval_messages, near_unit_circle
from sysid.polynomial.offset_test import missing_constant, offset_messages
from sysid.polynomial.orders import Orders, make_orders
from sysid.polynomial.outliers import outlier_messages
from sysid.polynomial.prediction_error import (
    InitialEstimate,
    Linearisation,
    Minimum,
    Search,
    coloured_information,
    linearise,
    output_errors,
    search,
    search_of_long_records,
)
from sysid.polynomial.robust_covariance import curvature_covariance, sandwich
from sysid.polynomial.simulation_focus import simulation_search
from sysid.polynomial.trends import Levelled, level, trend_degree, trend_terms
from sysid.records.arguments import truth_value, whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning, warn_each
from sysid.records.singular_values import svd


@dataclass(frozen=True)
class Realise:
    """Pure function from parameters to the innovation form; a class, so that estimates can be pickled.

    Attributes:
        orders: Layout of the parameters.
        data: Sampling interval and names for the model.
        variance: Innovation variance that the model carries; None if unknown.
    """

    orders: Orders
    data: DataSummary
    variance: float | None

    def __call__(self, theta: FloatArray) -> StateSpace:
        """Model for parameters (p,)."""
        model = innovations_form(self.orders.polynomials(theta), self.data.dt, self.variance)
        return replace(model, **self.data.labels)


def make_estimate(
    method: str,
    experiments: Sequence[IOData],
    orders: Orders,
    order_values: Mapping[str, Any],
    *,
    theta: FloatArray,
    covariance: FloatArray,
    variance: float,
    diagnostics: Mapping[str, Any],
    messages: Sequence[str],
    at_rest: bool = False,
    recorded: Sequence[IOData] | None = None,
    looked_for_offset: bool = False,
    looks_for_outliers: bool = False,
    is_robust: bool = False,
    repetition_counted: bool = False,
) -> Estimate:
    """Assemble the estimate: model, polynomials, residuals on its own data, their initial state fitted or at rest.

    The `recorded` experiments are those that the model recognises as its own, where trends were subtracted from them.
    Unless the estimator `looked_for_offset`, the errors of the model show whether it lacks one. On request they are
    searched for outliers, which a fit that `is_robust` lets count linearly. Errors that repeat with the input count
    once in the covariance; in that of some estimators they do already, `repetition_counted`.
    """
    summary = DataSummary.of(experiments)
    if recorded is not None:
        summary = replace(summary, hashes=tuple(map(record_hash, recorded)))
    realise = Realise(orders, summary, variance)
    model = realise(theta)
    if not model.is_stable():
        radius = float(np.abs(model.poles()).max())
        message = (
            f"the model is not stable, its largest pole has modulus {radius:.6g}: "
            "its frequency response and bandwidth are those of no steady state"
        )
        messages = (*messages, message)
        # the user's line: estimators call a function for all of a kind, which calls this one
        warnings.warn(message, SysidWarning, stacklevel=4)
    if not (looked_for_offset or orders.trend_terms or any("offset" in message for message in messages)):
        of_offset = offset_messages(model, experiments)
        messages = (*messages, *of_offset)
        warn_each(of_offset, stacklevel=4)
    with warnings.catch_warnings():
        # the estimator has already refused or reported an unstable predictor
        warnings.simplefilter("ignore", SysidWarning)
        initial_state = np.zeros(model.order) if at_rest else None
        errors = [residuals(model, e, x0=initial_state) for e in experiments]
    if looks_for_outliers:
        of_outliers = outlier_messages([of_record[:, 0] for of_record in errors], experiments, count_linearly=is_robust)
        messages = (*messages, *of_outliers)
        warn_each(of_outliers, stacklevel=4)
    estimate = Estimate(
        model=model,
        polynomials=orders.polynomials(theta),
        parameters=theta,
        parameter_names=orders.names,
        covariance=covariance,
        noise_variance=np.array([[variance]]),
        residuals=np.concatenate(errors),
        method=method,
        orders=order_values,
        diagnostics={**diagnostics, "warnings": tuple(messages)},
        data=summary,
        realise=realise,
    )
    return estimate if repetition_counted else count_repetition_once(estimate, experiments)


def known_estimate(
    model: StateSpace,
    polynomials: Polynomials,
    orders: Orders,
    covariance: FloatArray,
    *,
    variance: float,
    data: IOData,
) -> Estimate:
    """Estimate from a foreign model and the covariance (p, p) of its parameters, to propagate it; without residuals.

    The orders say which coefficients are parameters, in the sequence A, B, C, D, F; the variance is that of the
    innovation; the record gives names and the sampling interval.
    """
    summary = DataSummary.of((data,))
    return Estimate(
        model=model,
        polynomials=polynomials,
        parameters=orders.parameters(polynomials),
        parameter_names=orders.names,
        covariance=covariance,
        noise_variance=np.array([[variance]]),
        residuals=np.zeros((0, 1)),
        method="claimed",
        orders={},
        diagnostics={},
        data=summary,
        realise=Realise(orders, summary, variance),
    )


def check_single_output(experiments: Sequence[IOData]) -> None:
    """Refuse several outputs."""
    if experiments[0].ny != 1:
        names = ", ".join(experiments[0].output_names or ())
        raise SysidError(
            f"expected one output, got {experiments[0].ny} ({names}): "
            "identify them one by one with data.select(outputs=[...])"
        )


def check_enough_data(experiments: Sequence[IOData], orders: Orders, transients: int) -> int:
    """Number of prediction errors; refuse data with fewer of them than parameters and initial conditions."""
    longest_delay = max((*orders.nk, 0))
    shortest = min(len(e) for e in experiments)
    if 2 * longest_delay > shortest:
        raise SysidError(
            f"nk = {longest_delay} given, expected a delay of at most half the record: the shortest experiment has "
            f"{shortest} samples"
        )
    usable = [int(e.known[orders.first_row(e.window) :].sum()) for e in experiments]
    rows = sum(usable)
    conditions = transients + orders.trend_terms
    unknown = orders.count + conditions * len(experiments)
    # an experiment that its initial conditions fit exactly says nothing about the model
    if rows <= unknown or min(usable) <= conditions:
        of_trend = f" and {orders.trend_terms} terms of a trend" if orders.trend_terms else ""
        raise SysidError(
            f"too many orders for the data: {orders.count} parameters and {transients} initial conditions{of_trend} "
            f"per experiment from {rows} usable samples in {len(experiments)} experiment(s)"
        )
    return rows


STEADY = (
    3  # rows of rest, over the parameters and the delay, that initial estimates see before a step at the first sample
)
ILL_CONDITIONED = 1e10  # condition of the scaled Jacobian beyond which half the digits of the step are lost
ROUNDING = 1e-14  # singular value of the scaled Jacobian, relative to the largest, that counts as zero
COLOUR = 30  # highest order of the autoregressive model of a coloured disturbance
ROWS_PER_COEFFICIENT = 20  # least number of errors per coefficient of that model
LONG = 100_000  # samples beyond which stretches of the records are searched first


def prediction_error_estimate(
    method: str,
    data: IOData | Sequence[IOData],
    order_values: Mapping[str, Any],
    *,
    start: Polynomials | None,
    max_iterations: int,
    coloured: bool,
    initial_conditions: InitialConditions | str,
    offset: bool = False,
    trend: bool = False,
    series: bool = False,
    error_threshold: float = 0.0,
    fixed: FixedRows | None = None,
    focus: Focus = "prediction",
) -> Estimate:
    """Check the data, minimise the prediction errors, and return the estimate.

    The covariance is variance * (J' J)^-1 with J the exact Jacobian of the errors, initial conditions projected out
    [Ljung1999, ch. 9]; the variance is unbiased: parameters and initial conditions are counted. With
    missing outputs the gaps depend on the parameters too, and the curvature of the likelihood replaces J' J.
    With `coloured`, the covariance allows for errors that are not white; those of OE models are taken to be independent
    of the input, which gives narrower intervals. The orders are those of `make_orders` by name; `series` allows records
    without input. A constant, with `trend` a straight line, in the output of each experiment is projected out likewise.
    Errors of a record that passes a band need not be white, so that `coloured` holds.
    """
    _refuse_response(method, data)
    problem = _checked_problem(
        data,
        order_values,
        coloured=coloured,
        initial_conditions=initial_conditions,
        degree=trend_degree(offset, trend),
        series=series,
        error_threshold=error_threshold,
        fixed=fixed,
        focus=focus,
    )
    orders, experiments = problem.orders, problem.experiments
    first = None if start is None else InitialEstimate("start", orders.parameters(start))
    max_iterations = whole_number("max_iterations", max_iterations, 1)
    conditions = problem.initial_conditions
    find = partial(search, orders=orders, start=first, max_iterations=max_iterations, initial_conditions=conditions)
    if problem.simulates:
        return _simulation_estimate(method, problem, order_values, find)
    result = _lowest_minimum(experiments, find, problem.constraint)
    fit = _fit_at_minimum(method, problem, result, max_iterations)
    messages, diagnostics = [*problem.messages, *fit.messages], fit.diagnostics
    warn_each(messages, stacklevel=3)
    # a fit with a constant is one of squares, and of all parameters
    is_free = conditions is InitialConditions.ESTIMATED and problem.constraint is None
    looks_for_offset = is_free and fit.huber is None and all(e.complete for e in experiments)
    if looks_for_offset and problem.levelled is None and not any("offset" in message for message in messages):
        of_offset = missing_constant(experiments, orders, fit.at)
        messages += of_offset
        warn_each(of_offset, stacklevel=3)
    if problem.levelled is not None:
        levelled = problem.levelled.subtract(fit.trends(problem))
        experiments = levelled.experiments
        diagnostics |= trend_diagnostics(levelled)
    return make_estimate(
        method,
        experiments,
        orders,
        orders.select(*order_values),
        theta=fit.at.theta,
        covariance=fit.covariance,
        variance=fit.variance,
        diagnostics=diagnostics,
        messages=messages,
        at_rest=conditions is InitialConditions.ZERO,
        recorded=problem.recorded,
        looked_for_offset=looks_for_offset or fit.huber is not None,
        looks_for_outliers=True,
        is_robust=fit.huber is not None,
    )


@dataclass(frozen=True, eq=False)
class Problem:
    """Checked data and options of a prediction-error fit.

    Attributes:
        recorded: The records.
        experiments: The same, filtered and without their trends.
        levelled: These with their trends; None if none is estimated.
        orders: The structure.
        initial_conditions: Assumption about the time before each experiment.
        coloured: Whether the covariance allows for errors that are not white.
        threshold: Of errors that count by their squares, in robust deviations; 0 for none.
        constraint: The free parameters; None if all are free.
        simulates: Whether the simulation counts, beside a noise model.
        messages: Warnings on the data.
    """

    recorded: tuple[IOData, ...]
    experiments: tuple[IOData, ...]
    levelled: Levelled | None
    orders: Orders
    initial_conditions: InitialConditions
    coloured: bool
    threshold: float
    constraint: Constraint | None
    simulates: bool
    messages: list[str]


def _checked_problem(
    data: IOData | Sequence[IOData],
    order_values: Mapping[str, Any],
    *,
    coloured: bool,
    initial_conditions: InitialConditions | str,
    degree: int,
    series: bool,
    error_threshold: float,
    fixed: FixedRows | None,
    focus: Focus,
) -> Problem:
    """Refuse data and options that do not go together; filter the records and subtract rough trends of this degree."""
    band, simulates = checked_focus(focus)
    coloured = truth_value("coloured", coloured) or band is not None
    # beside a noise model, only complete records show the colour
    shows_colour = not {"na", "nc", "nd"} & order_values.keys()
    recorded = as_experiments(data, missing=shows_colour or not coloured, series=series)
    orders = make_orders(recorded[0].nu, **order_values, trend=degree)
    initial_conditions = InitialConditions.of(initial_conditions)
    threshold = checked_error_threshold(error_threshold)
    if threshold and coloured and not shows_colour:
        raise SysidError("coloured=True or a band as focus, beside a noise model, needs error_threshold=0")
    check_single_output(recorded)
    is_backcast = initial_conditions is InitialConditions.BACKCAST
    if is_backcast and not all(e.complete for e in recorded):
        raise SysidError(
            "initial_conditions=InitialConditions.BACKCAST needs complete outputs; ESTIMATED and ZERO do not, and "
            "data.complete_parts() cuts a record into experiments without gaps"
        )
    # without noise model, predictions are simulations
    simulates = simulates and not shows_colour
    if simulates and (threshold or fixed is not None or coloured or is_backcast):
        raise SysidError(
            "focus='simulation' beside a noise model needs error_threshold=0, fixed=None, coloured=False and "
            "initial_conditions 'estimated' or 'zero'"
        )
    letters = "".join(letter for letter in "ABCDF" if f"n{letter.lower()}" in order_values)
    constraint = fixed_coefficients(fixed, orders, letters)
    experiments = recorded
    from_rest = initial_conditions is InitialConditions.ZERO
    if band is not None:
        # a constant channel is none behind the filter: rounding is left, which looks like excitation
        check_excitation(recorded, [0] * recorded[0].nu, rest=from_rest)
        experiments = band.filtered(experiments, initial_conditions, degree)
    messages = _data_messages(experiments, orders, rest=from_rest)
    levelled = level(experiments, degree) if orders.trend_terms else None
    if levelled is not None:
        experiments = levelled.experiments
    return Problem(
        recorded=recorded,
        experiments=experiments,
        levelled=levelled,
        orders=orders,
        initial_conditions=initial_conditions,
        coloured=coloured,
        threshold=threshold,
        constraint=constraint,
        simulates=simulates,
        messages=messages,
    )


@dataclass(frozen=True, eq=False)
class FitAtMinimum:
    """Parameters and their covariance, by squares or by Huber's loss.

    Attributes:
        at: Criterion at the parameters, of squares.
        covariance: Of the parameters (p, p).
        variance: Of the innovation.
        diagnostics: What the estimate reports of the search.
        messages: Warnings on the search.
        huber: Minimum of Huber's loss; None without an error threshold.
    """

    at: Linearisation
    covariance: FloatArray
    variance: float
    diagnostics: dict[str, Any]
    messages: list[str]
    huber: HuberFit | None

    def trends(self, problem: Problem) -> list[FloatArray]:
        """Trend of the output (N_i,) of each experiment."""
        if self.huber is not None:
            return self.huber.trends_of_outputs
        return trends_of_outputs(problem.experiments, problem.orders, self.at.theta, problem.initial_conditions)


def _fit_at_minimum(method: str, problem: Problem, result: Search, max_iterations: int) -> FitAtMinimum:
    """Covariance at the minimum of the squares; with a threshold, the minimum of Huber's loss from there."""
    orders, experiments, constraint = problem.orders, problem.experiments, problem.constraint
    at = result.best.at
    half, condition = directions(at)
    diagnostics = _diagnostics(result, condition)
    searched, free_count = at.theta, orders.count
    if constraint is not None:
        half = constraint.basis @ half
        searched, free_count = constraint.searched(orders, at.theta), constraint.count
        diagnostics["effective_parameters"] = free_count
    messages = _search_messages(method, result.best, condition) + near_unit_circle(orders, searched)
    if not problem.threshold:
        variance = at.sum_of_squares / (at.errors - free_count - at.transients)
        covariance = _covariance(
            experiments, orders, at, half, variance, problem.initial_conditions, coloured=problem.coloured
        )
        messages += interval_messages(orders, at.theta, at.errors, covariance, constraint)
        return FitAtMinimum(at, covariance, variance, diagnostics, messages, None)
    huber = huber_fit(
        experiments,
        orders,
        at.theta,
        problem.threshold,
        problem.initial_conditions,
        max_iterations=max_iterations,
        constraint=constraint,
    )
    at = replace(at, theta=huber.theta)
    colour_order = _colour_order(at) if problem.coloured else 0
    covariance = huber.covariance(colour_order)
    messages += huber.messages + interval_messages(orders, at.theta, at.errors, covariance, constraint)
    diagnostics |= huber.diagnostics
    return FitAtMinimum(at, covariance, huber.scale**2, diagnostics, messages, huber)


def _refuse_response(method: str, data: object) -> None:
    """Refuse a frequency response where a noise model is estimated, which it tells nothing of."""
    if isinstance(data, FrequencyResponse):
        raise SysidError(
            f"{method} estimates a noise model, of which a frequency response tells nothing: expected IOData, or oe, "
            "arx, tfest or fit_response of the response"
        )


def _simulation_estimate(
    method: str, problem: Problem, order_values: Mapping[str, Any], find: partial[Search]
) -> Estimate:
    """Estimate whose path minimises the simulation errors.

    The covariance of A, B and F allows for a disturbance of any colour that is independent of the input; that of C and
    D takes the path as known, and the two as uncorrelated.
    """
    orders, initial_conditions = problem.orders, problem.initial_conditions
    experiments, levelled = problem.experiments, problem.levelled
    starts = partial(initial_estimates, _for_starts(experiments, orders, initial_conditions))
    result = simulation_search(experiments, starts, find)
    at = result.path.best.at
    half, condition = directions(at)
    half = result.basis @ half
    columns = output_errors(experiments, result.tied, at.theta, initial_conditions)
    middle = coloured_information(columns, _colour_order(at), half) if at.cost > 0.0 else np.eye(half.shape[1])
    of_path = at.sum_of_squares / (at.errors - result.basis.shape[1] - at.transients) * (half @ middle @ half.T)
    covariance = np.zeros((orders.count,) * 2)
    places = result.of_tied_path
    covariance[np.ix_(result.of_path, result.of_path)] = of_path[np.ix_(places, places)]
    prediction = linearise(experiments, orders, result.theta, initial_conditions)
    variance = prediction.sum_of_squares / (prediction.errors - orders.count - prediction.transients)
    if result.noise is not None:
        of_noise, _ = directions(result.noise.best.at)
        of_noise = result.noise_basis @ of_noise
        covariance += variance * of_noise @ of_noise.T
    messages = [*problem.messages, *_search_messages(method, result.path.best, condition)]
    messages += near_unit_circle(orders, result.theta)
    messages += interval_messages(orders, result.theta, prediction.errors, covariance)
    warn_each(messages, stacklevel=4)
    diagnostics = _diagnostics(result.path, condition)
    if levelled is not None:
        trends = trends_of_outputs(experiments, result.tied, at.theta, initial_conditions)
        levelled = levelled.subtract(trends)
        experiments = levelled.experiments
        diagnostics |= trend_diagnostics(levelled)
    return make_estimate(
        method,
        experiments,
        orders,
        orders.select(*order_values),
        theta=result.theta,
        covariance=covariance,
        variance=variance,
        diagnostics=diagnostics,
        messages=messages,
        at_rest=initial_conditions is InitialConditions.ZERO,
        recorded=problem.recorded,
        looks_for_outliers=True,
    )


def _lowest_minimum(experiments: Sequence[IOData], find: partial[Search], constraint: Constraint | None) -> Search:
    """Search all minima, of long records on stretches first; with a constraint, from where the free search ends too."""
    orders, first, initial_conditions = (find.keywords[key] for key in ("orders", "start", "initial_conditions"))
    complete = all(e.complete for e in experiments)
    if complete and first is None and constraint is None and sum(map(len, experiments)) > LONG:
        result = search_of_long_records(experiments, initial_estimates, find)
        if result is not None:
            return result
    starts = partial(initial_estimates, _for_starts(experiments, orders, initial_conditions))
    if constraint is None:
        return find(experiments, starts)
    candidates = [] if first is None else [first]
    # orders that fixed coefficients alone make possible have no free minimum
    with suppress(SysidError):
        candidates.append(InitialEstimate("free minimum", find(experiments, starts).best.at.theta))
    return constrained_search(
        experiments,
        chain(candidates, starts(orders)),
        orders,
        constraint,
        max_iterations=find.keywords["max_iterations"],
        initial_conditions=initial_conditions,
    )


def _for_starts(
    experiments: Sequence[IOData], orders: Orders, initial_conditions: InitialConditions
) -> Sequence[IOData]:
    """Records for initial estimates: without gaps, and with the rest before them that a step at the beginning needs."""
    complete = all(e.complete for e in experiments)
    for_starts: Sequence[IOData] = experiments if complete else fill_gaps(experiments, orders)
    if initial_conditions is InitialConditions.ZERO and constant_inputs(for_starts):
        # initial estimates fit a free initial state: only before it does the record show the step
        for_starts = after_rest(for_starts, STEADY * (max(orders.nk) + orders.count))
    return for_starts


def trends_of_outputs(
    experiments: Sequence[IOData],
    orders: Orders,
    theta: FloatArray,
    initial_conditions: InitialConditions = InitialConditions.ESTIMATED,
) -> list[FloatArray]:
    """Trend of the output (N_i,) of each experiment that explains most of the errors of a model."""
    trends = []
    for experiment in experiments:
        coefficients = jacobian_of_record(experiment, orders, theta, initial_conditions).trend
        trends.append(trend_terms(orders.trend, len(experiment)) @ coefficients)
    return trends


def trend_diagnostics(levelled: Levelled) -> dict[str, Any]:
    """Offset (of a line its mean) and slope per second of the output of each experiment, for the diagnostics."""
    offsets, slopes = [], []
    for experiment, of_output in zip(levelled.experiments, levelled.trends, strict=True):
        offsets.append((float(of_output.mean()),))
        rise = float(of_output[-1] - of_output[0])
        slopes.append((rise / max((len(of_output) - 1) * experiment.dt, experiment.dt),))
    return {"offsets": tuple(offsets), "slopes": tuple(slopes)}


def _data_messages(experiments: Sequence[IOData], orders: Orders, *, rest: bool) -> list[str]:
    """Refuse data that cannot determine the parameters; describe data that hardly can."""
    needed_excitation = [nb + max(orders.na, nf) for nb, nf in zip(orders.nb, orders.nf, strict=True)]
    messages = check_excitation(experiments, needed_excitation, rest=rest)
    if not orders.trend_terms:
        messages += check_means(experiments, max((orders.na, *orders.nf)))
    check_enough_data(experiments, orders, transients=max(orders.nc, orders.nd) + sum(orders.nf))
    check_room_to_start(experiments, orders)
    return messages


def _covariance(
    experiments: Sequence[IOData],
    orders: Orders,
    at: Linearisation,
    half: FloatArray,
    variance: float,
    initial_conditions: InitialConditions,
    *,
    coloured: bool,
) -> FloatArray:
    """Covariance of the parameters (p, p), from the `half` of that for white errors of unit variance."""
    covariance = at.inflation * variance * (half @ half.T)
    # errors that are all zero have neither curvature nor colour
    if not at.cost > 0.0:
        return covariance
    has_noise_model = orders.na + orders.nc + orders.nd > 0
    if has_noise_model and not all(e.complete for e in experiments):
        covariance = curvature_covariance(
            experiments, orders, at.theta, covariance, at.inflation * variance, initial_conditions
        )
    if not coloured:
        return covariance
    if has_noise_model:
        return sandwich(experiments, orders, at.theta, covariance, variance, initial_conditions)
    columns = output_errors(experiments, orders, at.theta, initial_conditions)
    middle = coloured_information(columns, _colour_order(at), half)
    return variance * (half @ middle @ half.T)


def _colour_order(at: Linearisation) -> int:
    """Highest order of the autoregressive model of coloured errors."""
    return min(COLOUR, at.errors // ROWS_PER_COEFFICIENT)


def _search_messages(method: str, minimum: Minimum, condition: float) -> list[str]:
    """Describe a search that did not converge, and poorly determined parameters."""
    messages = []
    if not minimum.converged:
        messages.append(f"{method} did not converge: {minimum.reason}")
    if condition > ILL_CONDITIONED and minimum.at.cost > 0.0:
        messages.append(
            f"the parameters are poorly determined: condition number {condition:.2g} of the scaled Jacobian"
        )
    return messages


def _diagnostics(result: Search, condition: float) -> dict[str, Any]:
    minimum = result.best
    return {
        "condition": condition,
        "iterations": minimum.iterations,
        "evaluations": minimum.evaluations,
        "converged": minimum.converged,
        "reason": minimum.reason,
        "initial_estimates": result.costs,
        "start": result.start,
        "sum_of_squares": minimum.at.sum_of_squares,
        "rows": minimum.at.errors,
        "initial_conditions": minimum.at.transients,
    }


def directions(at: Linearisation) -> tuple[FloatArray, float]:
    """Columns L (p, q) with L L' = (J' J)^-1, and the condition number of the scaled Jacobian."""
    _, values, right = svd(at.triangle)
    if not len(values):
        return np.zeros((0, 0)), 1.0
    kept = values > ROUNDING * values[0]
    half = right[kept].T / values[kept] / at.scale[:, None]
    condition = float(values[0] / values[-1]) if values[-1] > 0.0 else np.inf
    return half, condition
