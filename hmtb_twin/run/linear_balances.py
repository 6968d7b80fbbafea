"""Oil and energy balances of a run with linear actuators, summed as the physics engine steps."""

from copy import copy
from dataclasses import dataclass

import mujoco
import numpy as np

from hmtb_twin.arm.arm import Arm
from hmtb_twin.parameters.values import JOINTS, SAMPLE_TIME
from hmtb_twin.run.balances import EnergyBalance, OilBalance, check_course, checked_run, link_energy


@dataclass(frozen=True)
class _Run:
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
    """Run an arm from rest and draw up its books.

    Over a physics step of length h the engine holds valve flow Q and joint velocity w, and integrates
    V/(4 beta) dP/dt = Q - (K + C) P - D w exactly: P is an exponential; its integral and that of its square are known.
    The oil's book so closes to rounding. The torque D P at the step's end acts on the joint over the whole step.
    Semi-implicit Euler is the leapfrog scheme: a velocity belongs to the middle of a step. Torques work on the mean of
    the velocities before and after, and the links' energy is read where the velocity belongs, half a step before the
    angle. From rest to rest the energy's book so closes with the square of the step; in the middle of a motion what the
    implicit step adds to the inertia is seen, in proportion to the step. All that is summed are states and torques of
    the engine, and the valve flow that the servo's law asks for from them; what is throttled is by definition what the
    supply gave and did not come out of the load ports.

    Args:
        arm: The arm, with linear actuators, in free space.
        command: Commanded angles (N, 7) at 50 Hz, rad; the run starts at rest at the first.
        refined: Physics steps in place of one, 1 to `FINEST`.

    Returns:
        The balances of oil and of energy.

    Raises:
        TwinError: The actuators are not linear, the arm stands at its worksite, or `command` or `refined` is not what
            it should be; the physics diverged.
    """
    command = checked_run(arm, "linear", command, refined)
    model = copy(arm.model)
    model.opt.timestep /= refined
    run = _run(model, arm, command)

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
    before, after = _energy(model, run, 0), _energy(model, run, -1)
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


def _run(model: mujoco.MjModel, arm: Arm, command: np.ndarray) -> _Run:
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
    check_course(data)
    return _Run(model.opt.timestep, np.repeat(controls, substeps, axis=0), *states, *torques)


def _dry_friction(data: mujoco.MjData) -> np.ndarray:
    """Torque of Coulomb friction without bristles on each joint, (7,) N m: a constraint to the engine."""
    torque = np.zeros(len(JOINTS))
    rubbing = data.efc_type == mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF
    torque[data.efc_id[rubbing]] = data.efc_force[rubbing]
    return torque


def _valve_flow(arm: Arm, run: _Run) -> np.ndarray:
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


def _energy(model: mujoco.MjModel, run: _Run, k: int) -> tuple[float, float]:
    """Potential and kinetic energy of the links at the instant to which a velocity belongs, J."""
    data = mujoco.MjData(model)
    data.qvel[:] = run.velocities[k]
    data.qpos[:] = run.angles[k] - 0.5 * run.step * run.velocities[k]
    mujoco.mj_fwdPosition(model, data)
    return link_energy(model, data)
