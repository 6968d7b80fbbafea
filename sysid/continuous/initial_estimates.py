"""Initial estimates of transfer functions: refined instrumental variables at many time scales and delays.

SRIVC [YoungJakeman1980; GarnierWang2008] iterates: filter input and output by the last 1/A, and solve for the next A
and B with the noise-free output of the last model as instruments. It converges from state-variable filters of about the
right bandwidth, so that several bandwidths and delays are tried.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid.continuous.path_response import TransferFunction, derivatives_of, respond, transients
from sysid.continuous.structures import PathStructure
from sysid.polynomial.error_jacobian import orthonormal
from sysid.polynomial.initial_estimates import interpolated
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

SCALES = 5  # bandwidths of the first state-variable filter
COARSE = 5  # delays at which each is tried, where the delay is unknown
REFINEMENTS = 4  # steps of SRIVC from each
SETTLED = 1e-3  # relative change of the errors at which SRIVC stops: the search goes on from there
KEPT = 3  # of these, the best that go on
CONSTANT = np.array([0.0, 1.0])  # denominator s, whose free response is a constant
LONGEST = 10_000  # samples of each experiment that initial estimates use


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
    """

    inputs: Sequence[FloatArray]
    outputs: Sequence[FloatArray]
    dt: float
    intersample: str
    first: Sequence[int]
    rest: bool
    free: Sequence[FloatArray]
    structure: PathStructure

    def stacked(self, a: FloatArray, blocks: Sequence[FloatArray]) -> FloatArray:
        """Columns of all experiments (rows, k), from `first` on and without the free responses of 1/A."""
        parts = [block[first:] for block, first in zip(blocks, self.first, strict=True)]
        table = free_responses([*([] if self.rest else [a]), *self.free], self.dt, max(len(part) for part in parts))
        for part in parts:
            if table.any():
                basis, _ = orthonormal(table[: len(part)], part[:, 0])
                part[: len(basis)] -= basis @ (basis.T @ part[: len(basis)])
        return np.vstack(parts)

    def numerator(self, a: FloatArray, delay: float) -> PathEstimate:
        """Transfer function with the least-squares numerator, and its sum of squared errors."""
        m = self.structure.zeros
        blocks = [
            np.column_stack((derivatives_of(u, a, self.dt, self.intersample, delay)[:, : m + 1], y))
            for u, y in zip(self.inputs, self.outputs, strict=True)
        ]
        columns = self.stacked(a, blocks)
        b, cost = _least_squares(columns)
        return TransferFunction(b, a, delay), cost

    def refined(self, path: TransferFunction, *, instruments: bool) -> FloatArray:
        """Next denominator of rising powers, monic and stable, by one step of SRIVC, or of least squares."""
        a, n, m, r = path.a, self.structure.poles, self.structure.zeros, self.structure.integrators
        blocks = []
        for u, y in zip(self.inputs, self.outputs, strict=True):
            measured = derivatives_of(y, a, self.dt, "foh")
            by_input = derivatives_of(u, a, self.dt, self.intersample, path.delay)[:, : m + 1]
            by_output = respond(path, u, self.dt, self.intersample).by_a[:, r:n] if instruments else -measured[:, r:n]
            blocks.append(np.column_stack((by_input, by_output, -measured[:, r:n], measured[:, n])))
        columns = self.stacked(a, blocks)
        lengths = np.sqrt(np.sum(columns**2, axis=0)) + np.finfo(float).tiny
        columns = columns / lengths
        k = m + 1 + n - r
        z, phi = columns[:, :k], np.column_stack((columns[:, : m + 1], columns[:, k:-1]))
        solution = np.linalg.lstsq(z.T @ phi, z.T @ columns[:, -1], rcond=1e-13)[0]
        tail = solution[m + 1 :] * lengths[-1] / lengths[k:-1]
        return _stabilised(np.concatenate((np.zeros(r), tail, [1.0])), r)

    def by_delay(self, a: FloatArray, longest: float) -> tuple[FloatArray, FloatArray]:
        """Whole numbers of samples as delays, in s, and the sum of squared errors with the best numerator of each."""
        m, count = self.structure.zeros, int(longest / self.dt)
        low = [derivatives_of(u, a, self.dt, self.intersample)[:, : m + 1] for u in self.inputs]
        costs = []
        for lag in range(count + 1):
            blocks = [
                np.column_stack((np.vstack((np.zeros((lag, m + 1)), x[: len(x) - lag])), y))
                for x, y in zip(low, self.outputs, strict=True)
            ]
            costs.append(_least_squares(self.stacked(a, blocks))[1])
        return np.linspace(0.0, count * self.dt, count + 1), np.array(costs)


def free_responses(denominators: Sequence[FloatArray], dt: float, rows: int) -> FloatArray:
    """Free responses of all 1/A until the last has died out (at most `rows`, sum of degrees)."""
    blocks = [transients(a, dt, rows) for a in denominators]
    length = max((len(block) for block in blocks if block.size), default=0)
    padded = (np.pad(block[:length], ((0, max(length - len(block), 0)), (0, 0))) for block in blocks)
    return np.hstack([np.zeros((length, 0)), *padded])


