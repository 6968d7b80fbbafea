"""Oil and energy balances of a run of the arm, for both forms of the actuator."""

from copy import copy
from dataclasses import dataclass, fields

import mujoco
import numpy as np
from scipy.integrate import simpson

from hmtb_twin import JOINTS
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.hydraulics.drive_actuators import drive_parameters
from hmtb_twin.parameters.values import SAMPLE_TIME
from hmtb_twin.parameters.variants import OPERATING_POSE


@dataclass(frozen=True)
class OilBalance:
    """Oil that came in through the load ports and where it went; volumes (n,), cm^3."""

    ports: np.ndarray
    leaked: np.ndarray
    swept: np.ndarray
    stored: np.ndarray
    throughput: np.ndarray  # integral of the magnitude of the flow through the load ports

    @property
    def residual(self):
        """Oil that came in and is nowhere, (n,) cm^3."""
        return self.ports - self.leaked - self.swept - self.stored

    @property
    def closure(self):
        """Sum of the residuals' magnitudes over all the oil that flowed."""
        return float(np.abs(self.residual).sum() / self.throughput.sum())


@dataclass(frozen=True)
class EnergyBalance:
    """Energy that the supply gave, its pressure times the flow it delivers, and where it went; J."""

    supplied: float
    throttled: float  # in the valves
    leaked: float
    compressed: float
    limited: float  # negative where a load overruns the torque's limit: real relief valves would open before
    rubbed: float  # by dry friction
    dragged: float  # by viscous friction
    constrained: float  # by pin and stops
    kinetic: float
    potential: float

    @property
    def closure(self):
        """Energy that came in and is nowhere, over the energy supplied."""
        spent = sum(getattr(self, item.name) for item in fields(self) if item.name != "supplied")
        return abs(self.supplied - spent) / self.supplied


def binary(arm, joints, amplitude=0.067, rest=2.0):
    """Return pseudo-random binary commands (N, 7) on some joints for 5 s, then the pose again, rad."""
    command = np.tile(arm.pose(OPERATING_POSE), (round(50 * (5.0 + rest)), 1))
    bits = np.random.default_rng(3).choice([-amplitude, amplitude], (50, len(joints)))
    command[:250, [JOINTS.index(name) for name in joints]] += np.repeat(bits, 5, axis=0)
    command[0] = arm.pose(OPERATING_POSE)
    return command


def link_energy(model, angles, velocities):
    """Return the potential and the kinetic energy of the links, J."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = angles, velocities
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_energyPos(model, data)
    mujoco.mj_energyVel(model, data)
    return np.array(data.energy)


def steps(model, arm, command, *, ends=False):
    """Yield the data before each physics step of a run from rest under commands at 50 Hz, and at the end.

    With `ends`, forces are computed at each instant, and the instant between two ticks comes twice: with the controls
    before it and with those after it.
    """
    data = arm.rest(command[0])
    for control in arm.controls(command):
        data.ctrl[:] = control
        for _ in range(round(SAMPLE_TIME / model.opt.timestep)):
            if ends:
                mujoco.mj_forward(model, data)
            yield data
            mujoco.mj_step(model, data)
        if ends:
            mujoco.mj_forward(model, data)
            yield data
    if not ends:
        yield data
    assert not any(stat.number for stat in data.warning), "the physics engine warned: the balances mean nothing"


class TickIntegral:
    """Integral over a run by Simpson's rule over each tick, within which all rates are smooth."""

    def __init__(self, model, ticks):
        self.instants = 1 + round(SAMPLE_TIME / model.opt.timestep)
        self._weights = np.tile(simpson(np.eye(self.instants), dx=model.opt.timestep), ticks)

    def __call__(self, rate):
        return np.tensordot(self._weights, rate, axes=1)


def linear_balances(arm, command, *, refined=1):
    """Run an arm with linear actuators from rest under commands (N, 7) at 50 Hz, rad; return its balances.

    Both close with the fourth power of the step where nothing saturates. `refined` physics steps replace one.
    """
    model, n = copy(arm.model), len(JOINTS)
    model.opt.timestep /= refined
    integral = TickIntegral(model, len(command))
    rows = [
        np.concatenate([d.qpos, d.qvel, d.qfrc_constraint + d.qfrc_spring, d.ctrl, d.act])
        for d in steps(model, arm, command, ends=True)
    ]
    angles, velocities, held, control, states = np.split(np.array(rows), [n, 2 * n, 3 * n, 5 * n], axis=1)
    states, p = states.reshape(-1, n, eq.LINEAR_STATES), drive_parameters(model)
    load, flow, lost, rubbing = (np.empty((len(rows), n)) for _ in range(4))
    for k, j in np.ndindex(load.shape):
        own, q, w = states[k, j], angles[k, j], velocities[k, j]
        load[k, j], filtered = own[eq.LINEAR_LOAD], own[eq.LINEAR_FILTERED]
        u, f = eq.position_torque(p[j], control[k, 2 * j], q, w), control[k, 2 * j + 1]
        asked = eq.servo_flow(p[j], p[j, eq.SLOPE], u, f, load[k, j], filtered, w)
        flow[k, j] = np.clip(asked, -p[j, eq.LARGEST], p[j, eq.LARGEST])
        lost[k, j] = eq.beyond_limit(p[j], load[k, j]) * w
        rate = eq.bristle_rate(p[j], own[eq.LINEAR_BRISTLES], w)
        rubbing[k, j] = eq.friction_torque(p[j], own[eq.LINEAR_BRISTLES], rate) * w
    leakage = np.array([arm.actuators[name].leakage for name in JOINTS])
    supply = np.array([arm.actuators[name].hydraulics.pressure for name in JOINTS])
    ports, compliance = flow - (p[:, eq.SLOPE] - leakage) * load, 0.5 * p[:, eq.CHAMBER]
    oil = OilBalance(
        ports=integral(ports),
        leaked=leakage * integral(load),
        swept=p[:, eq.DISPLACEMENT] * (angles[-1] - angles[0]),
        stored=compliance * (load[-1] - load[0]),
        throughput=integral(np.abs(ports)),
    )
    supplied = float(integral(np.abs(ports) @ supply))
    before, after = (link_energy(model, angles[k], velocities[k]) for k in (0, -1))
    energy = EnergyBalance(
        supplied=supplied,
        throttled=supplied - float(integral((ports * load).sum(axis=1))),
        leaked=float(leakage @ integral(load**2)),
        compressed=float(0.5 * compliance @ (load[-1] ** 2 - load[0] ** 2)),
        limited=float(integral(lost).sum()),
        rubbed=float(integral(rubbing).sum()),
        dragged=float(model.dof_damping @ integral(velocities**2)),
        constrained=-float(integral(held * velocities).sum()),
        potential=float(after[0] - before[0]),
        kinetic=float(after[1] - before[1]),
    )
    return oil, energy


