"""Small-signal dynamics at many operating points, in few numbers each."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from hmtb_twin import JOINTS, Arm, OverloadError, Truth, linearize
from hmtb_twin.parameters.values import INDEXED_JOINTS
from scenarios.files.errors import ScenarioError

MOVING = tuple(name for name in JOINTS if name not in INDEXED_JOINTS)
"""Joints that follow a command; the others are pinned."""

COLUMNS = np.array([JOINTS.index(name) for name in MOVING])
"""Their place among the seven."""

CROSS_BAND = 5.0
"""Band over which joints are looked at for moving each other, Hz: that of the experiments' excitation."""

FELT = 0.05
"""A pole that carries more than this part of a joint's gain at 0 Hz counts for its damping."""

FAST = 62.8
"""Poles faster than this, 10 Hz in rad/s, do not count for a joint's damping."""

REFINEMENTS = 40
"""Halvings of the interval that a bandwidth lies in."""

Progress = Callable[[int, int], None]
"""Called with the operating points done and those in all."""


@dataclass(frozen=True, eq=False)
class LocalDynamics:
    """What n linear models say, each at its own operating point; the m columns are the joints of `MOVING`.

    Attributes:
        angles: Operating points (n, 7), rad.
        bandwidth: First frequency at which a joint's gain is 3.01 dB below that at 0 Hz (n, m), Hz; NaN where it never
            is, or where the arm is unstable. Where the drives cannot hold the arm there is no linear model: all but
            the angles is NaN.
        gain: Gain at 0 Hz (n, m).
        damping: Smallest damping ratio among the poles below 10 Hz that a joint feels (n, m): 1 where all are real.
        cross: Largest gain up to 5 Hz from another joint's command (last axis) to a joint's angle, over that joint's
            own gain at 0 Hz (n, m, m); 0 on the diagonal.
        relative_gain: Diagonal of the relative gain array at a joint's own bandwidth (n, m), complex: its response to
            its command over the same with the other joints' angles kept still; 1 without coupling [Bristol1966].
        stable: Whether the drives hold the arm and all poles lie inside the unit circle (n,).
    """

    angles: np.ndarray
    bandwidth: np.ndarray
    gain: np.ndarray
    damping: np.ndarray
    cross: np.ndarray
    relative_gain: np.ndarray
    stable: np.ndarray

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            array = np.array(value)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.angles)

    @property
    def held(self) -> np.ndarray:
        """Whether the drives hold the arm (n,)."""
        return np.asarray(np.isfinite(self.gain).all(axis=1))

    @property
    def interaction(self) -> np.ndarray:
        """Distance of the relative gain from one at each joint's bandwidth (n, m)."""
        return np.abs(self.relative_gain - 1.0)

    def of(self, joint: str) -> np.ndarray:
        """Return the bandwidths (n,) of a joint, Hz."""
        return np.asarray(self.bandwidth[:, MOVING.index(joint)])


def local_dynamics(arm: Arm, poses: np.ndarray, progress: Progress | None = None) -> LocalDynamics:
    """Linearise an arm at many poses.

    Args:
        arm: The arm.
        poses: Joint angles (n, 7), rad.
        progress: Called now and then.

    Returns:
        What the linear models say.

    Raises:
        ScenarioError: No pose.
        TwinError: A pose is not seven finite angles within the joints' ranges.
    """
    if not len(poses):
        raise ScenarioError("no pose given, expected one or more")
    parts = []
    for done, pose in enumerate(poses):
        parts.append(dynamics_at(arm, pose))
        if progress is not None and (done % 20 == 19 or done == len(poses) - 1):
            progress(done + 1, len(poses))
    return together(parts)


def dynamics_at(arm: Arm, pose: np.ndarray) -> LocalDynamics:
    """Linearise an arm at one pose (7,), rad; where its drives cannot hold it, the record is a gap.

    Raises:
        TwinError: The pose is not seven finite angles within the joints' ranges.
    """
    try:
        return described(linearize(arm, pose, amplitudes=()))
    except OverloadError:
        joints = len(MOVING)
        return LocalDynamics(
            angles=np.array(pose, dtype=float)[None],
            bandwidth=np.full((1, joints), np.nan),
            gain=np.full((1, joints), np.nan),
            damping=np.full((1, joints), np.nan),
            cross=np.full((1, joints, joints), np.nan),
            relative_gain=np.full((1, joints), np.nan, dtype=complex),
            stable=np.array([False]),
        )


