"""The servo poles of the variant `published`, and how close the arm then comes to each printed model.

Each servo places the poles of its joint as if the neighbours stood still; in the arm they move, and the poles with
them. The wanted poles are therefore solved for on the coupled rigid arm with its pressure lags, which is linear in
closed form at a pose. `python -m docs.images.published_servos` prints the poles and the tables of
docs/measured/published-poles.md.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from hmtb_twin import JointTruth, Truth, linearize, load_arm
from hmtb_twin.arm.controller_model import controller_model
from hmtb_twin.parameters.servo_gains import torque_gains
from hmtb_twin.parameters.values import SAMPLE_TIME, Servo
from hmtb_twin.parameters.variants import ACTUATORS, BUS, JOINTS, OPERATING_POSE, POSES, SERVOS
from scenarios.files.errors import ScenarioError
from scenarios.truth.published import EQUATIONS, PUBLISHED, PublishedModel
from sysid import StateSpace

TARGETS = tuple(EQUATIONS[name] for name in ("4.7", "4.10", "4.12"))
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
    gains = [torque_gains(float(inertia[i, i]), servos[JOINTS[i]], ACTUATORS[JOINTS[i]]) for i in k]
    kp, kd = np.array([(own.kp, own.kd) for own in gains]).T
    drag = np.array([ACTUATORS[name].drag for name in joints])
    lag = np.array([min(servos[name].torque_lag, ACTUATORS[name].motor.lag) for name in joints])
    inverse, none, one = np.linalg.inv(inertia[np.ix_(k, k)]), np.zeros((len(k), len(k))), np.eye(len(k))
    A = np.block(
        [
            [none, one, none],
            [-inverse @ gravity, -inverse * drag, inverse],
            [-np.diag(kp / lag), -np.diag(kd / lag), -np.diag(1.0 / lag)],
        ]
    )
    return A, np.vstack([none, none, (np.diag(kp) + gravity) / lag[:, None]])


def solved_servos(plane: Plane) -> dict[str, Servo]:
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
        eigenvalues = np.linalg.eigvals(A)
        misses = [np.prod(1.0 - pole / eigenvalues) for pole in poles]
        answers = np.linalg.solve(1j * w[:, None, None] * np.eye(len(A)) - A, B)
        for joint, goal in wanted:
            i = plane.joints.index(joint)
            late = np.exp(-1j * w * SAMPLE_TIME * (BUS[joint].delay + 0.5))
            misses.extend(RESPONSE_WEIGHT * (answers[:, i, i] * late - goal))
        return np.array(misses, dtype=complex).view(float)

    start = np.log(-np.array(plane.start))
    solution = least_squares(errors, start, method="lm", diff_step=1e-6, xtol=1e-10, ftol=1e-10, gtol=1e-10)
    if not solution.success:
        raise ScenarioError(f"the servo poles of {', '.join(plane.joints)} were not found: {solution.message}")
    return _servos(plane, -np.exp(solution.x))


def _servos(plane: Plane, poles: np.ndarray) -> dict[str, Servo]:
    servos = {name: SERVOS[name] for name in plane.joints}
    for (joint, which), pole in zip(plane.unknown, poles.tolist(), strict=True):
        one = servos[joint]
        servos[joint] = replace(one, slow_pole=pole) if which == "slow_pole" else replace(one, fast_pole=pole)
    return servos


@dataclass(frozen=True)
class PoleMatch:
    """A printed pole and the arm's nearest.

    Attributes:
        printed: The printed pole in the z plane.
        share: Part of the printed gain at 0 Hz that it carries.
        nearest: The arm's nearest pole in the s plane, rad/s.
        nearest_share: Part of the arm's gain at 0 Hz that it carries.
        error: Distance over the printed pole's modulus, both in the s plane.
    """

    printed: complex
    share: float
    nearest: complex
    nearest_share: float
    error: float

    @property
    def natural(self) -> complex:
        """The printed pole in the s plane, rad/s."""
        return complex(50.0 * np.log(self.printed))


@dataclass(frozen=True)
class Closeness:
    """A printed model beside the truth about its joint.

    Attributes:
        printed: The printed model.
        truth: The truth.
        poles: Its poles, slowest first; those at z = 0, which are delay, left out.
        response_error: Largest difference of the responses from 0.05 to 5 Hz, each relative to its own gain at 0 Hz.
    """

    printed: PublishedModel
    truth: JointTruth
    poles: tuple[PoleMatch, ...]
    response_error: float


def closeness(truth: Truth) -> tuple[Closeness, ...]:
    """Compare an arm with every printed model.

    Args:
        truth: Its truth.

    Returns:
        One comparison for each printed model.
    """
    return tuple(_closeness(model, truth.joint(model.joint)) for model in PUBLISHED)


def _closeness(printed: PublishedModel, truth: JointTruth) -> Closeness:
    return Closeness(
        printed,
        truth,
        tuple(_matches(printed.model, truth)),
        float(np.abs(_relative(printed.model) - _relative(truth.model)).max()),
    )


def _relative(model: StateSpace) -> np.ndarray:
    return model.frequency_response(FREQUENCIES)[:, 0, 0] / model.dc_gain()[0, 0]


def _matches(model: StateSpace, truth: JointTruth) -> Iterator[PoleMatch]:
    z, shares = _shares(model)
    arm, arm_shares = _shares(truth.model)
    arm_poles = truth.natural_poles
    for i in np.argsort(-np.abs(z)):
        if abs(z[i]) > 1e-6:
            natural = np.log(z[i]) / model.dt
            nearest = int(np.argmin(np.abs(arm_poles - natural)))
            error = float(abs(arm_poles[nearest] / natural - 1.0))
            own = float(arm_shares[np.argmin(np.abs(arm - np.exp(arm_poles[nearest] * model.dt)))])
            yield PoleMatch(complex(z[i]), float(shares[i]), complex(arm_poles[nearest]), own, error)


def _shares(model: StateSpace) -> tuple[np.ndarray, np.ndarray]:
    """Poles in the z plane, and the part of the gain at 0 Hz that each carries."""
    z, vectors = np.linalg.eig(model.A.astype(complex))
    residues = (model.C @ vectors)[0] * np.linalg.solve(vectors, model.B.astype(complex))[:, 0]
    return z, np.abs(residues / (1.0 - z)) / abs(model.dc_gain()[0, 0])


def tables(truth: Truth) -> str:
    """Write the closeness of an arm to every printed model as two Markdown tables."""
    compared = closeness(truth)
    lines = [
        "| joint | printed model | bandwidth: printed, arm | DC gain: printed, arm | nk: printed, arm | response |",
        "|---|---|---:|---:|---:|---:|",
    ]
    for entry in compared:
        lines.append(
            f"| {_joint(entry)} | {_label(entry)} "
            f"| {entry.printed.bandwidth_hz:.3f}, {entry.truth.bandwidth_hz:.3f} Hz "
            f"| {entry.printed.model.dc_gain()[0, 0]:.2f}, {entry.truth.dc_gain:.2f} "
            f"| {_delay(entry.printed.model)}, {entry.truth.delay_samples} | {entry.response_error:.3f} |"
        )
    lines += [
        "",
        "| joint | printed model | pole, z | pole, rad/s | part of the DC gain "
        "| arm's nearest, rad/s | off by | part of the arm's |",
        "|---|---|---:|---:|---:|---:|---:|---:|",
    ]
    for entry in compared:
        for pole in entry.poles:
            if pole.printed.imag < -1e-9:
                continue
            # A negative real pole is the image of no pole that an arm without delay could have.
            natural, nearest = "none", "none | |"
            if pole.printed.real > 0.0:
                natural = _complex(pole.natural, 2)
                nearest = f"{_complex(pole.nearest, 2)} | {100 * pole.error:.1f} % | {100 * pole.nearest_share:.1f} %"
            lines.append(
                f"| {_joint(entry)} | {_label(entry)} | {_complex(pole.printed, 3)} | {natural} "
                f"| {100 * pole.share:.1f} % | {nearest} |"
            )
    return "\n".join(lines) + "\n"


def _joint(entry: Closeness) -> str:
    return entry.printed.joint.replace("_", " ")


def _label(entry: Closeness) -> str:
    return f"**{entry.printed.label}**" if entry.printed in TARGETS else entry.printed.label


def _delay(model: StateSpace) -> int:
    return int(np.flatnonzero(model.markov(5)[:, 0, 0])[0])


def _complex(value: complex, digits: int) -> str:
    if abs(value.imag) < 1e-9:
        return f"{value.real:.{digits}f}"
    return f"{value.real:.{digits}f} ± {abs(value.imag):.{digits}f}j"


if __name__ == "__main__":
    for plane in (YAW_PLANE, PITCH_PLANE):
        for name, servo in solved_servos(plane).items():
            sys.stderr.write(f"{name}: {servo.slow_pole:.4g} and {servo.fast_pole:.4g} rad/s\n")
    sys.stdout.write("\n" + tables(linearize(load_arm("published"))))