def path_estimates(data: PathData, longest: float) -> list[PathEstimate]:
    """Transfer functions of one path, best first; several where the delay is unknown, each near a local minimum."""
    unknown = data.structure.delay is None
    n = data.structure.poles
    delays = np.linspace(0.0, longest, COARSE) if unknown else [data.structure.delay or 0.0]
    candidates = []
    for delay in delays:
        for rate in np.geomspace(10.0 / (len(data.inputs[0]) * data.dt), 1.0 / data.dt, SCALES) if n else [1.0]:
            wide = TransferFunction(np.ones(1), np.atleast_1d(np.poly([-rate] * n))[::-1], float(delay))
            candidates.append(_iterated(data, data.refined(wide, instruments=False) if n else wide.a, float(delay)))
    best = _best(candidates)[:KEPT]
    if not unknown:
        return best
    near: list[PathEstimate] = []
    for path, _ in best:
        grid, costs = data.by_delay(path.a, longest)
        inner = np.concatenate(([np.inf], costs, [np.inf]))
        minima = np.flatnonzero((inner[1:-1] <= inner[:-2]) & (inner[1:-1] <= inner[2:]))
        for k in minima[np.argsort(costs[minima])][:2]:
            near.append(_iterated(data, path.a, float(grid[k])))
    chosen: list[PathEstimate] = []
    for path, cost in _best(near + best):
        if all(abs(path.delay - other.delay) > 0.5 * data.dt for other, _ in chosen):
            chosen.append((path, cost))
    return chosen[: KEPT + 1]


def _iterated(data: PathData, a: FloatArray, delay: float) -> PathEstimate:
    """The best of a few steps of SRIVC at one delay, and its sum of squared errors."""
    best = data.numerator(a, delay)
    last = best
    for _ in range(REFINEMENTS if data.structure.poles else 0):
        before, last = last[1], data.numerator(data.refined(last[0], instruments=True), delay)
        if last[1] < best[1]:
            best = last
        if abs(before - last[1]) <= SETTLED * before:
            break
    return best


def initial_estimates(
    experiments: Sequence[IOData],
    structures: Sequence[PathStructure],
    first: Sequence[int],
    longest: float,
    *,
    free: bool,
    offset: bool,
) -> list[FloatArray]:
    """Parameters to start from, best first: path by path, each to the output without the others' responses."""
    experiments = [e[:LONGEST] for e in experiments]
    outputs = [interpolated(e)[:, 0] for e in experiments]
    dt, intersample = experiments[0].dt, experiments[0].intersample
    estimates: dict[int, list[PathEstimate]] = {}

    def fit(j: int) -> list[PathEstimate]:
        others = {i: known[0][0] for i, known in estimates.items() if i != j}
        responses = [
            sum((respond(path, e.u[:, i], dt, intersample).y for i, path in others.items()), 0.0) for e in experiments
        ]
        data = PathData(
            inputs=[e.u[:, j] for e in experiments],
            outputs=[y - other for y, other in zip(outputs, responses, strict=True)],
            dt=dt,
            intersample=intersample,
            first=first,
            rest=not free,
            free=[path.a / path.a[-1] for path in others.values()] * free + constants,
            structure=structures[j],
        )
        return path_estimates(data, longest)

    # those of other inputs are part of the noise as yet: the path that explains most comes first
    constants = [CONSTANT] * (offset or (free and any(structure.integrators for structure in structures)))
    while len(estimates) < len(structures):
        fits = {j: fit(j) for j in range(len(structures)) if j not in estimates}
        most = min(fits, key=lambda j: fits[j][0][1])
        estimates[most] = fits[most]
    if len(structures) > 1:
        for j in estimates:
            estimates[j] = fit(j)
    estimated = [[path for path, _ in estimates[j]] for j in range(len(structures))]
    best = [paths[0] for paths in estimated]
    sets = [best]
    for j, paths in enumerate(estimated):
        sets += [[*best[:j], path, *best[j + 1 :]] for path in paths[1:]]
    return [
        np.concatenate([structure.parameters(path) for structure, path in zip(structures, paths, strict=True)])
        for paths in sets
    ]


def _least_squares(columns: FloatArray) -> tuple[FloatArray, float]:
    """Coefficients of the last column in the others, and the sum of squares that remains."""
    lengths = np.sqrt(np.sum(columns[:, :-1] ** 2, axis=0)) + np.finfo(float).tiny
    scaled = columns[:, :-1] / lengths
    solution = np.linalg.lstsq(scaled, columns[:, -1], rcond=1e-12)[0]
    return solution / lengths, float(np.sum((columns[:, -1] - scaled @ solution) ** 2))


def _best(candidates: Sequence[PathEstimate]) -> list[PathEstimate]:
    """Candidates of rising cost, one of those that have hardly another cost."""
    chosen: list[PathEstimate] = []
    for one in sorted((one for one in candidates if np.isfinite(one[1])), key=lambda one: one[1]):
        if not chosen or one[1] > chosen[-1][1] * (1.0 + SETTLED):
            chosen.append(one)
    return chosen


def _stabilised(a: FloatArray, integrators: int) -> FloatArray:
    """Reflect the roots of a polynomial (rising powers, result monic) into the left half plane."""
    roots = np.roots(a[integrators:][::-1])
    size = np.abs(roots).max(initial=0.0)
    roots = np.where(roots.real < 0.0, roots, -roots.conj())
    roots = np.where(roots.real > -1e-6 * size, roots - 1e-3 * size, roots)
    return np.concatenate((np.zeros(integrators), np.atleast_1d(np.poly(roots).real)[::-1]))
