"""Noise-free angles of a record: the mean of the angles given the commands, as they reach the record."""

from dataclasses import replace

import numpy as np
from mujoco import batch

from hmtb_twin import Arm, JointLog, Truth, load_arm
from hmtb_twin.bus.recorder import delayed
from hmtb_twin.truth.linearization import simulated
from sysid.records.arrays import FloatArray

DRAWS = 8
"""Draws of process noise behind the mean response of an arm that is not linear."""


def noise_free(record: JointLog, arm: Arm, truth: Truth, true: FloatArray) -> tuple[FloatArray, FloatArray, str]:
    """Return the mean of the angles given the commands, as they reach the record.

    Args:
        record: A log of the twin.
        arm: Its arm.
        truth: Small-signal truth at its pose.
        true: Its noise-free angles as they reach the record (N, 7), rad.

    Returns:
        The mean (N, 7), rad; the square of its standard error (N, 7), rad^2, zero where it is exact; its origin.
    """
    if not arm.plant.process_noise:
        return true, np.zeros_like(true), "of the record"
    if arm.friction or arm.plant.actuator == "orifice":
        # Noise dithers what is not smooth: the mean is not the motion without noise.
        mean, variance = conditional_mean(arm, truth.angles, record.felt, draws=DRAWS, seed=record.seed)
        return mean, variance, f"mean of {DRAWS} draws of process noise"
    # What is linear responds on average as it does without noise: one simulation is exact.
    noiseless = load_arm(arm.variant, arm.payload, plant=replace(arm.plant, process_noise=0.0), specimen=arm.specimen)
    angles = simulated(noiseless, truth.angles, record.felt) + noiseless.rest(truth.angles).qpos[: len(arm.joints)]
    return angles, np.zeros_like(angles), "simulated anew without process noise"


def conditional_mean(
    arm: Arm, angles: FloatArray, command: FloatArray, *, draws: int, seed: int
) -> tuple[FloatArray, FloatArray]:
    """Simulate an arm from rest at a pose, and average over draws of process noise.

    Args:
        arm: The arm, its process noise included.
        angles: Commanded pose at which it rests at first (7,), rad.
        command: Commanded angles (N, 7), rad.
        draws: Draws of process noise, >= 2.
        seed: Of these draws.

    Returns:
        The average of the draws as it reaches the record, rad, and the square of its standard error, rad^2 (N, 7).
    """
    simulations = batch.Batch(arm.model, nsim=draws, nthread=0)
    start = arm.rest(angles)
    for name in ("qpos", "qvel", "act", "ctrl", "eq_active"):
        simulations.bind(name)[:] = getattr(start, name)
    control, position = simulations.bind("ctrl"), simulations.bind("qpos")
    # Seeded apart from the noise of the record, so that the draws are independent of what is scored.
    rng = np.random.default_rng([seed, draws])
    substeps = round(arm.description.sample_time / arm.model.opt.timestep)
    means, variances = np.zeros(command.shape), np.zeros(command.shape)
    simulations.forward()
    for k, controls in enumerate(arm.controls(command)):
        # About the pose, so that the scatter is not lost in the rounding of large angles.
        offsets = position[:, : len(arm.joints)] - angles
        means[k] = offsets.mean(axis=0)
        # About the mean of the draws themselves, hence one degree of freedom less.
        variances[k] = offsets.var(axis=0, ddof=1) / draws
        control[:] = controls
        # Even columns command angles, odd ones torques; the noise is that of the drives.
        control[:, 1::2] += arm.process_noise * rng.standard_normal((draws, len(arm.joints)))
        simulations.step(nstep=substeps)
    return delayed(means, arm.delays) + angles, delayed(variances, arm.delays)
