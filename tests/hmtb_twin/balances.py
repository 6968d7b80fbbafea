"""Oil and energy balances of a run of the arm, for both forms of the actuator."""

from copy import copy
from dataclasses import dataclass, fields

import mujoco
import numpy as np

from hmtb_twin import JOINTS, Arm
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.hydraulics.orifice import arm_parameters
from hmtb_twin.parameters.values import SAMPLE_TIME


@dataclass(frozen=True)
class OilBalance:
    """Oil of each drive over a run: what came in through the valve is where it went. Volumes (n,), cm^3.

    Attributes:
        ports: Net flow through the valve's load ports.
        leaked: Past the actuator.
        swept: Displaced by the joint's travel.
        stored: By compression.
        underway: Not yet taken or given by the joint, by which the oil lags one physics step: D h (w at the end less w
            at the start). Zero from rest to rest, and with the step.
        throughput: Integral of the magnitude of the flow through the load ports.
    """

    ports: np.ndarray
    leaked: np.ndarray
    swept: np.ndarray
    stored: np.ndarray
    underway: np.ndarray
    throughput: np.ndarray

    @property
    def residual(self) -> np.ndarray:
        """Oil that came in and is nowhere, (n,) cm^3."""
        return self.ports - self.leaked - self.swept - self.stored + self.underway

    @property
    def closure(self) -> float:
        """Sum of the residuals' magnitudes over all the oil that flowed."""
        return float(np.abs(self.residual).sum() / self.throughput.sum())


@dataclass(frozen=True)
class EnergyBalance:
    """Energy of all drives and the arm over a run: what the supply gave is where it went. Energies in J.

    Attributes:
        supplied: By the supply: its pressure times the flow it delivers.
        throttled: Lost in the valves, between supply and load ports.
        leaked: Lost in leakage past the actuators.
        compressed: Stored in the oil's compression.
        limited: Taken by the limit of the actuators' torque, which cuts the torque but not the pressure; negative where
            a load overruns the limit: a real actuator's relief valves would open before.
        rubbed: Lost in dry friction.
        dragged: Lost in viscous drag.
        constrained: Taken by the pin of the indexed joint and by stops.
        kinetic: Gained by the links in kinetic energy.
        potential: Gained by the links in height.
    """

    supplied: float
    throttled: float
    leaked: float
    compressed: float
    limited: float
    rubbed: float
    dragged: float
    constrained: float
    kinetic: float
    potential: float

    @property
    def residual(self) -> float:
        """Energy that came in and is nowhere, J."""
        return self.supplied - sum(getattr(self, item.name) for item in fields(self) if item.name != "supplied")

    @property
    def closure(self) -> float:
        """Magnitude of the residual over the energy supplied."""
        return abs(self.residual) / self.supplied


