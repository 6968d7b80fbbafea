"""The physical limit of a simulation: MuJoCo's own steps and nothing else."""

import mujoco

from tests.benchmarks.tables import timed


def bare_seconds(arm, log):
    """Processor time of the steps of one experiment, with the controls it had and nothing else."""
    data, controls = arm.rest(arm.pose(log.provenance["pose"])), arm.controls(log.commanded)
    substeps = round(log.dt / arm.model.opt.timestep)

    def steps():
        for row in controls:
            data.ctrl[:] = row
            mujoco.mj_step(arm.model, data, nstep=substeps)

    return timed(steps)[1]
