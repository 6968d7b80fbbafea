"""Initial estimates of transfer functions: refined instrumental variables at many time scales and delays.

SRIVC [YoungJakeman1980; GarnierWang2008] iterates: filter input and output by the last 1/A, and solve for the next A
and B with the noise-free output of the last model as instruments. It converges from state-variable filters of about the
right bandwidth, so that several bandwidths and delays are tried.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid.continuous.path_response import TransferFunction, derivatives_of, respond, transients
from sysid.continuous.sampled_starts import sampled_denominators
from sysid.continuous.structures import PathStructure
from sysid.polynomial.error_jacobian import orthonormal
from sysid.polynomial.initial_estimates import interpolated
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

BANDWIDTHS = 5  # of the first state-variable filter, from ten over the length of the record to one over its interval
COARSE_DELAYS = 5  # at which each bandwidth is tried, where the delay is unknown
REFINEMENTS = 4  # steps of SRIVC from each
SETTLED = 1e-3  # relative change of the errors at which SRIVC stops: the search goes on from there
KEPT = 3  # estimates that go on, the best ones
CONSTANT = np.array([0.0, 1.0])  # denominator s, whose free response is a constant
SLOWEST, FASTEST = 1e-12, 1e6  # moduli of poles times dt, beyond which powers of them overflow
LONGEST = 10_000  # samples of each experiment that initial estimates use
NEGLIGIBLE = 1e-13  # singular values of equations, and parts of responses, relative to the largest, that count as zero


@dataclass(frozen=True)
class Effort:
    """How far initial estimates are refined.

    Attributes:
        iterated: State-variable filters from which SRIVC goes on, those whose first estimates fit best.
        refinements: Steps of SRIVC from each.
    """

    iterated: int
    refinements: int


THOROUGH = Effort(iterated=1_000, refinements=REFINEMENTS)
"""For one structure: SRIVC from every filter."""

QUICK = Effort(iterated=4, refinements=2)
"""For one of many candidate structures: a search improves these estimates further."""

PathEstimate = tuple[TransferFunction, float]
"""A transfer function and its sum of squared errors."""


@dataclass(frozen=True, eq=False)
class PathData:
    """Records of one path, from one input to one output, and the structure of its transfer function.

    Attributes:
        inputs: Input of each experiment (N,).
        outputs: Output of each experiment without the other paths (N,).
        dt: Sampling interval in s.
        intersample: Input between samples, held or linear.
        first: First sample of each experiment whose error counts.
        rest: Whether the path begins at rest.
        free: Denominators of further free responses: of other paths, of constants.
        structure: Numbers of poles and zeros, and whether the delay is known.
        effort: How far estimates are refined.
    """

    inputs: Sequence[FloatArray]
    outputs: Sequence[FloatArray]
    dt: float
    intersample: str
    first: Sequence[int]
    rest: bool
    free: Sequence[FloatArray]
    structure: PathStructure
    effort: Effort = THOROUGH

    def stacked(self, a: FloatArray, blocks: Sequence[FloatArray]) -> FloatArray:
        """Columns of all experiments (rows, k), from `first` on and without the free responses of 1/A."""
        counted = [block[first:] for block, first in zip(blocks, self.first, strict=True)]
        denominators = [*self.free] if self.rest else [a, *self.free]
        free = free_responses(denominators, self.dt, max(len(block) for block in counted))
        for block in counted:
            if free.any():
                basis, _ = orthonormal(free[: len(block)], block[:, 0])
                # free responses die out: only the rows where they last are changed
                block[: len(basis)] -= basis @ (basis.T @ block[: len(basis)])
        return np.vstack(counted)

    def numerator(self, a: FloatArray, delay: float) -> PathEstimate:
        """Transfer function with the least-squares numerator, and its sum of squared errors."""
        m = self.structure.zeros
        blocks = []
        for u, y in zip(self.inputs, self.outputs, strict=True):
            filtered = derivatives_of(u, a, self.dt, self.intersample, delay)
            blocks.append(np.column_stack((filtered[:, : m + 1], y)))
        energies = sum(np.sum(block[:, : m + 1] ** 2, axis=0) for block in blocks)
        columns = self.stacked(a, blocks)
        # an input that moves before the counted samples alone has died out there: no coefficient can be told
        died_out = np.sum(columns[:, : m + 1] ** 2, axis=0) <= NEGLIGIBLE**2 * energies
        columns[:, : m + 1][:, died_out] = 0.0
        b, cost = _least_squares(columns)
        return TransferFunction(b, a, delay), cost

    def experiments(self) -> list[IOData]:
        """Records of the path, without their means where they have free constants."""
        records = []
        for u, y, first in zip(self.inputs, self.outputs, self.first, strict=True):
            if any(len(denominator) == 2 and not denominator[0] for denominator in self.free):
                u, y = u - u.mean(), y - y.mean()
            records.append(IOData(u, y, self.dt, window=first))
        return records

    def refined(self, path: TransferFunction, *, instruments: bool) -> FloatArray:
        """Next denominator of rising powers, monic and stable, by one step of SRIVC, or of least squares.

        s^n/A y = sum_i b_i s^i/A u - sum_i a_i s^i/A y is linear in the next coefficients, with 1/A of the last model
        as filter. Instruments for s^i/A y are the same of the noise-free output of that model.
        """
        a, n, m, r = path.a, self.structure.poles, self.structure.zeros, self.structure.integrators
        blocks = []
        for u, y in zip(self.inputs, self.outputs, strict=True):
            # a measured output is taken as linear between samples, whatever the input is
            measured = derivatives_of(y, a, self.dt, "foh")
            by_input = derivatives_of(u, a, self.dt, self.intersample, path.delay)[:, : m + 1]
            regressors = -measured[:, r:n]
            instrumental = regressors
            if instruments:
                instrumental = respond(path, u, self.dt, self.intersample).by_a[:, r:n]
            blocks.append(np.column_stack((by_input, instrumental, regressors, measured[:, n])))
        columns = self.stacked(a, blocks)
        # derivatives of rising order differ by decades: columns of unit length
        lengths = np.sqrt(np.sum(columns**2, axis=0)) + np.finfo(float).tiny
        columns = columns / lengths
        k = m + 1 + n - r
        z = columns[:, :k]
        phi = np.column_stack((columns[:, : m + 1], columns[:, k:-1]))
        solution = np.linalg.lstsq(z.T @ phi, z.T @ columns[:, -1], rcond=NEGLIGIBLE)[0]
        coefficients = solution[m + 1 :] * lengths[-1] / lengths[k:-1]
        return _stabilised(np.concatenate((np.zeros(r), coefficients, [1.0])), r)

    def by_delay(self, a: FloatArray, longest: float) -> tuple[FloatArray, FloatArray]:
        """Whole numbers of samples as delays, in s, and the sum of squared errors with the best numerator of each."""
        m, count = self.structure.zeros, int(longest / self.dt)
        undelayed = []
        for u in self.inputs:
            undelayed.append(derivatives_of(u, a, self.dt, self.intersample)[:, : m + 1])
        costs = []
        for lag in range(count + 1):
            blocks = []
            for filtered, y in zip(undelayed, self.outputs, strict=True):
                delayed = np.vstack((np.zeros((lag, m + 1)), filtered[: len(filtered) - lag]))
                blocks.append(np.column_stack((delayed, y)))
            _, cost = _least_squares(self.stacked(a, blocks))
            costs.append(cost)
        return np.linspace(0.0, count * self.dt, count + 1), np.array(costs)


def free_responses(denominators: Sequence[FloatArray], dt: float, rows: int) -> FloatArray:
    """Free responses of all 1/A until the last has died out (at most `rows`, sum of degrees)."""
    blocks = [transients(a, dt, rows) for a in denominators]
    length = max((len(block) for block in blocks if block.size), default=0)
    table = np.zeros((length, sum(block.shape[1] for block in blocks)))
    column = 0
    for block in blocks:
        shown = block[:length]
        table[: len(shown), column : column + block.shape[1]] = shown
        column += block.shape[1]
    return table


def path_estimates(data: PathData, longest: float) -> list[PathEstimate]:
    """Transfer functions of one path, best first; several where the delay is unknown, each near a local minimum."""
    if data.structure.delay is not None:
        return _estimates_at(data, [data.structure.delay])
    coarse = _estimates_at(data, np.linspace(0.0, longest, COARSE_DELAYS))
    near_minima: list[PathEstimate] = []
    for path, _ in coarse:
        delays, costs = data.by_delay(path.a, longest)
        for k in _lowest_minima(costs):
            near_minima.append(_iterated(data, data.numerator(path.a, float(delays[k]))))
    chosen: list[PathEstimate] = []
    for path, cost in _best(near_minima + coarse):
        # two delays within half a sample lead to one minimum
        if all(abs(path.delay - earlier.delay) > 0.5 * data.dt for earlier, _ in chosen):
            chosen.append((path, cost))
    return chosen[: KEPT + 1]


def _estimates_at(data: PathData, delays: Sequence[float] | FloatArray) -> list[PathEstimate]:
    """The best estimates at some delays, from state-variable filters of several bandwidths."""
    n = data.structure.poles
    length = len(data.inputs[0]) * data.dt
    bandwidths = np.geomspace(10.0 / length, 1.0 / data.dt, BANDWIDTHS) if n else np.ones(1)
    starts: list[PathEstimate] = []
    for delay in delays:
        for bandwidth in bandwidths:
            # all poles at one real rate; without poles the filter is 1
            a = np.atleast_1d(np.poly([-bandwidth] * n))[::-1]
            if n:
                state_variables = TransferFunction(np.ones(1), a, float(delay))
                a = data.refined(state_variables, instruments=False)
            starts.append(data.numerator(a, float(delay)))
        # without a resonance the filters alone lead to the minimum, and an integrator is in no output-error estimate
        if data.structure.resonates and not data.structure.integrators:
            for a in sampled_denominators(data.experiments(), n, float(delay)):
                starts.append(data.numerator(_stabilised(a, 0), float(delay)))
    if len(starts) > data.effort.iterated:
        starts = sorted(starts, key=lambda start: start[1])[: data.effort.iterated]
    return _best([_iterated(data, start) for start in starts])[:KEPT]


def _lowest_minima(costs: FloatArray) -> np.ndarray:
    """Indices of the two lowest local minima of a sequence, its ends included, the lowest first."""
    padded = np.concatenate(([np.inf], costs, [np.inf]))
    minima = np.flatnonzero((padded[1:-1] <= padded[:-2]) & (padded[1:-1] <= padded[2:]))
    return minima[np.argsort(costs[minima])][:2]


def _iterated(data: PathData, start: PathEstimate) -> PathEstimate:
    """The best of a few steps of SRIVC at one delay, and its sum of squared errors."""
    best = start
    if not data.structure.poles:
        return best
    latest = best
    for _ in range(data.effort.refinements):
        previous_cost = latest[1]
        a = data.refined(latest[0], instruments=True)
        if not _resolved(a, data):
            break
        latest = data.numerator(a, start[0].delay)
        # SRIVC minimises no criterion: a step may make the errors larger
        if latest[1] < best[1]:
            best = latest
        if abs(previous_cost - latest[1]) <= SETTLED * previous_cost:
            break
    return best


def _resolved(a: FloatArray, data: PathData) -> bool:
    """Whether poles are neither too slow nor too fast for numbers of double precision at the sampling interval."""
    moduli = np.abs(np.roots(a[data.structure.integrators :][::-1])) * data.dt
    return bool(np.all((moduli > SLOWEST) & (moduli < FASTEST)))


@dataclass(frozen=True, eq=False)
class OutputRecords:
    """Records of one output and all inputs, whose paths are estimated in turn.

    Attributes:
        experiments: Records with one output.
        outputs: Output of each experiment (N,), gaps filled.
        structures: Structure of the path from each input.
        first: First sample of each experiment whose error counts.
        longest: Limit on delays, s.
        free: Whether initial states are free.
        offset: Whether each experiment has a free constant in its output.
        effort: How far estimates are refined.
    """

    experiments: Sequence[IOData]
    outputs: Sequence[FloatArray]
    structures: Sequence[PathStructure]
    first: Sequence[int]
    longest: float
    free: bool
    offset: bool
    effort: Effort

    def estimate_path(self, j: int, estimates: dict[int, list[PathEstimate]]) -> list[PathEstimate]:
        """Estimates of the path of input j, to the output without the responses of the paths estimated so far."""
        dt, intersample = self.experiments[0].dt, self.experiments[0].intersample
        other_paths = {i: candidates[0][0] for i, candidates in estimates.items() if i != j}
        inputs, outputs = [], []
        for experiment, output in zip(self.experiments, self.outputs, strict=True):
            explained: FloatArray | float = 0.0
            for i, path in other_paths.items():
                response = respond(path, experiment.u[:, i], dt, intersample).y
                explained = response + explained
            inputs.append(experiment.u[:, j])
            outputs.append(output - explained)
        denominators = [path.a / path.a[-1] for path in other_paths.values()] if self.free else []
        # a free integrator has a constant too
        integrates = any(structure.integrators for structure in self.structures)
        if self.offset or (self.free and integrates):
            denominators.append(CONSTANT)
        data = PathData(
            inputs=inputs,
            outputs=outputs,
            dt=dt,
            intersample=intersample,
            first=self.first,
            rest=not self.free,
            free=denominators,
            structure=self.structures[j],
            effort=self.effort,
        )
        return path_estimates(data, self.longest)


def initial_estimates(
    experiments: Sequence[IOData],
    structures: Sequence[PathStructure],
    first: Sequence[int],
    longest: float,
    *,
    free: bool,
    offset: bool,
    effort: Effort = THOROUGH,
) -> list[FloatArray]:
    """Parameters to start from, best first: path by path, each to the output without the others' responses."""
    shortened = [experiment[:LONGEST] for experiment in experiments]
    outputs = [interpolated(experiment)[:, 0] for experiment in shortened]
    records = OutputRecords(shortened, outputs, structures, first, longest, free, offset, effort)
    count = len(structures)
    estimates: dict[int, list[PathEstimate]] = {}
    # those of other inputs are part of the noise as yet: the path that explains most comes first
    while len(estimates) < count:
        fits = {j: records.estimate_path(j, estimates) for j in range(count) if j not in estimates}
        strongest = min(fits, key=lambda j: fits[j][0][1])
        estimates[strongest] = fits[strongest]
    if count > 1:
        # once more, now that all other responses are known
        for j in estimates:
            estimates[j] = records.estimate_path(j, estimates)
    return [_parameters(structures, paths) for paths in _combinations([estimates[j] for j in range(count)])]


