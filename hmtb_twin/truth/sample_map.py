"""The 50 Hz map of an arm by finite differences of whole ticks, for integrators that MuJoCo does not differentiate."""

from copy import copy

import mujoco
import numpy as np

from hmtb_twin.parameters.values import SAMPLE_TIME

STEP = 1e-6
"""Step of the centred differences: far within the spool's null, and rounding errors stay near 1e-9."""


def sample_map(
    model: mujoco.MjModel, rest: mujoco.MjData, *, period: float = SAMPLE_TIME
) -> tuple[np.ndarray, np.ndarray]:
    """Differentiate the state after one tick by the state before it and by the controls held over it.

    Args:
        model: The model; all joints are hinges.
        rest: The state about which to differentiate, at rest, with its controls.
        period: Another length than that of a tick, s: a whole number of physics steps.

    Returns:
        A (n, n) and B (n, nu) of the map, with n = 2 nv + na: angles, velocities, activations.
    """
    precise = copy(model)
    # The pin of the shoulder roll is a constraint: solved only to the default tolerance it would blur the differences.
    precise.opt.tolerance = 0.0
    data = mujoco.MjData(precise)
    substeps = round(period / precise.opt.timestep)
    point = np.concatenate([rest.qpos, rest.qvel, rest.act, rest.ctrl])
    states = len(point) - precise.nu
    cuts = np.cumsum([precise.nq, precise.nv, precise.na])

    def after(start: np.ndarray) -> np.ndarray:
        mujoco.mj_resetData(precise, data)
        data.eq_active[:] = rest.eq_active
        data.qpos[:], data.qvel[:], data.act[:], data.ctrl[:] = np.split(start, cuts)
        mujoco.mj_step(precise, data, nstep=substeps)
        return np.concatenate([data.qpos, data.qvel, data.act])

    columns = [(after(point + e) - after(point - e)) / (2.0 * STEP) for e in STEP * np.eye(len(point))]
    jacobian = np.column_stack(columns)
    return jacobian[:, :states], jacobian[:, states:]
