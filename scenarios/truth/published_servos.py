"""Servo poles for which the coupled arm answers as the printed models do: where the variant `published` comes from.

Each servo places the poles of its joint as if the neighbours stood still; in the arm they move, and the poles with
them. The wanted poles are therefore solved for on the coupled rigid arm with its pressure lags, which is linear in
closed form at a pose. Run as a module it prints them.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from hmtb_twin.arm.controller_model import controller_model
from hmtb_twin.arm.servo_gains import servo_gains
from hmtb_twin.parameters.values import ACTUATORS, BUS, JOINTS, OPERATING_POSE, POSES, SAMPLE_TIME, SERVOS, Servo
from scenarios.files.errors import ScenarioError
from scenarios.truth.published import ELBOW_PITCH_ARMAX, SHOULDER_PITCH_OE, YAW_ARMAX, PublishedModel

TARGETS = (YAW_ARMAX, SHOULDER_PITCH_OE, ELBOW_PITCH_ARMAX)
"""What the variant is fitted to: the models of the thesis' three-joint "SysID model" [Morris1996, eq. 4.14]."""

DOMINANT = 0.05
"""A pole is dominant if it carries more than this part of the gain at 0 Hz."""

FREQUENCIES = np.geomspace(0.05, 5.0, 40)
"""Where responses are compared, Hz: the band of the experiments' excitation and a decade below it."""

RESPONSE_WEIGHT = 1e-3
"""Weight of a response's error beside a pole's: it decides only where the poles leave a choice."""


@dataclass(frozen=True)
class Plane:
    """Joints that move each other at the operating pose, and the servo poles to be found.

    Attributes:
        joints: The joints; no other couples with them there but the indexed shoulder roll, which is pinned.
        unknown: Joint and field of `Servo` of each number to find; the others are nominal.
        start: Where the search starts, rad/s. From far away it ends in solutions whose responses fit less well.
    """

    joints: tuple[str, ...]
    unknown: tuple[tuple[str, str], ...]
    start: tuple[float, ...]


YAW_PLANE = Plane(
    ("shoulder_yaw", "wrist_yaw", "wrist_roll"),
    (("shoulder_yaw", "slow_pole"), ("shoulder_yaw", "fast_pole")),
    (-1.0, -30.0),
)
PITCH_PLANE = Plane(
    ("shoulder_pitch", "elbow_pitch", "wrist_pitch"),
    (
        ("shoulder_pitch", "slow_pole"),
        ("shoulder_pitch", "fast_pole"),
        ("elbow_pitch", "slow_pole"),
        ("elbow_pitch", "fast_pole"),
        ("wrist_pitch", "slow_pole"),
    ),
    (-6.0, -60.0, -6.0, -60.0, -6.0),
)


def dominant_poles(model: PublishedModel) -> np.ndarray:
    """Return the poles of a printed model that carry more than `DOMINANT` of its gain at 0 Hz, rad/s, slowest first.

    A pole at z = 0 is delay, and one on the negative real axis has no image in the s plane; both are left out.
    """
    system = model.model
    z, vectors = np.linalg.eig(system.A.astype(complex))
    visible = np.abs(z) > 1e-6
    shares = np.zeros(len(z))
    residues = (system.C @ vectors)[0] * np.linalg.solve(vectors, system.B.astype(complex))[:, 0]
    shares[visible] = np.abs(residues[visible] / (1.0 - z[visible])) / abs(system.dc_gain()[0, 0])
    kept = visible & (shares > DOMINANT) & ~((np.abs(z.imag) < 1e-9) & (z.real < 0.0))
    s = np.log(z[kept]) / system.dt
    return s[np.argsort(-s.real)]


