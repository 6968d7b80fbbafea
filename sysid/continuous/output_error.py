"""Likelihood fit of transfer functions to records: output errors by Levenberg-Marquardt, delays in real numbers."""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from sysid.continuous.initial_estimates import CONSTANT, free_responses, initial_estimates
from sysid.continuous.path_response import respond, transient_slopes
from sysid.continuous.structures import PathStructure, RealisePaths
from sysid.models.continuous import Resampled
from sysid.models.continuous_estimate import ContinuousEstimate
from sysid.models.data_summary import DataSummary
from sysid.models.predict import residuals
from sysid.polynomial.data_checks import check_excitation, check_means
from sysid.polynomial.error_jacobian import orthonormal
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.least_squares import scaled_triangle
from sysid.polynomial.polynomial_estimate import COLOUR, ILL_CONDITIONED, directions
from sysid.polynomial.prediction_error import (
    SCREENING_STEPS,
    Linearisation,
    Minimum,
    coloured_information,
    levenberg_marquardt,
)
from sysid.records.arguments import real_number, truth_value, whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, warn_each

LONGEST_DELAY = 30  # samples, the default limit on delays that are estimated
MARGIN = 1e-9  # least distance of poles from the imaginary axis, times dt
FASTEST = 1e4  # greatest modulus of a pole, times dt: samples do not show a faster one
REACH = 3  # samples by which a delay may grow from its initial estimate before the search starts again
TIGHT = 1e-6  # part of a sample within which a delay is at its limit