def link_energy(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[float, float]:
    """Return the potential and the kinetic energy of the links, J, at a state whose positions are worked out."""
    mujoco.mj_energyPos(model, data)
    mujoco.mj_energyVel(model, data)
    return float(data.energy[0]), float(data.energy[1])


@dataclass(frozen=True)
class LinearRun:
    """A run at the physics step: states (N + 1, 7) and what acted over each step (N, 7)."""

    step: float
    controls: np.ndarray
    angles: np.ndarray
    velocities: np.ndarray
    pressures: np.ndarray
    actuator_torque: np.ndarray
    constraint_torque: np.ndarray
    dry_friction: np.ndarray


def linear_balances(arm: Arm, command: np.ndarray, *, refined: int = 1) -> tuple[OilBalance, EnergyBalance]:
    """Run an arm with linear actuators from rest under commands (N, 7) at 50 Hz, rad; return its balances.

    Over a physics step of length h the engine holds valve flow Q and joint velocity w, and integrates
    V/(4 beta) dP/dt = Q - (K + C) P - D w exactly, so that the oil balance closes to rounding. Semi-implicit Euler is
    the leapfrog scheme: a velocity belongs to the middle of a step. Torques work on the mean of the velocities before
    and after, and the links' energy is read half a step before the angle, so that from rest to rest the energy balance
    closes with the square of the step. `refined` physics steps replace one.
    """
    model = copy(arm.model)
    model.opt.timestep /= refined
    run = _linear_run(model, arm, command)

    drives = [arm.actuators[name] for name in JOINTS]
    displacement = np.array([a.displacement for a in drives])
    compliance = np.array([a.compliance for a in drives])
    leakage = np.array([a.leakage for a in drives])
    loss = np.array([a.flow_pressure_gain for a in drives])
    supply = np.array([a.hydraulics.pressure for a in drives])
    largest = np.array([a.maximum_torque for a in drives])
    drag = np.array([a.drag for a in drives])

    h, w = run.step, run.velocities[:-1]
    flow = _valve_flow(arm, run)
    steady, lag = (flow - displacement * w) / loss, compliance / loss
    fading = run.pressures[:-1] - steady
    pressure = h * steady - fading * lag * np.expm1(-h / lag)
    squared = h * steady**2 + 2.0 * steady * (pressure - h * steady) - fading**2 * lag / 2.0 * np.expm1(-2.0 * h / lag)
    ports = h * flow - (loss - leakage) * pressure
    work_at_ports = flow * pressure - (loss - leakage) * squared
    oil = OilBalance(
        ports=ports.sum(axis=0),
        leaked=leakage * pressure.sum(axis=0),
        swept=displacement * (run.angles[-1] - run.angles[0]),
        stored=compliance * (run.pressures[-1] - run.pressures[0]),
        underway=displacement * h * (run.velocities[-1] - run.velocities[0]),
        throughput=np.abs(ports).sum(axis=0),
    )

    travel = h * 0.5 * (run.velocities[:-1] + run.velocities[1:])
    torque = displacement * run.pressures[1:]
    held = np.clip(torque, -largest, largest)
    supplied = float((supply * np.abs(ports)).sum())
    before, after = _links_energy(model, run, 0), _links_energy(model, run, -1)
    energy = EnergyBalance(
        supplied=supplied,
        throttled=supplied - float(work_at_ports.sum()),
        leaked=float((leakage * squared).sum()),
        compressed=float((0.5 * compliance * (run.pressures[-1] ** 2 - run.pressures[0] ** 2)).sum()),
        limited=float(((torque - held) * travel).sum()),
        rubbed=float(((held - run.actuator_torque - run.dry_friction) * travel).sum()),
        dragged=float((drag * travel**2).sum() / h),
        constrained=-float(((run.constraint_torque - run.dry_friction) * travel).sum()),
        kinetic=after[1] - before[1],
        potential=after[0] - before[0],
    )
    return oil, energy


def _linear_run(model: mujoco.MjModel, arm: Arm, command: np.ndarray) -> LinearRun:
    controls = arm.controls(command)
    substeps = round(SAMPLE_TIME / model.opt.timestep)
    steps, n = len(controls) * substeps, len(JOINTS)
    states = [np.empty((steps + 1, n)) for _ in range(3)]
    torques = [np.empty((steps, n)) for _ in range(3)]
    data = arm.rest(command[0])
    rubs = bool(model.dof_frictionloss.any())
    for k in range(steps + 1):
        for state, now in zip(states, (data.qpos, data.qvel, data.act[arm.pressure_states]), strict=True):
            state[k] = now
        if k == steps:
            break
        data.ctrl[:] = controls[k // substeps]
        mujoco.mj_step(model, data)
        dry = _dry_friction(data) if rubs else 0.0
        for torque, now in zip(torques, (data.actuator_force, data.qfrc_constraint, dry), strict=True):
            torque[k] = now
    assert not any(stat.number for stat in data.warning), "the physics engine warned: the balances mean nothing"
    return LinearRun(model.opt.timestep, np.repeat(controls, substeps, axis=0), *states, *torques)


def _dry_friction(data: mujoco.MjData) -> np.ndarray:
    """Torque of Coulomb friction without bristles on each joint, (7,) N m: a constraint to the engine."""
    torque = np.zeros(len(JOINTS))
    rubbing = data.efc_type == mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF
    torque[data.efc_id[rubbing]] = data.efc_force[rubbing]
    return torque


def _valve_flow(arm: Arm, run: LinearRun) -> np.ndarray:
    """Valve flow at zero load pressure that the servo's law asks for over each step, (N, 7) cm^3/s."""
    kp, kd = np.array([arm.gains[name] for name in JOINTS]).T
    drives = [arm.actuators[name] for name in JOINTS]
    displacement = np.array([a.displacement for a in drives])
    loss = np.array([a.flow_pressure_gain for a in drives])
    largest = np.array([a.largest_flow for a in drives])
    angles, velocities = run.angles[:-1], run.velocities[:-1]
    torque = kp * (run.controls[:, 0::2] - angles) - kd * velocities + run.controls[:, 1::2]
    # The servo knows that pressure costs flow and that the joint's velocity takes some.
    return np.clip(torque * loss / displacement + displacement * velocities, -largest, largest)


def _links_energy(model: mujoco.MjModel, run: LinearRun, k: int) -> tuple[float, float]:
    """Potential and kinetic energy of the links at the instant to which a velocity belongs, J."""
    data = mujoco.MjData(model)
    data.qvel[:] = run.velocities[k]
    data.qpos[:] = run.angles[k] - 0.5 * run.step * run.velocities[k]
    mujoco.mj_fwdPosition(model, data)
    return link_energy(model, data)


@dataclass(frozen=True)
class OrificeRun:
    """States of a run at the ends of its physics steps, tick by tick (ticks, substeps + 1, ...)."""

    step: float
    angles: np.ndarray
    velocities: np.ndarray
    states: np.ndarray
    constraint: np.ndarray
    mechanical: np.ndarray

    def integral(self, rate: np.ndarray) -> np.ndarray:
        """Simpson's rule over each tick, within which all rates are smooth."""
        weights = np.full(rate.shape[1], 2.0)
        weights[1::2], weights[[0, -1]] = 4.0, 1.0
        return np.tensordot(rate, weights, axes=([1], [0])).sum(axis=0) * self.step / 3.0


def orifice_balances(arm: Arm, command: np.ndarray, *, refined: int = 4) -> tuple[OilBalance, EnergyBalance]:
    """Run an arm with servo valves from rest under commands (N, 7) at 50 Hz, rad; return its balances.

    Flows are computed from the states at the ends of the physics steps and integrated by Simpson's rule, so that both
    balances close with the fourth power of the step. The oil balance is that of chambers A and B of each joint in turn
    and of the supply (15,), where swept is what the valves draw; in the energy balance, throttled includes lands and
    check valves, compressed the accumulator's oil. `refined` physics steps replace one.
    """
    model = copy(arm.model)
    model.opt.timestep /= refined
    run = _orifice_run(model, arm, command)
    p = arm_parameters(model)
    joints = run.states[..., 1:].reshape(*run.states.shape[:2], len(JOINTS), eq.STATES)
    supply, load = run.states[..., 0], joints[..., eq.LOAD]
    chambers = np.stack([joints[..., eq.MEAN] + 0.5 * load, joints[..., eq.MEAN] - 0.5 * load], axis=-1)
    lands, checks, pump = _flows(p, joints[..., eq.SPOOL], supply, chambers)
    drawn, returned = lands[..., 0].sum(axis=(2, 3)), lands[..., 1].sum(axis=(2, 3))

    sides = np.array([1.0, -1.0])
    inward = lands[..., 0] - lands[..., 1] + checks
    leaked = p[:, eq.LEAKAGE] * run.integral(load)
    swept = p[:, eq.DISPLACEMENT] * (run.angles[-1, -1] - run.angles[0, 0])
    gained = chambers[-1, -1] - chambers[0, 0]
    oil = OilBalance(
        ports=np.append(run.integral(inward).ravel(), run.integral(pump)),
        leaked=np.append(np.outer(leaked, sides).ravel(), 0.0),
        swept=np.append(np.outer(swept, sides).ravel(), run.integral(drawn)),
        stored=np.append((p[:, [eq.CHAMBER]] * gained).ravel(), p[0, eq.CAPACITY] * (supply[-1, -1] - supply[0, 0])),
        underway=np.zeros(2 * len(JOINTS) + 1),
        throughput=np.append(run.integral(np.abs(inward)).ravel(), run.integral(pump)),
    )

    back = p[0, eq.RETURN]
    drops = np.stack([supply[..., None, None] - chambers, chambers - back], axis=-1)
    throttled = (lands * drops).sum(axis=(2, 3, 4)) + (checks * (back - chambers)).sum(axis=(2, 3))
    rubbing = np.empty_like(load)
    for at in np.ndindex(load.shape):
        w = run.velocities[at]
        rubbing[at] = eq.friction_torque(p[at[-1]], joints[at][eq.BRISTLES], w) * w
    stored = p[:, eq.CHAMBER] @ (chambers[-1, -1] ** 2 - chambers[0, 0] ** 2)
    kinds = ("potential", "kinetic")
    energy = EnergyBalance(
        supplied=float(run.integral(pump * supply - back * (returned - checks.sum(axis=(2, 3))))),
        throttled=float(run.integral(throttled)),
        leaked=float(p[:, eq.LEAKAGE] @ run.integral(load**2)),
        compressed=float(0.5 * stored.sum() + 0.5 * p[0, eq.CAPACITY] * (supply[-1, -1] ** 2 - supply[0, 0] ** 2)),
        limited=0.0,
        rubbed=float(run.integral(rubbing).sum()),
        dragged=float(model.dof_damping @ run.integral(run.velocities**2)),
        constrained=-float(run.integral(run.constraint * run.velocities).sum()),
        **{kind: float(change) for kind, change in zip(kinds, run.mechanical[1] - run.mechanical[0], strict=True)},
    )
    return oil, energy


def _orifice_run(model: mujoco.MjModel, arm: Arm, command: np.ndarray) -> OrificeRun:
    substeps = round(SAMPLE_TIME / model.opt.timestep)
    shape, n = (len(command), substeps + 1), len(JOINTS)
    angles, velocities, constraint = (np.empty((*shape, n)) for _ in range(3))
    states = np.empty((*shape, model.na))
    data = arm.rest(command[0])
    ends = [link_energy(model, data)]
    for k, control in enumerate(arm.controls(command)):
        data.ctrl[:] = control
        for i in range(substeps + 1):
            mujoco.mj_forward(model, data)
            angles[k, i], velocities[k, i], states[k, i] = data.qpos, data.qvel, data.act
            constraint[k, i] = data.qfrc_constraint
            if i < substeps:
                mujoco.mj_step(model, data)
    assert not any(stat.number for stat in data.warning), "the physics engine warned: the balances mean nothing"
    ends.append(link_energy(model, data))
    return OrificeRun(model.opt.timestep, angles, velocities, states, constraint, np.array(ends))


def _flows(
    p: np.ndarray, spools: np.ndarray, supply: np.ndarray, chambers: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the flows at every instant, cm^3/s.

    Of each chamber that from the supply and to the return line (ticks, instants, n, 2, 2) and that in through its check
    valves (ticks, instants, n, 2), and the pump's (ticks, instants); spools are (ticks, instants, n).
    """
    lands, checks = np.empty((*chambers.shape, 2)), np.empty_like(chambers)
    pump = np.empty_like(supply)
    for at in np.ndindex(supply.shape):
        pump[at] = eq.pump_flow(p[0], supply[at])
        for j in range(len(p)):
            a, b = chambers[at][j]
            lands[at][j] = np.reshape(eq.land_flows(p[j], spools[at][j], supply[at], a, b), (2, 2))
            checks[at][j] = eq.check_flow(p[j], a), eq.check_flow(p[j], b)
    return lands, checks, pump