def coupled(joints: Sequence[str], servos: Mapping[str, Servo]) -> tuple[np.ndarray, np.ndarray]:
    """Return the linear model of joints with their servos at the operating pose, the RPCM in the end effector.

    M q'' + c q' + G q = T and t dT/dt + T = (kp + G) q_c - kp q - kd q', with G the gradient of the weight, which the
    feedforward holds at the commanded pose, and t the pressure lags.

    Args:
        joints: The n joints; the others stand still.
        servos: Servo of each.

    Returns:
        A (3n, 3n) and B (3n, n) of angles, velocities and servo torques, from commanded angles.
    """
    k = [JOINTS.index(name) for name in joints]
    rigid, pose = controller_model("rpcm"), np.array(POSES[OPERATING_POSE])
    inertia, gravity = rigid.inertia_matrix(pose), rigid.gravity_gradient(pose)[np.ix_(k, k)]
    gains = [servo_gains(float(inertia[i, i]), servos[JOINTS[i]], ACTUATORS[JOINTS[i]]) for i in k]
    kp, kd = np.array(gains).T
    lag, drag = np.array([(ACTUATORS[name].pressure_lag, ACTUATORS[name].drag) for name in joints]).T
    inverse, none, one = np.linalg.inv(inertia[np.ix_(k, k)]), np.zeros((len(k), len(k))), np.eye(len(k))
    A = np.block(
        [
            [none, one, none],
            [-inverse @ gravity, -inverse * drag, inverse],
            [-np.diag(kp / lag), -np.diag(kd / lag), -np.diag(1.0 / lag)],
        ]
    )
    return A, np.vstack([none, none, (np.diag(kp) + gravity) / lag[:, None]])


def solved(plane: Plane) -> dict[str, Servo]:
    """Find the servos of a plane.

    Least squares over the characteristic polynomial at the dominant poles, relative to its value at 0, which is zero
    where they are poles of the arm, and, at `RESPONSE_WEIGHT`, over the errors of the responses at `FREQUENCIES`, each
    relative to its own gain at 0 Hz, with the delays of bus and sample and hold.

    Args:
        plane: The joints and what is to be found.

    Returns:
        The servo of each joint of the plane.

    Raises:
        ScenarioError: The search does not converge.
    """
    targets = [model for model in TARGETS if model.joint in plane.joints]
    poles = np.concatenate([dominant_poles(model) for model in targets])
    w = 2.0 * np.pi * FREQUENCIES
    wanted = [(m.joint, m.model.frequency_response(FREQUENCIES)[:, 0, 0] / m.model.dc_gain()[0, 0]) for m in targets]

    def errors(logarithms: np.ndarray) -> np.ndarray:
        A, B = coupled(plane.joints, _servos(plane, -np.exp(logarithms)))
        found = np.linalg.eigvals(A)
        misses = [np.prod(1.0 - pole / found) for pole in poles]
        answers = np.linalg.solve(1j * w[:, None, None] * np.eye(len(A)) - A, B)
        for joint, goal in wanted:
            i = plane.joints.index(joint)
            late = np.exp(-1j * w * SAMPLE_TIME * (BUS[joint].delay + 0.5))
            misses.extend(RESPONSE_WEIGHT * (answers[:, i, i] * late - goal))
        return np.array(misses, dtype=complex).view(float)

    start = np.log(-np.array(plane.start))
    found = least_squares(errors, start, method="lm", diff_step=1e-6, xtol=1e-10, ftol=1e-10, gtol=1e-10)
    if not found.success:
        raise ScenarioError(f"the servo poles of {', '.join(plane.joints)} were not found: {found.message}")
    return _servos(plane, -np.exp(found.x))


def _servos(plane: Plane, poles: np.ndarray) -> dict[str, Servo]:
    servos = {name: SERVOS[name] for name in plane.joints}
    for (joint, which), pole in zip(plane.unknown, poles.tolist(), strict=True):
        one = servos[joint]
        servos[joint] = replace(one, slow_pole=pole) if which == "slow_pole" else replace(one, fast_pole=pole)
    return servos


if __name__ == "__main__":
    for plane in (YAW_PLANE, PITCH_PLANE):
        for name, servo in solved(plane).items():
            sys.stdout.write(f"{name}: {servo.slow_pole:.4g} and {servo.fast_pole:.4g} rad/s\n")