def orifice_balances(arm, command, *, refined=4):
    """Run an arm with servo valves from rest under commands (N, 7) at 50 Hz, rad; return its balances.

    Flows are computed from the states at the ends of the physics steps and integrated by Simpson's rule, so that both
    balances close with the fourth power of the step. The oil balance is that of chambers A and B of each joint in turn
    and of the supply (15,), where swept is what the valves draw; in the energy balance, throttled includes lands and
    check valves, compressed the accumulator's oil. `refined` physics steps replace one.
    """
    model, n = copy(arm.model), len(JOINTS)
    model.opt.timestep /= refined
    integral = TickIntegral(model, len(command))
    rows = [
        np.concatenate([d.qpos, d.qvel, d.qfrc_constraint + d.qfrc_spring, d.act])
        for d in steps(model, arm, command, ends=True)
    ]
    angles, velocities, constraint, supply, joints = np.split(np.array(rows), [n, 2 * n, 3 * n, 3 * n + 1], axis=1)
    supply, joints, p = supply[:, 0], joints.reshape(-1, n, eq.STATES), drive_parameters(model)

    load = joints[..., eq.LOAD]
    chambers = np.stack([joints[..., eq.MEAN] + 0.5 * load, joints[..., eq.MEAN] - 0.5 * load], axis=-1)
    # Flows of each chamber from the supply and to the return line (instants, n, 2, 2) and through its check valves.
    lands, checks, rubbing = np.empty((*chambers.shape, 2)), np.empty_like(chambers), np.empty_like(load)
    for k, j in np.ndindex(load.shape):
        own, w = joints[k, j], velocities[k, j]
        lands[k, j] = np.reshape(eq.land_flows(p[j], own[eq.SPOOL], supply[k], *chambers[k, j]), (2, 2))
        checks[k, j] = [eq.check_flow(p[j], pressure) for pressure in chambers[k, j]]
        rate = eq.bristle_rate(p[j], own[eq.BRISTLES], w)
        rubbing[k, j] = eq.friction_torque(p[j], own[eq.BRISTLES], rate) * w
    pump = np.array([eq.pump_flow(p[0], pressure) for pressure in supply])
    drawn, returned = lands.sum(axis=(1, 2)).T

    sides, capacity = np.array([1.0, -1.0]), p[0, eq.CAPACITY]
    inward = lands[..., 0] - lands[..., 1] + checks
    leaked, swept = p[:, eq.LEAKAGE] * integral(load), p[:, eq.DISPLACEMENT] * (angles[-1] - angles[0])
    oil = OilBalance(
        ports=np.append(integral(inward).ravel(), integral(pump)),
        leaked=np.append(np.outer(leaked, sides).ravel(), 0.0),
        swept=np.append(np.outer(swept, sides).ravel(), integral(drawn)),
        stored=np.append(
            (p[:, [eq.CHAMBER]] * (chambers[-1] - chambers[0])).ravel(), capacity * (supply[-1] - supply[0])
        ),
        throughput=np.append(integral(np.abs(inward)).ravel(), integral(pump)),
    )

    back = p[0, eq.RETURN]
    drops = np.stack([supply[:, None, None] - chambers, chambers - back], axis=-1)
    stored = p[:, eq.CHAMBER] @ (chambers[-1] ** 2 - chambers[0] ** 2)
    before, after = (link_energy(model, angles[k], velocities[k]) for k in (0, -1))
    energy = EnergyBalance(
        supplied=float(integral(pump * supply - back * (returned - checks.sum(axis=(1, 2))))),
        throttled=float(integral((lands * drops).sum(axis=(1, 2, 3)) + (checks * (back - chambers)).sum(axis=(1, 2)))),
        leaked=float(p[:, eq.LEAKAGE] @ integral(load**2)),
        compressed=float(0.5 * stored.sum() + 0.5 * capacity * (supply[-1] ** 2 - supply[0] ** 2)),
        limited=0.0,
        rubbed=float(integral(rubbing).sum()),
        dragged=float(model.dof_damping @ integral(velocities**2)),
        constrained=-float(integral(constraint * velocities).sum()),
        potential=float(after[0] - before[0]),
        kinetic=float(after[1] - before[1]),
    )
    return oil, energy
