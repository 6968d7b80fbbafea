"""Sum of squared output errors of transfer functions, with exact derivatives."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from sysid.continuous.initial_estimates import CONSTANT, free_responses
from sysid.continuous.known_parameters import Known
from sysid.continuous.path_response import PathResponse, TransferFunction, respond, respond_held, transient_slopes
from sysid.continuous.stability_limit import MARGIN, moved_inside, outward
from sysid.continuous.structures import PathStructure, RationalPath
from sysid.polynomial.error_jacobian import orthonormal
from sysid.polynomial.least_squares import scaled_triangle
from sysid.polynomial.prediction_error import CONVERGED, Linearisation, Minimum, levenberg_marquardt
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

FASTEST = 1e4  # greatest modulus of a pole, times dt: samples do not show a faster one
LARGEST = 1e30  # gain at the sampling rate: exponentials of larger ones overflow, where an input has died out before
TIGHT = 1e-6  # part of a sample within which a delay is at its limit
LARGEST_DERIVATIVE = 1e140  # derivatives and errors whose products are still numbers


@dataclass(frozen=True, eq=False)
class OutputError:
    """Sum of squared output errors of one output.

    Attributes:
        experiments: Records with one output.
        structures: Structure of the path from each input.
        longest: Limit on delays in s.
        free: Whether initial states are free.
        offset: Whether each experiment has a free constant in its output.
        held: Whether the inputs had their first values before the record: then no sample is lost to a delay.
        known: Parameters that are not estimated, their values by index.
    """

    experiments: Sequence[IOData]
    structures: Sequence[PathStructure]
    longest: float
    free: bool
    offset: bool = False
    held: bool = False
    known: Known = field(default_factory=dict)

    @cached_property
    def sizes(self) -> list[int]:
        """Ends of the parameters of each path."""
        return list(itertools.accumulate(len(structure.names) for structure in self.structures))

    @cached_property
    def energy(self) -> float:
        """Sum of squares of the output that sets the level of rounding."""
        # matrix exponentials of stiff systems round more than the filters of discrete-time models
        return 1e4 * sum(float(np.nansum(e.y**2)) for e in self.experiments)

    def split(self, theta: FloatArray) -> list[FloatArray]:
        """Parameters of each path."""
        return np.split(theta, self.sizes[:-1])

    def first(self, experiment: IOData) -> int:
        """First sample whose error counts: no unknown input from before the record acts on it."""
        if not self.free or self.held:
            return experiment.window
        longest = 0.0
        for structure, end in zip(self.structures, self.sizes, strict=True):
            delay = structure.delay
            if delay is None:
                delay = self.known.get(end - 1, self.longest)
            longest = max(longest, delay)
        # a delay of whole samples may exceed them by rounding
        return max(experiment.window, math.ceil(longest / experiment.dt - TIGHT))

    def delays(self) -> list[int]:
        """Indices of the parameters that are delays: the last one of a path whose delay is estimated."""
        ends = zip(self.structures, self.sizes, strict=True)
        last = [end - 1 for structure, end in ends if structure.delay is None]
        return [k for k in last if k not in self.known]

    @property
    def free_parameters(self) -> list[int]:
        """Indices of the parameters that are estimated."""
        return [k for k in range(self.sizes[-1]) if k not in self.known]

    def usable(self) -> list[int]:
        """Number of errors that count, of each experiment."""
        return [int(e.known[self.first(e) :].sum()) for e in self.experiments]

    def transfers(self, theta: FloatArray) -> list[TransferFunction]:
        """Transfer function of each path."""
        paths = zip(self.structures, self.split(theta), strict=True)
        return [structure.transfer(values) for structure, values in paths]

    def __call__(self, theta: FloatArray, origin: FloatArray | None = None) -> Linearisation | None:
        """Criterion and first derivatives at parameters, delays moved to their limits; None where poles are unstable.

        After a step from `origin` unstable poles are moved inside, where the coefficients of A are the parameters.
        A delay at its limit with a gradient that points beyond is fixed there: its derivatives are zero.
        """
        theta = self._allowed(theta)
        if origin is not None and np.isfinite(theta).all() and not self._stable(theta):
            theta = self._with_known(self._moved_inside(theta, origin))
        if not (np.isfinite(theta).all() and self._stable(theta)):
            return None
        # a response that overflows is refused below
        with np.errstate(over="ignore", invalid="ignore"):
            tables = [self.columns(e, theta) for e in self.experiments]
        columns = np.vstack([derivatives for derivatives, _, _ in tables])
        if not (np.abs(columns) < LARGEST_DERIVATIVE).all():
            return None
        self._fix_delays_at_limits(theta, columns)
        p = len(theta)
        triangle, lengths = scaled_triangle(columns, guarded=p)
        return Linearisation(
            theta=theta,
            cost=float(columns[:, p] @ columns[:, p]),
            triangle=triangle[:p, :p],
            target=lengths[p] * triangle[:p, p],
            scale=lengths[:p],
            errors=sum(self.usable()),
            transients=sum(count for _, count, _ in tables),
        )

    def _allowed(self, theta: FloatArray) -> FloatArray:
        """Parameters of the same model in their usual sequence and signs, delays moved to the nearest limit."""
        allowed = self._with_known(theta)
        if not self.known:
            # with known values a parameter keeps its place: Tp2 may be known, and longer than Tp1
            paths = zip(self.structures, self.split(theta), strict=True)
            allowed = np.concatenate([structure.arranged(values) for structure, values in paths])
        limited = self.delays()
        delays = np.where(allowed[limited] <= self._slack, 0.0, allowed[limited])
        allowed[limited] = np.clip(delays, 0.0, self.longest)
        return allowed

    def _with_known(self, theta: FloatArray) -> FloatArray:
        """A copy of the parameters with those that are known."""
        complete = theta.copy()
        for k, value in self.known.items():
            complete[k] = value
        return complete

    @property
    def _slack(self) -> float:
        """Time within which a delay is at its limit, s."""
        return TIGHT * self.experiments[0].dt

    def _fix_delays_at_limits(self, theta: FloatArray, columns: FloatArray) -> None:
        """Set the derivatives (rows, p + 1) of delays to zero whose descent leads beyond their limit."""
        for k in self.delays():
            slope = float(columns[:, k] @ columns[:, -1])
            falls_below = theta[k] == 0.0 and slope > 0.0
            rises_beyond = theta[k] >= self.longest - self._slack and slope < 0.0
            if falls_below or rises_beyond:
                columns[:, k] = 0.0

    def columns(self, experiment: IOData, theta: FloatArray) -> tuple[FloatArray, int, float]:
        """Derivatives of the errors and the errors (rows, p + 1), with initial states and offset projected out.

        Then the number of these, and the offset in units of the output. Rows are the samples whose output is known.
        """
        first = self.first(experiment)
        known = experiment.known[first:, 0]
        paths = self.transfers(theta)
        dt, intersample = experiment.dt, experiment.intersample
        response_of = respond_held if self.held else respond
        responses = [response_of(path, experiment.u[:, j], dt, intersample) for j, path in enumerate(paths)]
        errors = (experiment.y[:, 0] - sum(response.y for response in responses))[first:]
        if not np.isfinite(errors[known]).all():
            return np.full((int(known.sum()), len(theta) + 1), np.nan), 0, np.nan
        denominators = [path.a for path in paths] if self.free else []
        if self.offset:
            denominators.append(CONSTANT)
        free = free_responses(denominators, dt, len(errors))
        free = free[known[: len(free)]]
        basis, states = orthonormal(free, errors[known]) if free.any() else (free, np.zeros(0))
        blocks = self._derivatives(theta, paths, responses, states, dt, first)
        columns = np.column_stack((*blocks, errors))[known]
        # variable projection [GolubPereyra2003]: what free responses explain counts for nothing
        columns[: len(basis)] -= basis @ (basis.T @ columns[: len(basis)])
        columns[:, list(self.known)] = 0.0
        # the constant is the last of the free responses
        offset = float(states[-1]) if self.offset else 0.0
        return columns, basis.shape[1], offset

    def _derivatives(
        self,
        theta: FloatArray,
        paths: Sequence[TransferFunction],
        responses: Sequence[PathResponse],
        states: FloatArray,
        dt: float,
        first: int,
    ) -> list[FloatArray]:
        """Derivatives of the errors by the parameters of each path (rows, p), initial states being `states`."""
        blocks, begin = [], 0
        values = self.split(theta)
        for structure, values_of_path, path, response in zip(self.structures, values, paths, responses, strict=True):
            by_coefficient = np.column_stack((response.by_b, response.by_a, response.by_delay))[first:]
            if self.free and len(states) and structure.poles:
                # the free response from the best initial state depends on the denominator too
                state = states[begin : begin + structure.poles]
                slopes = transient_slopes(path.a, state, dt, len(by_coefficient))
                by_coefficient[: len(slopes), structure.zeros + 1 : -1] += slopes
                begin += structure.poles
            blocks.append(-by_coefficient @ structure.jacobian(values_of_path))
        return blocks

    def _moved_inside(self, theta: FloatArray, origin: FloatArray) -> FloatArray:
        """Parameters with the poles of rational paths moved inside after a step from `origin`."""
        dt = self.experiments[0].dt
        moved = []
        for structure, values, before in zip(self.structures, self.split(theta), self.split(origin), strict=True):
            if isinstance(structure, RationalPath):
                path = structure.transfer(values)
                inner = moved_inside(path.a, structure.transfer(before).a, dt)
                values = structure.parameters(replace(path, a=inner))
            moved.append(values)
        return np.concatenate(moved)

    def outward(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Directions in the parameters in which poles of rational paths leave the stable region, and their reach."""
        rows: list[FloatArray] = [np.zeros((0, len(theta)))]
        reach: list[FloatArray] = [np.zeros(0)]
        begin = 0
        for structure, values in zip(self.structures, self.split(theta), strict=True):
            if isinstance(structure, RationalPath):
                path = structure.transfer(values)
                by_denominator, distances = outward(path.a, self.experiments[0].dt)
                first = len(path.b)
                slopes = structure.jacobian(values)[first : first + structure.poles]
                table = np.zeros((len(distances), len(theta)))
                table[:, begin : begin + len(values)] = by_denominator @ slopes
                table[:, list(self.known)] = 0.0
                rows.append(table)
                reach.append(distances)
            begin += len(values)
        return np.vstack(rows), np.concatenate(reach)

    def minimum(self, start: Linearisation, max_iterations: int, tolerance: float = CONVERGED) -> Minimum:
        """The minimum that a search from a linearisation leads to, up to a remaining decrease relative to the cost."""
        return levenberg_marquardt(
            self, start, self.energy, outward=self.outward, max_iterations=max_iterations, tolerance=tolerance
        )

    def _stable(self, theta: FloatArray) -> bool:
        """Whether poles but integrators are left of the imaginary axis, and no number beyond what samples show."""
        dt = self.experiments[0].dt
        for structure, path in zip(self.structures, self.transfers(theta), strict=True):
            poles = np.roots(path.a[structure.integrators :][::-1])
            if _gain_at_sampling_rate(path, dt) > LARGEST:
                return False
            # a leading coefficient of zero: a pole at infinity
            vanished = len(poles) < structure.poles - structure.integrators
            if vanished or (np.abs(poles) * dt > FASTEST).any() or (poles.real * dt > -MARGIN).any():
                return False
        return True


def _gain_at_sampling_rate(path: TransferFunction, dt: float) -> float:
    """Ratio of the sums of |b_i s^i| and |a_i s^i| at |s| = 1/dt."""
    powers = dt ** -np.arange(float(len(path.a)))
    return float(np.abs(path.b) @ powers[: len(path.b)] / (np.abs(path.a) @ powers))
