"""A second simulation of the arm: rigid bodies by Pinocchio, drives and friction as ordinary differential equations.

Written from the equations in `docs/physics.md` and the geometry in `models/hmtb/README.md`. It shares with the twin the
numbers of its parameters and nothing else: no MuJoCo, no MJCF, no code of the actuators. SciPy integrates at a tight
tolerance, so that the difference from the twin is the error of the twin's step. States of each joint are angle q (rad),
velocity w (rad/s), load pressure P (MPa; of electric drives current, A), its slow part Pf and the bristles' deflection
z (rad); an indexed shoulder roll is rigid, so that six joints move.
"""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq, root

from hmtb_twin.arm.arm import Arm
from hmtb_twin.parameters.specimen import LINK_NAMES, Specimen
from hmtb_twin.parameters.variants import JOINTS, PAYLOADS, VARIANTS

AXES = dict(zip(JOINTS, ((1, 0, 0), (0, 0, 1), (0, -1, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (1, 0, 0)), strict=True))
"""Axis of each joint along the arm's own x, y and z when it is stretched out: forward, left, up."""

FASTEST = 1000.0
"""R, largest rate of the bristles, 1/s."""

SCALES = np.array([1e-3, 1e-2, 1e-2, 1e-2, 1e-4])
"""Typical size of q, w, P, Pf and z; absolute tolerances are the relative one of these."""


def rigid_bodies(
    variant: str, payload: str, specimen: Specimen | None = None, *, joints: Sequence[str] = JOINTS
) -> pin.Model:
    """Return links, payload and rotors of an arm as Pinocchio has them.

    Every link is a uniform solid cylinder along its x axis, the payload a uniform box in front of the end effector, and
    each joint stands at the end of the link before it.

    Args:
        variant: One of `VARIANTS`.
        payload: One of `PAYLOADS`.
        specimen: Deviations of the bodies from the variant's.
        joints: The joints that move; the others are rigid at 0 rad.
    """
    arm, specimen = VARIANTS[variant], specimen or Specimen()
    links = [arm.links[name] for name in LINK_NAMES]
    square, length = (np.array([getattr(link, name) ** 2 for link in links]) for name in ("radius", "length"))
    masses, halves = (
        np.array(column) for column in zip(*((link.mass, link.length / 2) for link in links), strict=True)
    )
    across = masses * (square / 4 + length / 12)
    moments = np.stack([masses * square / 2, across, across], axis=1)
    centres = halves[:, None] * [1.0, 0.0, 0.0]
    bodies = [pin.Inertia(*body) for body in zip(*specimen.bodies(masses, centres, moments), strict=True)]

    model, parent, place = pin.Model(), 0, np.zeros(3)
    model.gravity.linear = np.array([0.0, 0.0, -arm.gravity])
    for name, link, body in zip(JOINTS, links, bodies, strict=False):
        if name in joints:
            joint = pin.JointModelRevoluteUnaligned(np.array(AXES[name], float))
            parent, place = model.addJoint(parent, joint, pin.SE3(np.eye(3), place), name), np.zeros(3)
        model.appendBodyToJoint(parent, body, pin.SE3(np.eye(3), place))
        place = place + np.array([link.length, 0.0, 0.0])
    model.appendBodyToJoint(parent, bodies[-1], pin.SE3(np.eye(3), place))
    box = PAYLOADS[payload]
    if box is not None:
        x, y, z = box.size
        mass = specimen.payload_mass * box.mass
        inertia = mass / 12 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y])
        tool = place + np.array([links[-1].length, 0.0, 0.0])
        model.appendBodyToJoint(
            parent, pin.Inertia(mass, np.array([x / 2, 0.0, 0.0]), inertia), pin.SE3(np.eye(3), tool)
        )
    model.armature = np.array([arm.actuators[name].motor.armature for name in joints])
    return model


