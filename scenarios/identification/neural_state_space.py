"""Neural state-space models: a linear model and a small network on its states and inputs, fitted in simulation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

import sysid
from scenarios.files.errors import ScenarioError
from scenarios.identification.simulation_fit import Simulated, compiled, fit_simulation, fit_to_window, settled
from sysid import IOData, StateSpace
from sysid.models.predict import initial_state
from sysid.models.recursion import state_trajectory

ITERATIONS = 60
"""Limit on the steps of the fit, which goes on improving slowly: a minute of processor time for 50,000 samples."""

MOST_PARAMETERS = 400
"""Parameters to fit; with more, the sensitivities of a long data set take gigabytes."""


@compiled
def simulate_neural(
    A: np.ndarray,
    B: np.ndarray,
    C: np.ndarray,
    level: float,
    W: np.ndarray,
    V: np.ndarray,
    b: np.ndarray,
    x0: np.ndarray,
    u: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate x+ = A x + B u + W tanh(V [x; u] + b), y = C x + level, with exact sensitivities, forward in time.

    A is (n, n), B (n, nu), C (n,), W (n, h), V (h, n + nu), b (h,), the state at the first sample x0 (n,), u (N, nu).
    Returned are y (N,), and its derivatives with respect to A, B, C, level, W, V, b, row by row, and x0 (N, p + n).
    """
    n, nu = B.shape
    h = len(b)
    at_C = n * (n + nu)
    at_W = at_C + n + 1
    at_V = at_W + n * h
    at_b = at_V + h * (n + nu)
    p = at_b + h
    y, slopes = np.empty(len(u)), np.zeros((len(u), p + n))
    x, ahead = x0.copy(), np.empty(n)
    S, moved = np.zeros((n, p + n)), np.empty((n, p + n))
    S[:, p:] = np.eye(n)
    joined, wave, slope, J = np.empty(n + nu), np.empty(h), np.empty(h), np.empty((n, n))
    # Loops over such small matrices are several times as fast as calls of BLAS.
    for t in range(len(u)):
        y[t] = level
        for i in range(n):
            y[t] += C[i] * x[i]
            joined[i] = x[i]
            slopes[t, at_C + i] += x[i]
            for c in range(p + n):
                slopes[t, c] += C[i] * S[i, c]
        slopes[t, at_C + n] += 1.0
        joined[n:] = u[t]
        for k in range(h):
            bend = b[k]
            for j in range(n + nu):
                bend += V[k, j] * joined[j]
            wave[k] = np.tanh(bend)
            slope[k] = 1.0 - wave[k] * wave[k]
        for i in range(n):
            ahead[i] = 0.0
            for j in range(n):
                ahead[i] += A[i, j] * x[j]
                J[i, j] = A[i, j]
                for k in range(h):
                    J[i, j] += W[i, k] * slope[k] * V[k, j]
            for j in range(nu):
                ahead[i] += B[i, j] * u[t, j]
            for c in range(p + n):
                moved[i, c] = 0.0
                for j in range(n):
                    moved[i, c] += J[i, j] * S[j, c]
            for j in range(n):
                moved[i, i * n + j] += x[j]
            for j in range(nu):
                moved[i, n * n + i * nu + j] += u[t, j]
            for k in range(h):
                ahead[i] += W[i, k] * wave[k]
                moved[i, at_W + i * h + k] += wave[k]
                moved[i, at_b + k] += W[i, k] * slope[k]
                for j in range(n + nu):
                    moved[i, at_V + k * (n + nu) + j] += W[i, k] * slope[k] * joined[j]
        x, ahead = ahead, x
        S, moved = moved, S
    return y, slopes


@dataclass(frozen=True, eq=False)
class NeuralStateSpace:
    """A neural state-space model of one output; inputs and output relative to their means and over their spreads.

    Attributes:
        theta: A, B, C, level, W, V and b, each row by row (p,).
        states: Number of states n.
        neurons: Number of neurons h.
        start: The linear model it was fitted from, in the same states: its initial states are those to begin with.
        levels: Mean inputs and, last, the mean output of the training records (nu + 1,), rad.
        spreads: Their standard deviations (nu + 1,), rad.
    """

    theta: np.ndarray
    states: int
    neurons: int
    start: StateSpace
    levels: np.ndarray
    spreads: np.ndarray

    def simulated(self, theta: np.ndarray, x0: np.ndarray, record: IOData) -> Simulated:
        """Simulate a scaled record from a state (n,)."""
        n, nu, h = self.states, record.nu, self.neurons
        shapes = ((n, n), (n, nu), (n,), (1,), (n, h), (h, n + nu), (h,))
        cuts = np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1]
        blocks = zip(np.split(theta, cuts), shapes, strict=True)
        A, B, C, level, W, V, b = (values.reshape(shape) for values, shape in blocks)
        with np.errstate(all="ignore"):
            y, slopes = simulate_neural(A, B, C, float(level[0]), W, V, b, np.ascontiguousarray(x0), record.u)
        return y, slopes

    def predicted(self, record: IOData, steps: int) -> np.ndarray:
        """Return the simulated outputs (N, 1) whatever the horizon: there is no noise model.

        The initial state is fitted to the window; without one the model starts at rest at the means.

        Raises:
            ScenarioError: The simulation diverges.
        """
        scaled = in_units(record, self.levels, self.spreads)
        x0 = initial_state(self.start, scaled) if record.window else np.zeros(self.states)
        x0 = fit_to_window(self.simulated, self.theta, x0, scaled)
        output = self.simulated(self.theta, x0, scaled)[0] * self.spreads[-1] + self.levels[-1]
        return settled(output, record, f"neural_ss:{self.states}/{self.neurons}", *self.last)[:, None]

    @property
    def last(self) -> tuple[float, float]:
        """Mean and standard deviation of the output of the training records, rad."""
        return float(self.levels[-1]), float(self.spreads[-1])


