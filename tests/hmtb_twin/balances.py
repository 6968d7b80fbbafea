"""Oil and energy balances of a run of the arm, for both forms of the actuator."""

from copy import copy
from dataclasses import dataclass, fields

import mujoco
import numpy as np

from hmtb_twin import JOINTS
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.hydraulics.orifice import arm_parameters
from hmtb_twin.parameters.values import OPERATING_POSE, SAMPLE_TIME


@dataclass(frozen=True)
class OilBalance:
    """Oil that came in through the load ports and where it went; volumes (n,), cm^3."""

    ports: np.ndarray
    leaked: np.ndarray
    swept: np.ndarray
    stored: np.ndarray
    underway: np.ndarray  # the joint takes the oil one physics step h late: D h (w at the end less w at the start)
    throughput: np.ndarray  # integral of the magnitude of the flow through the load ports

    @property
    def residual(self):
        """Oil that came in and is nowhere, (n,) cm^3."""
        return self.ports - self.leaked - self.swept - self.stored + self.underway

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


def linear_balances(arm, command, *, refined=1):
    """Run an arm with linear actuators from rest under commands (N, 7) at 50 Hz, rad; return its balances.

    Over a physics step of length h the engine holds valve flow Q and joint velocity w, and integrates
    V/(4 beta) dP/dt = Q - (K + C) P - D w exactly, so that the oil balance closes to rounding. Semi-implicit Euler is
    the leapfrog scheme: a velocity belongs to the middle of a step. Torques work on the mean of the velocities before
    and after, and the links' energy is read half a step before the angle, so that from rest to rest the energy balance
    closes with the square of the step. `refined` physics steps replace one.
    """
    model = copy(arm.model)
    model.opt.timestep /= refined
    h = model.opt.timestep
    rows = []
    for data in steps(model, arm, command):
        # Coulomb friction without bristles is a constraint to the engine.
        dry, rubbing = np.zeros(len(JOINTS)), data.efc_type == mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF
        dry[data.efc_id[rubbing]] = data.efc_force[rubbing]
        state = (data.qpos, data.qvel, data.act[arm.pressure_states])
        rows.append((*state, data.actuator_force, data.qfrc_constraint, dry, data.ctrl[0::2], data.ctrl[1::2]))
        rows[-1] = np.array(rows[-1])
    angles, velocities, pressures, actuator, constraint, dry, angle_control, torque_control = np.stack(rows, axis=1)
    # What acted over a step stands in the row after it; the controls in the row before.
    actuator, constraint, dry = actuator[1:], constraint[1:], dry[1:]

    drives = [arm.actuators[name] for name in JOINTS]
    numbers = ("displacement", "compliance", "leakage", "flow_pressure_gain", "maximum_torque", "drag", "largest_flow")
    D, compliance, leakage, loss, most, drag, largest_flow = np.array(
        [[getattr(a, n) for a in drives] for n in numbers]
    )
    supply, (kp, kd) = np.array([a.hydraulics.pressure for a in drives]), np.array([arm.gains[j] for j in JOINTS]).T
    w = velocities[:-1]
    servo = kp * (angle_control - angles)[:-1] - kd * w + torque_control[:-1]
    # The servo knows that pressure costs flow and that the joint's velocity takes some.
    flow = np.clip(servo * loss / D + D * w, -largest_flow, largest_flow)
    steady, lag = (flow - D * w) / loss, compliance / loss
    fading = pressures[:-1] - steady
    pressure = h * steady - fading * lag * np.expm1(-h / lag)
    squared = h * steady**2 + 2.0 * steady * (pressure - h * steady) - fading**2 * lag / 2.0 * np.expm1(-2.0 * h / lag)
    ports = h * flow - (loss - leakage) * pressure
    oil = OilBalance(
        ports=ports.sum(axis=0),
        leaked=leakage * pressure.sum(axis=0),
        swept=D * (angles[-1] - angles[0]),
        stored=compliance * (pressures[-1] - pressures[0]),
        underway=D * h * (velocities[-1] - velocities[0]),
        throughput=np.abs(ports).sum(axis=0),
    )

    travel = h * 0.5 * (velocities[:-1] + velocities[1:])
    torque = D * pressures[1:]
    held = np.clip(torque, -most, most)
    supplied = float((supply * np.abs(ports)).sum())
    before, after = (link_energy(model, angles[k] - 0.5 * h * velocities[k], velocities[k]) for k in (0, -1))
    energy = EnergyBalance(
        supplied=supplied,
        throttled=supplied - float((flow * pressure - (loss - leakage) * squared).sum()),
        leaked=float((leakage * squared).sum()),
        compressed=float((0.5 * compliance * (pressures[-1] ** 2 - pressures[0] ** 2)).sum()),
        limited=float(((torque - held) * travel).sum()),
        rubbed=float(((held - actuator - dry) * travel).sum()),
        dragged=float((drag * travel**2).sum() / h),
        constrained=-float(((constraint - dry) * travel).sum()),
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
    instants = 1 + round(SAMPLE_TIME / model.opt.timestep)
    rows = [np.concatenate([d.qpos, d.qvel, d.qfrc_constraint, d.act]) for d in steps(model, arm, command, ends=True)]
    angles, velocities, constraint, supply, joints = np.split(np.array(rows), [n, 2 * n, 3 * n, 3 * n + 1], axis=1)
    supply, joints, p = supply[:, 0], joints.reshape(-1, n, eq.STATES), arm_parameters(model)

    def integral(rate):
        """Simpson's rule over each tick, within which all rates are smooth."""
        weights = np.full(instants, 2.0)
        weights[1::2], weights[[0, -1]] = 4.0, 1.0
        return np.tensordot(np.tile(weights, len(command)), rate, axes=1) * model.opt.timestep / 3.0

    load = joints[..., eq.LOAD]
    chambers = np.stack([joints[..., eq.MEAN] + 0.5 * load, joints[..., eq.MEAN] - 0.5 * load], axis=-1)
    # Flows of each chamber from the supply and to the return line (instants, n, 2, 2) and through its check valves.
    lands, checks, rubbing = np.empty((*chambers.shape, 2)), np.empty_like(chambers), np.empty_like(load)
    for k, j in np.ndindex(load.shape):
        own, w = joints[k, j], velocities[k, j]
        lands[k, j] = np.reshape(eq.land_flows(p[j], own[eq.SPOOL], supply[k], *chambers[k, j]), (2, 2))
        checks[k, j] = [eq.check_flow(p[j], pressure) for pressure in chambers[k, j]]
        rubbing[k, j] = eq.friction_torque(p[j], own[eq.BRISTLES], w) * w
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
        underway=np.zeros(2 * n + 1),
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