def bodies_of_file(arm: Arm) -> pin.Model:
    """Return the bodies of an arm without payload as Pinocchio alone reads them from the arm's own file."""
    path = Path(arm.description.rigid.picture)
    if path.suffix == ".urdf":
        text = path.read_text()
        # A joint without limits would be held as cosine and sine, and not as an angle.
        whole = pin.buildModelFromXML(text.replace('type="continuous"', 'type="revolute"'))
    else:
        whole = pin.buildModelFromMJCF(str(path))
    place = pin.neutral(whole)
    held = [k for k in range(1, whole.njoints) if whole.names[k] not in arm.joints]
    for k in held:
        place[whole.idx_qs[k]] = arm.description.rigid.locked.get(whole.names[k], 0.0)
    model = pin.buildReducedModel(whole, held, place)
    assert tuple(model.names[1:]) == arm.joints
    model.gravity.linear = np.array([0.0, 0.0, -arm.description.gravity])
    model.armature = np.array([arm.drives[name].motor.armature for name in arm.joints])
    return model


class IndependentArm:
    """An arm in free space with linear drives, as ordinary differential equations.

        M(q) dw/dt + c(q, w) + g(q) = D clip(P, -Pmax, Pmax) - friction - B w
        k dP/dt = clip(Q, -Qmax, Qmax) - K P - D w
        Q       = F u/D + K f/D + G ((u + f)/D - P) + c D w - H (P - Pf),     u = kp (q_cmd - q) - kd w
        dPf/dt  = (P - Pf)/T
        dz/dt   = (w - r z)/sqrt(1 + (r/R)^2),     friction = s0 z + s1 dz/dt
        r       = s0 v(w)/g(w),     g(w) = Fc + (Fs - Fc) exp(-(w/ws)^2) + m |D P|,     v(w) = w^2/sqrt(w^2 + w0^2)

    with K the flow-pressure gain including leakage and f the weight at the commanded pose by the controller's model.
    R bounds s0 to 2 R^2 J and s1 to R J/2, J the inertia that a joint sees at zero angles while the others are free.
    All numbers are those of the arm's records, as attributes per moving joint, six or seven, named as above.

    Args:
        arm: The arm whose numbers are taken.

    Attributes:
        met_limit: Whether flow or torque has been at its limit since the last simulation began.
    """

    def __init__(self, arm: Arm) -> None:
        self.met_limit = False
        self.joints, self.sample_time = arm.joints, arm.description.sample_time
        names = list(arm.description.free)
        self.moving, self.count = [arm.joints.index(name) for name in names], len(names)
        drives, gains = [arm.drives[name] for name in names], [arm.gains[name] for name in names]
        if arm.description.rigid is None:
            self.controller = rigid_bodies(arm.variant, arm.payload)
            self.model = rigid_bodies(arm.variant, arm.payload, arm.specimen, joints=names)
        else:
            self.controller = self.model = bodies_of_file(arm)
        motors, seals = [drive.motor for drive in drives], [drive.friction for drive in drives]
        self.D, self.K, self.k, self.largest = np.array(
            [[motor.constant, motor.resistance, motor.inductance, motor.largest_input] for motor in motors]
        ).T
        self.limit = np.array([motor.maximum_torque for motor in motors]) / self.D
        self.F = np.array([gain.feed or motor.resistance for gain, motor in zip(gains, motors, strict=True)])
        self.kp, self.kd, self.G, self.H, self.T, self.c = np.array(
            [[gain.kp, gain.kd, gain.pressure, gain.dynamic, gain.washout, gain.compensated] for gain in gains]
        ).T
        self.B = np.array([drive.drag for drive in drives])
        self.dry = arm.plant.friction in ("coulomb", "lugre")
        if self.dry:
            ratio = np.array([seal.static_ratio if arm.plant.friction == "lugre" else 1.0 for seal in seals])
            self.coulomb = np.array([drive.coulomb_torque for drive in drives])
            self.excess = (ratio - 1.0) * self.coulomb
            self.ws, presliding, bristle_time, self.w0 = np.array(
                [[seal.stribeck_velocity, seal.presliding, seal.bristle_time, seal.slip_velocity] for seal in seals]
            ).T
            free = 1.0 / np.diag(np.linalg.inv(self.inertia(np.zeros(self.count))))
            self.loss = np.array([seal.load_loss for seal in seals])
            # Bristles carry the friction of half the rated load at their deflection.
            rated = np.array([drive.rated_torque for drive in drives])
            stiffness = (self.coulomb + 0.5 * self.loss * rated) / presliding
            passive = np.divide(self.B, ratio - 1.0, out=np.full(self.count, np.inf), where=ratio > 1.0)
            self.s0 = np.minimum(stiffness, 2.0 * FASTEST**2 * free)
            self.s1 = np.min([stiffness * bristle_time, passive, 0.5 * FASTEST * free], axis=0)
            # A joint without dry friction has bristles of no stiffness: any g but 0 will do.
            self.coulomb[self.coulomb == 0.0] = 1.0

    @cached_property
    def _scratch(self) -> tuple[pin.Data, pin.Data]:
        return self.model.createData(), self.controller.createData()

    def feedforward(self, command: np.ndarray) -> np.ndarray:
        """Return the weight (n,), N m, at a commanded pose (7,), rad, by the controller's model."""
        return pin.computeGeneralizedGravity(self.controller, self._scratch[1], command)[self.moving].copy()

    def weight(self, q: np.ndarray) -> np.ndarray:
        """Return the weight (n,), N m, of the arm itself at angles (n,), rad."""
        return pin.computeGeneralizedGravity(self.model, self._scratch[0], q).copy()

    def rest(self, command: np.ndarray) -> np.ndarray:
        """Return the state (5n,) at rest under a commanded pose (7,), rad, with bristles undeflected."""
        ask, ahead = np.asarray(command, float)[self.moving], self.feedforward(command)
        stiffness = self.kp * (self.F + self.G) / (self.K + self.G)
        q = root(lambda q: stiffness * (ask - q) + ahead - self.weight(q), ask, tol=1e-14).x
        pressure = self.weight(q) / self.D
        return np.concatenate([q, np.zeros(self.count), pressure, pressure, np.zeros(self.count)])

    def slope(self, _t: float, state: np.ndarray, ask: np.ndarray, ahead: np.ndarray) -> np.ndarray:
        """Return the time derivative of the state (5n,) under commanded angles and feedforward torques (n,)."""
        q, w, P, slow, z = state.reshape(5, self.count)
        torque = self.kp * (ask - q) - self.kd * w
        Q = (self.F * torque + self.K * ahead + self.G * (torque + ahead)) / self.D
        Q += self.c * self.D * w - self.G * P - self.H * (P - slow)
        self.met_limit |= bool((np.abs(Q) > self.largest).any() or (np.abs(P) > self.limit).any())
        Q = np.minimum(np.maximum(Q, -self.largest), self.largest)
        load = self.D * np.minimum(np.maximum(P, -self.limit), self.limit) - self.B * w
        out = np.zeros((5, self.count))
        if self.dry:
            bound = self.coulomb + self.excess * np.exp(-((w / self.ws) ** 2))
            bound += self.loss * self.D * np.minimum(np.abs(P), self.limit)
            rate = self.s0 * w * w / np.sqrt(w * w + self.w0**2) / bound
            out[4] = (w - rate * z) / np.sqrt(1.0 + (rate / FASTEST) ** 2)
            load -= self.s0 * z + self.s1 * out[4]
        out[0] = w
        out[1] = pin.aba(self.model, self._scratch[0], q, w, load)
        out[2] = (Q - self.K * P - self.D * w) / self.k
        out[3] = (P - slow) / self.T
        return out.ravel()

    def simulate(self, command: np.ndarray, noise: np.ndarray | None = None, *, rtol: float = 1e-10) -> np.ndarray:
        """Return the angles (N, 7), rad, at the end of each tick of 20 ms, from rest under the first command.

        Args:
            command: Commanded angles (N, 7), rad, each held for a tick.
            noise: Torque noise of the drives (N, 7), N m, held likewise.
            rtol: Relative tolerance of the integration.
        """
        state, step, self.met_limit = self.rest(command[0]), 1e-4, False
        angles = np.zeros_like(command)
        for k, row in enumerate(command):
            ahead = self.feedforward(row) + (0.0 if noise is None else noise[k, self.moving])
            solved = solve_ivp(
                self.slope,
                (0.0, self.sample_time),
                state,
                "DOP853",
                args=(row[self.moving], ahead),
                rtol=rtol,
                atol=rtol * np.repeat(SCALES, self.count),
                first_step=step,
            )
            if not solved.success:
                raise ArithmeticError(f"tick {k}: {solved.message}")
            state, step = solved.y[:, -1], min(1e-3, np.diff(solved.t)[:-1].max(initial=1e-6))
            angles[k, self.moving] = state[: self.count]
        return angles

    def linear(self, command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return A (4n, 4n) and B (4n, n) of the arm at rest from commanded to actual angles.

        States are q, w, P and Pf; dry friction is off, the drag stays. Exact for a zero-order hold over a tick.

        Args:
            command: Commanded pose (7,), rad.
        """
        q, data = self.rest(command)[: self.count], self._scratch[0]
        D, k, one = self.D, self.k, np.eye(self.count)
        inverse = np.linalg.inv(self.inertia(q))
        stiffness = np.array(pin.computeGeneralizedGravityDerivatives(self.model, data, q))
        ahead = pin.computeGeneralizedGravityDerivatives(self.controller, self._scratch[1], command)
        A, B = np.zeros((4, self.count, 4, self.count)), np.zeros((4, self.count, self.count))
        A[0, :, 1] = one
        A[1, :, 0], A[1, :, 1], A[1, :, 2] = -inverse @ stiffness, -inverse * self.B, inverse * D
        opened = (self.F + self.G) / D / k
        A[2, :, 0], A[2, :, 1] = np.diag(-opened * self.kp), np.diag(-opened * self.kd + (self.c - 1.0) * D / k)
        A[2, :, 2], A[2, :, 3] = -np.diag((self.K + self.G + self.H) / k), np.diag(self.H / k)
        A[3, :, 2], A[3, :, 3] = np.diag(1.0 / self.T), np.diag(-1.0 / self.T)
        weight = np.array(ahead)[np.ix_(self.moving, self.moving)]
        B[2] = np.diag(opened * self.kp) + ((self.K + self.G) / D / k)[:, None] * weight
        size = 4 * self.count
        whole = np.zeros((size + self.count,) * 2)
        whole[:size, :size], whole[:size, size:] = A.reshape(size, size), B.reshape(size, self.count)
        held = expm(self.sample_time * whole)[:size]
        return held[:, :size], held[:, size:]

    def inertia(self, q: np.ndarray) -> np.ndarray:
        """Return the inertia matrix (n, n), kg m^2, at angles (n,), rad, rotors included."""
        upper = np.triu(pin.crba(self.model, self._scratch[0], q))
        return upper + np.triu(upper, 1).T

    def bandwidths(self, command: np.ndarray) -> dict[str, float]:
        """Return the first frequency, Hz, at which each moving joint answers its own command 3.01 dB less than at 0 Hz.

        Args:
            command: Commanded pose (7,), rad.
        """
        A, B = self.linear(command)

        def gain(f: float, row: int) -> float:
            z = np.exp(2j * np.pi * f * self.sample_time)
            return float(abs(np.linalg.solve(z * np.eye(len(A)) - A, B[:, row])[row]))

        def crossing(row: int) -> float:
            level = gain(0.0, row) * np.sqrt(0.5)
            grid = np.geomspace(0.01, 0.5 / self.sample_time, 300)
            first = next(i for i, f in enumerate(grid) if gain(f, row) < level)
            return brentq(lambda f: gain(f, row) - level, grid[first - 1], grid[first], xtol=1e-12)

        return {self.joints[j]: crossing(row) for row, j in enumerate(self.moving)}