def together(parts: Iterable[LocalDynamics]) -> LocalDynamics:
    """Put records one after another."""
    parts = list(parts)
    return replace(parts[0], **{name: np.concatenate([vars(part)[name] for part in parts]) for name in vars(parts[0])})


def described(truth: Truth) -> LocalDynamics:
    """Return what one linear model says, as a record of one operating point."""
    model = truth.model
    frequencies = np.unique(np.concatenate([np.geomspace(0.02, 0.999 * 0.5 / model.dt, 50), [CROSS_BAND]]))
    response = _moving(truth, np.concatenate([[0.0], frequencies]))
    still, swept = response[0], response[1:]
    gain = np.diagonal(still).real
    own = np.abs(np.diagonal(swept, axis1=1, axis2=2))
    z, vectors = np.linalg.eig(model.A)
    stable = bool(np.abs(z).max() < 1.0)
    bandwidth = _bandwidth(truth, frequencies, own / gain) if stable else np.full(len(MOVING), np.nan)
    cross = np.abs(swept[frequencies <= CROSS_BAND]).max(axis=0) / np.abs(gain)[:, None]
    return LocalDynamics(
        angles=truth.angles[None],
        bandwidth=bandwidth[None],
        gain=gain[None],
        damping=_damping(truth, z, vectors, gain)[None],
        cross=np.where(np.eye(len(MOVING), dtype=bool), 0.0, cross)[None],
        relative_gain=_relative_gain(truth, bandwidth)[None],
        stable=np.array([stable]),
    )


def _moving(truth: Truth, frequencies: np.ndarray) -> np.ndarray:
    return np.asarray(truth.model.frequency_response(frequencies)[:, COLUMNS[:, None], COLUMNS])


def _bandwidth(truth: Truth, frequencies: np.ndarray, relative: np.ndarray) -> np.ndarray:
    """Bisect, for all joints at once, the interval of the grid in which each gain first falls to half power."""
    below = relative < np.sqrt(0.5)
    first = np.argmax(below, axis=0)
    found = below.any(axis=0) & (first > 0)
    low, high = frequencies[np.maximum(first - 1, 0)], frequencies[first]
    joints = np.arange(len(MOVING))
    # |G|^2 is close to a straight line in log-log over so short an interval: the secant converges in a few steps.
    target = np.log(np.sqrt(0.5))
    at_low, at_high = np.log(relative[first - 1, joints]), np.log(relative[first, joints])
    still = np.abs(np.diagonal(_moving(truth, np.zeros(1))[0]))
    for _ in range(REFINEMENTS):
        guess = np.exp(np.log(low) + (target - at_low) / (at_high - at_low) * np.log(high / low))
        at_guess = np.log(np.abs(_moving(truth, guess)[joints, joints, joints]) / still)
        falls = at_guess < target
        low, at_low = np.where(falls, low, guess), np.where(falls, at_low, at_guess)
        high, at_high = np.where(falls, guess, high), np.where(falls, at_guess, at_high)
        if np.abs(at_guess - target)[found].max(initial=0.0) < 1e-9:
            break
    return np.where(found, guess, np.nan)


def _damping(truth: Truth, z: np.ndarray, vectors: np.ndarray, gain: np.ndarray) -> np.ndarray:
    model = truth.model
    moving = np.abs(z) > 1e-6
    s = np.zeros(len(z), dtype=complex)
    s[moving] = np.log(z[moving].astype(complex)) / model.dt
    slow = moving & (np.abs(s) < FAST)
    weights = np.linalg.lstsq(vectors, model.B[:, COLUMNS].astype(complex), rcond=None)[0]
    seen = model.C[COLUMNS] @ vectors
    share = np.abs(seen[:, slow] * weights[slow].T / (1.0 - z[slow])) / np.abs(gain)[:, None]
    ratio = np.where(np.abs(s[slow].imag) < 1e-6, 1.0, -s[slow].real / np.abs(s[slow]))
    return np.where(share > FELT, ratio, 1.0).min(axis=1, initial=1.0)


def _relative_gain(truth: Truth, bandwidth: np.ndarray) -> np.ndarray:
    out = np.full(len(MOVING), np.nan, dtype=complex)
    known = np.flatnonzero(np.isfinite(bandwidth))
    if len(known):
        response = _moving(truth, bandwidth[known])
        out[known] = (
            response[np.arange(len(known)), known, known] * np.linalg.inv(response)[np.arange(len(known)), known, known]
        )
    return out