def in_units(record: IOData, levels: np.ndarray, spreads: np.ndarray) -> IOData:
    """Return a record relative to levels and over spreads, the inputs' first (nu + 1,)."""
    u, y = (record.u - levels[:-1]) / spreads[:-1], (record.y - levels[-1]) / spreads[-1]
    return IOData(u, y, record.dt, window=record.window, name=record.name)


def neural_ss(
    records: Sequence[IOData], order: int, neurons: int, *, seed: int, iterations: int = ITERATIONS
) -> NeuralStateSpace:
    """Fit a neural state-space model to records of one output in simulation, from the best linear model.

    The linear model is that of `oe`; the network's output weights start at zero, so that the search starts at the
    errors of the linear model and only goes down, and its input weights at random [Schoukens2021]. States are scaled to
    unit spread over the training records; then the steepness of the neurons runs from what covers the largest record
    to what covers the smallest, each with its bend within.

    Args:
        records: Records with one output.
        order: Order of the linear model: nb and nf of `oe`, of each input.
        neurons: Number of neurons h.
        seed: Of the random input weights.
        iterations: Limit on the steps of the fit.

    Raises:
        ScenarioError: No order or neurons, too many parameters, or an output does not move.
        SysidError: `oe` refuses the records.
    """
    if order < 1 or neurons < 1:
        raise ScenarioError(f"neural_ss orders {order} {neurons} given, expected an order and neurons of 1 or more")
    nu = records[0].nu
    n = order * nu  # states of `oe`: a block for each input
    count, samples = n * (n + nu) + n + 1 + neurons * (2 * n + nu + 1), sum(len(record) for record in records)
    if count > min(MOST_PARAMETERS, samples):
        raise ScenarioError(
            f"neural_ss orders {order} {neurons} given: {count} parameters, expected {MOST_PARAMETERS} or less, and "
            f"not more than the {samples} samples"
        )
    signals = np.concatenate([np.hstack([record.u, record.y]) for record in records])
    levels, spreads = signals.mean(axis=0), signals.std(axis=0)
    if not (spreads > 0.0).all():
        raise ScenarioError("neural_ss: an input or the output is constant, which identifies nothing")
    scaled = [in_units(record, levels, spreads) for record in records]
    linear, starts = _linear_start(scaled, order)
    rng = np.random.default_rng(seed)
    motion = [float(record.y.std()) for record in scaled]
    steep = np.geomspace(1.0, 1.0 / min(1.0, *motion), neurons)
    # Over the root of their number, so that sums of inputs keep unit spread.
    V = steep[:, None] * rng.standard_normal((neurons, n + nu)) / np.sqrt(n + nu)
    b = rng.uniform(-1.0, 1.0, neurons)
    # Output weights of zero: the search starts at the linear model.
    blocks = (linear.A, linear.B, linear.C, np.zeros(1), np.zeros((n, neurons)), V, b)
    theta = np.concatenate([np.ravel(block) for block in blocks])
    model = NeuralStateSpace(theta, n, neurons, linear, levels, spreads)
    fitted, _ = fit_simulation(model.simulated, theta, starts, scaled, max_iterations=iterations)
    return replace(model, theta=fitted)


def _linear_start(records: Sequence[IOData], order: int) -> tuple[StateSpace, list[np.ndarray]]:
    """The linear model of `oe` with states of unit spread over scaled records, and the initial state of each (n,)."""
    # Each about its own means: else a pole at 1 would explain the levels of the records instead of their dynamics.
    centred = [record.subtract(u=record.u.mean(axis=0), y=record.y.mean(axis=0)) for record in records]
    linear = sysid.oe(centred, order, order).model
    starts = [initial_state(linear, record) for record in records]
    trajectories = []
    for record, x0 in zip(records, starts, strict=True):
        trajectories.append(state_trajectory(linear.A, record.u @ linear.B.T, x0))
    size = np.concatenate(trajectories).std(axis=0)
    size[size == 0.0] = 1.0  # a state that no record moves
    scaled = replace(linear, A=linear.A * size / size[:, None], B=linear.B / size[:, None], C=linear.C * size)
    return scaled, [x0 / size for x0 in starts]
