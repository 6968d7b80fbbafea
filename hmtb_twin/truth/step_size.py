"""The arm at another physics step or integrator, and what that does to its bandwidths."""

from copy import copy
from dataclasses import replace

import mujoco
import numpy as np

from hmtb_twin.arm.arm import Arm
from hmtb_twin.parameters.errors import TwinError
from hmtb_twin.parameters.values import INDEXED_JOINTS, JOINTS, OPERATING_POSE, SAMPLE_TIME
from hmtb_twin.truth.linearization import sliding
from hmtb_twin.truth.sample_map import sample_map
from sysid import StateSpace


def at_step(arm: Arm, step: float, integrator: mujoco.mjtIntegrator | None = None) -> Arm:
    """Return the arm with another physics step.

    Args:
        arm: The arm.
        step: Physics step, s; a whole number of them makes a tick of the position loop.
        integrator: The engine's integrator; none keeps the arm's.

    Raises:
        TwinError: The step is not a whole part of a tick.
    """
    count = round(SAMPLE_TIME / step) if step > 0.0 else 0
    if count < 1 or abs(count * step - SAMPLE_TIME) > 1e-9 * SAMPLE_TIME:
        raise TwinError(f"physics step {step} s given, expected a whole part of a tick of {SAMPLE_TIME} s")
    model = copy(arm.model)
    model.opt.timestep = SAMPLE_TIME / count
    if integrator is not None:
        model.opt.integrator = integrator
    return replace(arm, model=model)


def bandwidths(arm: Arm, pose: str = OPERATING_POSE) -> dict[str, float]:
    """Return the small-signal bandwidth of each joint as the arm's own step and integrator make it, Hz.

    The 50 Hz map is differentiated by whole ticks, which works with every integrator. Dry friction is off, as in the
    truth; bus delays, which do not move a bandwidth, are left out.

    Args:
        arm: The arm; one with dry friction is linearised without it.
        pose: Operating point, by name.

    Raises:
        TwinError: There is no such pose.
    """
    smooth = at_step(sliding(arm), arm.model.opt.timestep, mujoco.mjtIntegrator(arm.model.opt.integrator))
    angles = smooth.pose(pose)
    A, B = sample_map(smooth.model, smooth.rest(angles))
    B = B[:, 0::2] + B[:, 1::2] @ smooth.controller.gravity_gradient(angles)
    n = len(JOINTS)
    found = {}
    for i, name in enumerate(JOINTS):
        if name not in INDEXED_JOINTS:
            joint = StateSpace(A, B[:, [i]], np.eye(n, len(A))[[i]], np.zeros((1, 1)), None, SAMPLE_TIME)
            found[name] = float(joint.bandwidth()[0, 0])
    return found
