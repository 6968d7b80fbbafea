"""Arms with other servo valves or another physics step than `load_arm` gives, and comparisons of arms and logs."""

from copy import copy
from dataclasses import replace

import mujoco
import numpy as np

from hmtb_twin import JOINTS
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.hydraulics.drive_actuators import valve_parameters
from hmtb_twin.parameters.servo_valve import POWER_UNIT, SERVO_VALVE
from hmtb_twin.parameters.values import SAMPLE_TIME
from hmtb_twin.parameters.variants import MOTIONS, OPERATING_POSE
from hmtb_twin.truth.linearization import sample_map, sliding
from sysid import StateSpace

LOWER, UPPER = (np.array([getattr(MOTIONS[name], end) for name in JOINTS]) for end in ("lower", "upper"))
CHANNELS = (
    *("commanded", "measured", "wrench", "true_angles", "load_pressure", "volts", "counts", "status"),
    *("unit_pose", "contact_force", "spool", "supply_pressure"),
)


def equal(first, second):
    """Whether two logs agree in every bit of every channel."""
    return all(np.array_equal(getattr(first, name), getattr(second, name)) for name in CHANNELS)


def with_valve(arm, *, valve=SERVO_VALVE, power_unit=POWER_UNIT):
    """Return an arm with orifice actuators on other servo valves, or on another supply."""
    model = copy(arm.model)
    for j, name in enumerate(JOINTS):
        parameters = valve_parameters(arm.actuators[name], arm.gains[name], valve, power_unit, joints=len(JOINTS))
        kept = [eq.BRISTLE, eq.BRISTLE_DAMPING, eq.COUNT]
        parameters[kept] = model.actuator_user[2 * j, kept]
        model.actuator_user[2 * j] = parameters
    return replace(arm, model=model)


def at_step(arm, step, integrator=None):
    """Return an arm with another physics step in s, a whole part of a tick, and perhaps another integrator."""
    other = arm.at_step(SAMPLE_TIME / round(SAMPLE_TIME / step))
    if integrator is not None:
        other.model.opt.integrator = integrator
    return other


def natural_poles(arm, pose):
    """Return the poles of the arm at rest, rad/s, from the map of one physics step."""
    period = arm.model.opt.timestep
    step = sample_map(arm.model, arm.rest(arm.pose(pose)), period=period)[0]
    return np.log(np.linalg.eigvals(step) + 0j) / period


def bandwidths(arm):
    """Return the small-signal bandwidth of each joint as the arm's own step and integrator make it, Hz.

    The 50 Hz map is differentiated by whole ticks, which works with every integrator; dry friction is off, as in the
    truth. Bus delays, which do not move a bandwidth, are left out.
    """
    smooth = at_step(sliding(arm), arm.model.opt.timestep, mujoco.mjtIntegrator(arm.model.opt.integrator))
    angles = smooth.pose(OPERATING_POSE)
    A, B = sample_map(smooth.model, smooth.rest(angles))
    B = B[:, 0::2] + B[:, 1::2] @ smooth.controller.gravity_gradient(angles)
    n = len(JOINTS)
    return {
        name: float(
            StateSpace(A, B[:, [i]], np.eye(n, len(A))[[i]], np.zeros((1, 1)), None, SAMPLE_TIME).bandwidth()[0, 0]
        )
        for i, name in enumerate(JOINTS)
        if name not in arm.indexed
    }
