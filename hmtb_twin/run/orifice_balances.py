"""Oil and energy balances of a run with servo valves: every chamber, the supply and the links."""

from copy import copy
from dataclasses import dataclass

import mujoco
import numpy as np

from hmtb_twin.arm.arm import Arm
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.hydraulics.orifice import arm_parameters
from hmtb_twin.parameters.values import JOINTS, SAMPLE_TIME
from hmtb_twin.run.balances import EnergyBalance, OilBalance, check_course, checked_run, link_energy


@dataclass(frozen=True)
class _Run:
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
    """Run an arm with servo valves from rest and draw up its books.

    Each chamber: what its two lands and its check valves let in less what leaks past the actuator and what the joint
    sweeps is what it stores. The supply: what the pump gives less what the lands draw is what the accumulator stores.
    Flows are computed from the states at the ends of the physics steps and integrated by Simpson's rule, so that both
    books close with the fourth power of the step.

    Args:
        arm: The arm, with servo valves, in free space.
        command: Commanded angles (N, 7) at 50 Hz, rad; the run starts at rest at the first.
        refined: Physics steps in place of one, 1 to `FINEST`.

    Returns:
        The balance of oil of chambers A and B of each joint in turn and of the supply, where swept is what the valves
        draw, (15,); and that of energy, in which throttled holds lands and check valves, and compressed the
        accumulator's oil too.

    Raises:
        TwinError: The actuators are not servo valves, the arm stands at its worksite, or `command` or `refined` is not
            what it should be; the physics diverged.
    """
    command = checked_run(arm, "orifice", command, refined)
    model = copy(arm.model)
    model.opt.timestep /= refined
    run = _run(model, arm, command)
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


def _run(model: mujoco.MjModel, arm: Arm, command: np.ndarray) -> _Run:
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
    check_course(data)
    ends.append(link_energy(model, data))
    return _Run(model.opt.timestep, angles, velocities, states, constraint, np.array(ends))


def _flows(
    p: np.ndarray, spools: np.ndarray, supply: np.ndarray, chambers: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Flows at every instant, cm^3/s.

    Args:
        p: Parameters of the valves (n, PARAMETERS).
        spools: Spool positions (ticks, instants, n).
        supply: Supply pressure (ticks, instants), MPa.
        chambers: Pressures of chambers A and B (ticks, instants, n, 2), MPa.

    Returns:
        Of each chamber the flow from the supply and the flow to the return line (ticks, instants, n, 2, 2), the flow
        in through its check valves (ticks, instants, n, 2), and the pump's (ticks, instants).
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