@dataclass(frozen=True, eq=False)
class OutputError:
    """Sum of squared output errors of one output.

    Attributes:
        experiments: Records with one output.
        structures: Structure of the path from each input.
        longest: Limit on delays in s.
        free: Whether initial states are free.
        offset: Whether each experiment has a free constant in its output.
    """

    experiments: Sequence[IOData]
    structures: Sequence[PathStructure]
    longest: float
    free: bool
    offset: bool = False

    @cached_property
    def sizes(self) -> list[int]:
        """Ends of the parameters of each path."""
        return list(itertools.accumulate(len(structure.names) for structure in self.structures))

    def split(self, theta: FloatArray) -> list[FloatArray]:
        """Parameters of each path."""
        return np.split(theta, self.sizes[:-1])

    def first(self, experiment: IOData) -> int:
        """First sample whose error counts: with free initial states, no input from before the record acts on it."""
        delays = [self.longest if s.delay is None else s.delay for s in self.structures]
        return max(experiment.window, math.ceil(max(delays) / experiment.dt - TIGHT) if self.free else 0)

    def delays(self) -> list[int]:
        """Indices of the parameters that are delays."""
        return [end - 1 for s, end in zip(self.structures, self.sizes, strict=True) if s.delay is None]

    def __call__(self, theta: FloatArray, _: FloatArray | None = None) -> Linearisation | None:
        """Criterion and first derivatives at parameters, delays moved to their limits; None where poles are unstable.

        A delay at its limit with a gradient that points beyond is fixed there: its derivatives are zero.
        """
        theta = np.concatenate([s.arranged(own) for s, own in zip(self.structures, self.split(theta), strict=True)])
        limited = self.delays()
        slack = TIGHT * self.experiments[0].dt
        theta[limited] = np.clip(np.where(theta[limited] <= slack, 0.0, theta[limited]), 0.0, self.longest)
        if not (np.isfinite(theta).all() and self._stable(theta)):
            return None
        parts = [self.columns(e, theta) for e in self.experiments]
        columns = np.vstack([part for part, _, _ in parts])
        if not np.isfinite(columns).all():
            return None
        for k in limited:
            slope = float(columns[:, k] @ columns[:, -1])
            if (theta[k] == 0.0 and slope > 0.0) or (theta[k] >= self.longest - slack and slope < 0.0):
                columns[:, k] = 0.0
        p = len(theta)
        triangle, lengths = scaled_triangle(columns, guarded=p)
        return Linearisation(
            theta=theta,
            cost=float(columns[:, p] @ columns[:, p]),
            triangle=triangle[:p, :p],
            target=lengths[p] * triangle[:p, p],
            scale=lengths[:p],
            errors=sum(int(e.known[self.first(e) :].sum()) for e in self.experiments),
            transients=sum(count for _, count, _ in parts),
        )

    def columns(self, experiment: IOData, theta: FloatArray) -> tuple[FloatArray, int, float]:
        """Derivatives of the errors and the errors (rows, p + 1), with initial states and offset projected out.

        Then the number of these, and the offset in units of the output.
        """
        first = self.first(experiment)
        known = experiment.known[first:, 0]
        paths = [structure.transfer(own) for structure, own in zip(self.structures, self.split(theta), strict=True)]
        responses = [
            respond(path, experiment.u[:, j], experiment.dt, experiment.intersample) for j, path in enumerate(paths)
        ]
        errors = (experiment.y[:, 0] - sum(response.y for response in responses))[first:]
        denominators = [path.a for path in paths] * self.free + [CONSTANT] * self.offset
        table = free_responses(denominators, experiment.dt, len(errors))
        table = table[known[: len(table)]]
        basis, states = orthonormal(table, errors[known]) if table.any() else (table, np.zeros(0))
        blocks, begin = [], 0
        for structure, own, path, response in zip(self.structures, self.split(theta), paths, responses, strict=True):
            by_coefficient = np.column_stack((response.by_b, response.by_a, response.by_delay))[first:]
            if self.free and len(states) and structure.poles:
                # the free response from the best initial state depends on the denominator too
                state = states[begin : begin + structure.poles]
                slopes = transient_slopes(path.a, state, experiment.dt, len(errors))
                by_coefficient[: len(slopes), structure.zeros + 1 : -1] += slopes
                begin += structure.poles
            blocks.append(-by_coefficient @ structure.jacobian(own))
        columns = np.column_stack((*blocks, errors))[known]
        columns[: len(basis)] -= basis @ (basis.T @ columns[: len(basis)])
        return columns, basis.shape[1], float(states[-1]) if self.offset else 0.0

    def _stable(self, theta: FloatArray) -> bool:
        dt = self.experiments[0].dt
        for structure, own in zip(self.structures, self.split(theta), strict=True):
            a = structure.transfer(own).a
            poles = np.roots(a[structure.integrators :][::-1])
            lost = len(poles) < structure.poles - structure.integrators or (np.abs(poles) * dt > FASTEST).any()
            if lost or (poles.real * dt > -MARGIN).any():
                return False
        return True

    def minimum(self, max_iterations: int) -> tuple["OutputError", Minimum, int]:
        """The lowest minimum from several initial estimates, the criterion it is of, and the number of estimates."""
        # matrix exponentials of stiff systems round more than the filters of discrete-time models
        energy = 1e4 * sum(float(np.nansum(e.y**2)) for e in self.experiments)
        first = [self.first(e) for e in self.experiments]
        starts = initial_estimates(
            self.experiments, self.structures, first, self.longest, free=self.free, offset=self.offset
        )
        screened = [
            levenberg_marquardt(self, at, energy, max_iterations=2 * SCREENING_STEPS)
            for at in map(self, starts)
            if at is not None
        ]
        if not screened:
            raise SysidError("no initial estimate is stable: try fewer poles, or other delays")
        screened.sort(key=lambda one: one.at.cost)
        finished = [levenberg_marquardt(self, one.at, energy, max_iterations=max_iterations) for one in screened[:2]]
        best = self._hopped(min(finished, key=lambda one: one.at.cost), energy, max_iterations)
        criterion = self
        if self.delays() and self.free:
            # fewer samples are lost before a shorter delay
            longest = min(float(best.at.theta[self.delays()].max()) + REACH * self.experiments[0].dt, self.longest)
            criterion = replace(self, longest=longest)
            at = criterion(best.at.theta)
            if at is not None:
                best = levenberg_marquardt(criterion, at, energy, max_iterations=max_iterations)
        return criterion, best, len(starts)

    def _hopped(self, best: Minimum, energy: float, max_iterations: int) -> Minimum:
        """The lowest minimum reached from the middles of sampling intervals around each delay.

        A held input makes kinks at delays of whole samples, and often a minimum in each interval between them.
        """
        dt = self.experiments[0].dt
        for k in self.delays():
            tried: set[float] = set()
            while True:
                cell = math.ceil(best.at.theta[k] / dt - TIGHT)
                middles = {(cell + hop - 0.5) * dt for hop in (-2, -1, 0, 1, 2)} - tried
                tried |= middles
                before = best.at.cost
                for middle in sorted(middles):
                    theta = best.at.theta.copy()
                    theta[k] = middle
                    at = self(theta) if 0.0 < middle < self.longest else None
                    if at is not None:
                        other = levenberg_marquardt(self, at, energy, max_iterations=max_iterations)
                        best = min(best, other, key=lambda one: one.at.cost)
                if best.at.cost >= before:
                    break
        return best


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
    intersample = experiments[0].intersample
    if any(e.intersample != intersample for e in experiments):
        raise SysidError(f"experiments must share one intersample, got {[e.intersample for e in experiments]}")
    dt, shortest = experiments[0].dt, min(len(e) - e.window for e in experiments)
    if max_delay is None:
        max_delay = dt * min(LONGEST_DELAY, shortest // 10)
    limit = 0.5 * shortest * dt
    message = f"lie between 0 and half the shortest record, {limit:g} s"
    max_delay = real_number("max_delay", max_delay, message, lambda value: 0.0 <= value <= limit)
    structures = structures_of(experiments[0].ny, experiments[0].nu)
    free = initial_conditions is InitialConditions.ESTIMATED
    if offset and free and any(s.integrators for row in structures for s in row):
        raise SysidError(
            "offset: the free initial state of an integrator is a constant already; offset=True goes with "
            "initial_conditions='zero'"
        )
    known = [s.delay for row in structures for s in row if s.delay is not None]
    real_number("delay", max((0.0, *known)), message, lambda value: value <= limit)
    for row in structures:
        if any(s.poles == s.zeros and s.delay is None and intersample == "zoh" for s in row):
            raise SysidError(
                "a held input shows the delay of a transfer function with as many zeros as poles only to whole "
                "samples: try fewer zeros, or a known delay"
            )
    needed = [max(row[j].poles + row[j].zeros + 1 for row in structures) for j in range(experiments[0].nu)]
    messages = check_excitation(experiments, needed)
    messages += [] if offset else check_means(experiments, max(s.poles for row in structures for s in row))
    fits = []
    for i, row in enumerate(structures):
        single = [e.select(outputs=[i]) for e in experiments]
        criterion = OutputError(single, row, max_delay, free, offset)
        _check_enough(criterion)
        fits.append(criterion.minimum(max_iterations))
    theta = np.concatenate([minimum.at.theta for _, minimum, _ in fits])
    covariance, noise, condition = _covariances(fits, coloured)
    levels: list[list[float]] = []
    if offset:
        levels = [[c.columns(e, best.at.theta)[2] for e in c.experiments] for c, best, _ in fits]
        experiments = tuple(e.subtract(y=level) for e, *level in zip(experiments, *levels, strict=True))
    summary = DataSummary.of(experiments)
    realise = RealisePaths(structures, summary, intersample, noise)
    sampled, begin = Resampled(realise), 0
    for (criterion, minimum, _), output in zip(fits, summary.output_names, strict=True):
        if not minimum.converged:
            messages.append(f"{method} did not converge for output {output}: {minimum.reason}")
        own = slice(begin, begin + criterion.sizes[-1])
        values = map(criterion.split, (theta[own], np.sqrt(np.diag(covariance)[own])))
        for structure, *path in zip(criterion.structures, *values, strict=True):
            messages += structure.warnings(*path)
        limits = len(messages)
        for k in criterion.delays():
            delay = f"the delay {realise.names[begin + k]}"
            if minimum.at.theta[k] == 0.0:
                messages.append(f"{delay} is at its lower limit 0: intervals are approximate")
            elif minimum.at.theta[k] >= criterion.longest - TIGHT * dt:
                messages.append(f"{delay} is at its limit {criterion.longest:g} s: a larger max_delay may fit better")
        begin += criterion.sizes[-1]
        if len(messages) == limits and condition > ILL_CONDITIONED and minimum.at.cost > 0.0:
            messages.append(f"the parameters are poorly determined: condition number {condition:.2g} of the Jacobian")
    warn_each(messages, stacklevel=2)
    model = sampled(theta)
    return ContinuousEstimate(
        model=model,
        polynomials=None,
        parameters=theta,
        parameter_names=realise.names,
        covariance=covariance,
        noise_variance=noise,
        residuals=np.concatenate([residuals(model, e) for e in experiments]),
        method=method,
        orders=orders,
        diagnostics={
            "condition": condition,
            "iterations": sum(minimum.iterations for _, minimum, _ in fits),
            "converged": all(minimum.converged for _, minimum, _ in fits),
            "reason": "; ".join(minimum.reason for _, minimum, _ in fits),
            "offsets": tuple(map(tuple, levels)),
            "initial_estimates": sum(count for _, _, count in fits),
            "sum_of_squares": tuple(minimum.at.cost for _, minimum, _ in fits),
            "warnings": tuple(messages),
        },
        data=summary,
        realise=sampled,
        realise_continuous=realise,
    )


def _check_enough(criterion: OutputError) -> None:
    """Refuse data with fewer errors than unknowns."""
    states = criterion.offset + (sum(s.poles for s in criterion.structures) if criterion.free else 0)
    usable = [int(e.known[criterion.first(e) :].sum()) for e in criterion.experiments]
    count = criterion.sizes[-1]
    if sum(usable) <= count + states * len(usable) or min(usable) <= states:
        raise SysidError(
            f"too many orders for the data: {count} parameters and {states} initial states and offsets per experiment "
            f"from {sum(usable)} usable samples in {len(usable)} experiment(s)"
        )


def _covariances(
    fits: Sequence[tuple[OutputError, Minimum, int]], coloured: bool
) -> tuple[FloatArray, FloatArray, float]:
    """Covariance of all parameters, that of the errors (ny, ny), and the largest condition number."""
    variances, influences, errors, blocks, conditions = [], [], [], [], []
    for criterion, minimum, _ in fits:
        at, theta, parts = minimum.at, minimum.at.theta.copy(), []
        # a delay fixed at 0 has the interval of a free one, by the derivative from the right
        theta[criterion.delays()] = np.maximum(theta[criterion.delays()], 2.0 * TIGHT * criterion.experiments[0].dt)
        for e in criterion.experiments:
            # every sample has its row, zeros where no error counts, NaN for the error of a missing output
            first, part = criterion.first(e), np.zeros((len(e), len(at.theta) + 1))
            part[first:, -1] = np.nan
            part[first:][e.known[first:, 0]] = criterion.columns(e, theta)[0]
            parts.append(part)
        rows = np.nan_to_num(np.vstack(parts))
        triangle, lengths = scaled_triangle(rows, guarded=len(theta))
        half, condition = directions(replace(at, triangle=triangle[:-1, :-1], scale=lengths[:-1]))
        variances.append(at.cost / (at.errors - len(at.theta) - at.transients))
        middle = np.eye(half.shape[1])
        if coloured and at.cost > 0.0:
            counted = [part[criterion.first(e) :] for e, part in zip(criterion.experiments, parts, strict=True)]
            middle = coloured_information(counted, min(COLOUR, at.errors // 20), half)
        blocks.append(variances[-1] * half @ middle @ half.T)
        conditions.append(condition)
        influences.append(rows[:, :-1] @ half @ half.T)
        errors.append(rows[:, -1])
    noise, covariance = np.diag(variances), scipy.linalg.block_diag(*blocks)
    begin = np.cumsum([0, *(len(block) for block in blocks)])
    for i, j in itertools.permutations(range(len(fits)), 2):
        both = (errors[i] != 0.0) & (errors[j] != 0.0)
        sizes = np.linalg.norm(errors[i][both]) * np.linalg.norm(errors[j][both])
        noise[i, j] = np.sqrt(variances[i] * variances[j]) * (errors[i] @ errors[j] / sizes if sizes else 0.0)
        cross = noise[i, j] * influences[i].T @ influences[j]
        covariance[begin[i] : begin[i + 1], begin[j] : begin[j + 1]] = cross
    return covariance, noise, max(conditions)
