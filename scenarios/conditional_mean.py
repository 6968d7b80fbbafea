"""What noisy drives make an arm do on average, given its commands."""

from dataclasses import dataclass

import numpy as np
from mujoco import batch

from hmtb_twin import JOINTS, Arm
from hmtb_twin.parameters import SAMPLE_TIME
from hmtb_twin.recorder import delayed
from sysid.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class ConditionalMean:
    """Mean of the noise-free angles over process noise, given the commands, as an average over draws.

    Attributes:
        angles: The average of the draws as it reaches the record (N, 7), rad.
        variance: Square of its standard error at each sample (N, 7), rad^2; zero where the mean is exact.
    """

    angles: FloatArray
    variance: FloatArray


def conditional_mean(
    arm: Arm, angles: FloatArray, command: FloatArray, *, draws: int, seed: int, threads: int = 0
) -> ConditionalMean:
    """Return the mean over process noise of what an arm does that starts at rest at a pose.

    Args:
        arm: The arm, its process noise included.
        angles: Commanded pose at which it rests at first (7,), rad.
        command: Commanded angles (N, 7), rad.
        draws: Draws of process noise, >= 2.
        seed: Of these draws.
        threads: Threads for the physics; all processors when zero. The result does not depend on it.
    """
    simulations = batch.Batch(arm.model, nsim=draws, nthread=threads)
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
