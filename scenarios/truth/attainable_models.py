"""Models behind the attainable error: a long ARX model of the record itself, and the mean of noisy drives."""

from dataclasses import dataclass

import numpy as np
from mujoco import batch
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from hmtb_twin import JOINTS, Arm
from hmtb_twin.bus.recorder import delayed
from hmtb_twin.parameters.values import SAMPLE_TIME
from sysid.polynomial.least_squares import tall_least_squares
from sysid.records.arrays import FloatArray

DIED = 1e-17
"""A free response has died out where it is below this part of its largest value."""

LARGEST = 1e60
"""A larger response is that of an unstable model; it cannot be fitted."""


def long_response(u: FloatArray, y: FloatArray, order: int) -> FloatArray | None:
    """Fit A(q) y = B(q) u by least squares, then simulate it with the initial conditions that fit best.

    The same as the fit and the simulation of a state-space model of as many states, without matrices of that size: the
    influence of the initial conditions on A(q) y ends after `order` samples.

    Args:
        u: Inputs (N, nu).
        y: Output (N,).
        order: Coefficients of A and of each B; N must exceed twice their number.

    Returns:
        Simulated output (N,); None where the model grows beyond what can be fitted.
    """
    past = np.arange(order, len(y))[:, None] - np.arange(1, order + 1)
    regressors = np.hstack([-y[past], *(signal[past] for signal in u.T)])
    theta = tall_least_squares(regressors, y[order:], cond=1e-15)
    a, *b = np.split(theta, 1 + u.shape[1])
    a = np.concatenate([[1.0], a])
    pulse = np.zeros(len(y))
    pulse[0] = 1.0
    with np.errstate(over="ignore", invalid="ignore"):
        forced = sum(lfilter(np.concatenate([[0.0], bj]), a, signal) for bj, signal in zip(b, u.T, strict=True))
        free = lfilter([1.0], a, pulse)
    if not (np.abs(free) < LARGEST).all() or not (np.abs(forced) < LARGEST).all():
        return None
    alive = int(np.flatnonzero(np.abs(free) > DIED * np.abs(free).max())[-1]) + 1
    rows = min(len(y), alive + order)
    columns = toeplitz(free[:rows], np.zeros(order))
    weights = tall_least_squares(columns, (y - forced)[:rows], cond=1e-15)
    return np.asarray(forced + np.convolve(free, weights)[: len(y)])


@dataclass(frozen=True, eq=False)
class ConditionalMean:
    """Noise-free angles averaged over draws of process noise.

    Attributes:
        angles: The average of the draws as it reaches the record (N, 7), rad.
        variance: Square of its standard error at each sample (N, 7), rad^2; zero where the mean is exact.
    """

    angles: FloatArray
    variance: FloatArray


def conditional_mean(arm: Arm, angles: FloatArray, command: FloatArray, *, draws: int, seed: int) -> ConditionalMean:
    """Simulate an arm from rest at a pose, and average over draws of process noise.

    Args:
        arm: The arm, its process noise included.
        angles: Commanded pose at which it rests at first (7,), rad.
        command: Commanded angles (N, 7), rad.
        draws: Draws of process noise, >= 2.
        seed: Of these draws.
    """
    simulations = batch.Batch(arm.model, nsim=draws, nthread=0)
    start = arm.rest(angles)
    for name in ("qpos", "qvel", "act", "ctrl", "eq_active"):
        simulations.bind(name)[:] = getattr(start, name)
    control, position = simulations.bind("ctrl"), simulations.bind("qpos")
    rng = np.random.default_rng([seed, draws])
    substeps = round(SAMPLE_TIME / arm.model.opt.timestep)
    total, squares = np.zeros(command.shape), np.zeros(command.shape)
    simulations.forward()
    for k, now in enumerate(arm.controls(command)):
        # About the pose, so that the scatter is not lost in the rounding of large angles.
        moved = position[:, : len(JOINTS)] - angles
        total[k] = moved.mean(axis=0)
        squares[k] = moved.var(axis=0, ddof=1) / draws
        control[:] = now
        control[:, 1::2] += arm.process_noise * rng.standard_normal((draws, len(JOINTS)))
        simulations.step(nstep=substeps)
    return ConditionalMean(delayed(total, arm.delays) + angles, delayed(squares, arm.delays))