def _combinations(estimates: Sequence[list[PathEstimate]]) -> list[list[TransferFunction]]:
    """The best estimates of all paths, then with the others of one path in its place, not all combinations."""
    best = [candidates[0][0] for candidates in estimates]
    combinations = [best]
    for j, candidates in enumerate(estimates):
        for path, _ in candidates[1:]:
            combinations.append([*best[:j], path, *best[j + 1 :]])
    return combinations


def _parameters(structures: Sequence[PathStructure], paths: Sequence[TransferFunction]) -> FloatArray:
    """Parameters of all paths, one after the other."""
    blocks = [structure.parameters(path) for structure, path in zip(structures, paths, strict=True)]
    return np.concatenate(blocks)


def _least_squares(columns: FloatArray) -> tuple[FloatArray, float]:
    """Coefficients of the last column in the others, and the sum of squares that remains."""
    lengths = np.sqrt(np.sum(columns[:, :-1] ** 2, axis=0)) + np.finfo(float).tiny
    scaled = columns[:, :-1] / lengths
    solution = np.linalg.lstsq(scaled, columns[:, -1], rcond=1e-12)[0]
    return solution / lengths, float(np.sum((columns[:, -1] - scaled @ solution) ** 2))


def _best(candidates: Sequence[PathEstimate]) -> list[PathEstimate]:
    """Candidates of rising cost, one of those that have hardly another cost."""
    finite = [candidate for candidate in candidates if np.isfinite(candidate[1])]
    chosen: list[PathEstimate] = []
    for path, cost in sorted(finite, key=lambda candidate: candidate[1]):
        if not chosen or cost > chosen[-1][1] * (1.0 + SETTLED):
            chosen.append((path, cost))
    return chosen


def _stabilised(a: FloatArray, integrators: int) -> FloatArray:
    """Reflect the roots of a polynomial (rising powers, result monic) into the left half plane."""
    roots = np.roots(a[integrators:][::-1])
    size = np.abs(roots).max(initial=0.0)
    roots = np.where(roots.real < 0.0, roots, -roots.conj())
    # roots on the axis stay there when reflected: moved by a thousandth of the largest, their responses die out
    roots = np.where(roots.real > -1e-6 * size, roots - 1e-3 * size, roots)
    return np.concatenate((np.zeros(integrators), np.atleast_1d(np.poly(roots).real)[::-1]))
