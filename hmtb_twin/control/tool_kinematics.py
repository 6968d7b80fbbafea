"""Closed-form kinematics of the arm behind its indexed shoulder roll, at a prescribed tool orientation.

Behind the roll come yaw, three parallel pitches, yaw and roll: the tool's rotation is
`Rz(yaw) Ry(-tilt) Rz(wrist yaw) Rx(wrist roll)` with `tilt = shoulder pitch - elbow pitch + wrist pitch`. Whatever the
first three joints do, the last three can hold the rotation, exactly and without iteration. What is left is an arm of
three joints that positions the wrist centre, in a plane that the yaw turns, at
`x + i z = l0 + l1 exp(i shoulder) + l2 exp(i (shoulder - elbow)) + l3 exp(i tilt)`.

Plain numbers throughout: at this size they are faster than arrays.
"""

from cmath import phase, rect
from math import acos, atan2, cos, hypot, sin, sqrt, tau
from typing import NamedTuple

import numpy as np

from hmtb_twin.arm.controller_model import ControllerModel
from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.values import JOINTS

AXES = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [1, 0, 0]], dtype=float)
"""Axis of each joint at zero angles, in the frame of the tool."""

TOLERANCE = 1e-9
"""How exactly an arm must have the structure of this module, m and rad."""

Vector = tuple[float, float, float]
Rotation = list[list[float]]


class WristAngles(NamedTuple):
    """Wrist angles that hold the orientation of the tool at a yaw angle of the arm, rad."""

    tilt: float
    yaw: float
    roll: float


class Posture(NamedTuple):
    """The arm at some yaw, shoulder and elbow with the tool at a prescribed orientation.

    Attributes:
        yaw: Shoulder yaw, rad.
        shoulder: Shoulder pitch, rad.
        elbow: Elbow pitch, rad.
        wrist: Tilt, wrist yaw and wrist roll that give the orientation, rad.
        wrist_rates: How these follow the yaw while the orientation is held, rad/rad.
        radius: Distance of the wrist centre from the yaw axis, in the arm's plane, m.
        upper_arm: What the shoulder moves, from its axis to the last pitch axis, `x + i z`, m.
        forearm: What the elbow moves, m.
        hand: What the tilt moves, m.
        error: From the wrist centre to where it is wanted, along the arm's plane, across it and upward, m.
    """

    yaw: float
    shoulder: float
    elbow: float
    wrist: WristAngles
    wrist_rates: Vector
    radius: float
    upper_arm: complex
    forearm: complex
    hand: complex
    error: Vector

    @property
    def angles(self) -> tuple[float, float, float, float, float, float]:
        """Angles of the six joints behind the shoulder roll, rad."""
        wrist = self.wrist
        return self.yaw, self.shoulder, self.elbow, wrist.tilt - self.shoulder + self.elbow, wrist.yaw, wrist.roll

    def _inverse(self) -> tuple[float, float, float, float, float, float, float] | None:
        """Return the inverse of the Jacobian, less its zeros; None where it has none.

        Shoulder and elbow for unit error along, the same upward, and yaw, shoulder and elbow for unit error across.
        """
        determinant = (self.upper_arm * self.forearm.conjugate()).imag
        if determinant == 0.0 or self.radius == 0.0:
            return None
        along_shoulder, along_elbow = -self.forearm.real / determinant, -self.upper_arm.real / determinant
        up_shoulder, up_elbow = -self.forearm.imag / determinant, -self.upper_arm.imag / determinant
        yaw = 1.0 / self.radius
        # Yaw tilts the hand along with it; shoulder and elbow make up for that.
        lag = -1j * self.wrist_rates[0] * yaw * self.hand
        shoulder = lag.real * along_shoulder + lag.imag * up_shoulder
        elbow = lag.real * along_elbow + lag.imag * up_elbow
        return along_shoulder, along_elbow, up_shoulder, up_elbow, yaw, shoulder, elbow

    @property
    def rigidity(self) -> float:
        """How much motion of the tool turns the joints by 1 rad, in the worst direction, m/rad; zero at singular poses.

        `1 / ||rates @ inv(jacobian)||` by the Frobenius norm: the smallest singular value of the tool's motion over
        unit joint motion is not smaller, and at most sqrt(3) times larger.
        """
        inverse = self._inverse()
        if inverse is None:
            return 0.0
        along_shoulder, along_elbow, up_shoulder, up_elbow, yaw, shoulder, elbow = inverse
        tilt_rate, wrist_yaw_rate, wrist_roll_rate = self.wrist_rates
        along_pitch, up_pitch = along_elbow - along_shoulder, up_elbow - up_shoulder
        pitch = tilt_rate * yaw - shoulder + elbow
        square = along_shoulder * along_shoulder + along_elbow * along_elbow + along_pitch * along_pitch
        square += up_shoulder * up_shoulder + up_elbow * up_elbow + up_pitch * up_pitch
        square += yaw * yaw * (1.0 + wrist_yaw_rate * wrist_yaw_rate + wrist_roll_rate * wrist_roll_rate)
        return 1.0 / sqrt(square + shoulder * shoulder + elbow * elbow + pitch * pitch)

    def resolved(self) -> Vector:
        """Return the changes of yaw, shoulder and elbow that take the error away to first order, rad.

        Zero where the pose is singular.
        """
        inverse = self._inverse()
        if inverse is None:
            return 0.0, 0.0, 0.0
        along_shoulder, along_elbow, up_shoulder, up_elbow, yaw, shoulder, elbow = inverse
        x, y, z = self.error
        return (
            y * yaw,
            x * along_shoulder + z * up_shoulder + y * shoulder,
            x * along_elbow + z * up_elbow + y * elbow,
        )

    def moved(self, change: Vector) -> tuple[float, float, float, float, float, float]:
        """Return the six angles after changes of yaw, shoulder and elbow, the wrist following to first order, rad."""
        tilt_rate, wrist_yaw_rate, wrist_roll_rate = self.wrist_rates
        yaw, shoulder, elbow = change
        angles = self.angles
        return (
            angles[0] + yaw,
            angles[1] + shoulder,
            angles[2] + elbow,
            angles[3] + tilt_rate * yaw - shoulder + elbow,
            angles[4] + wrist_yaw_rate * yaw,
            angles[5] + wrist_roll_rate * yaw,
        )

    def jacobian(self, bend: float = 0.0) -> np.ndarray:
        """Return how the wrist centre moves with yaw, shoulder and elbow while the orientation is held.

        Args:
            bend: A straighter elbow is taken to be bent by this much, rad.

        Returns:
            Jacobian (3, 3), m/rad: rows along the arm's plane, across it and upward.
        """
        upper_arm, forearm = self.upper_arm, self.forearm
        if self.elbow < bend:
            forearm *= rect(1.0, self.elbow - bend)
            upper_arm += forearm - self.forearm
        tilt_rate = self.wrist_rates[0]
        columns = 1j * tilt_rate * self.hand, 1j * upper_arm, -1j * forearm
        return np.array([[c.real for c in columns], [self.radius, 0.0, 0.0], [c.imag for c in columns]])

    def rates(self) -> np.ndarray:
        """Return how the six joints, and the radius, move with yaw, shoulder and elbow: (7, 3), rad/rad and m/rad."""
        tilt_rate, wrist_yaw_rate, wrist_roll_rate = self.wrist_rates
        return np.array(
            [
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, 0.0, 1.0],
                [tilt_rate, -1.0, 1.0],
                [wrist_yaw_rate, 0.0, 0.0],
                [wrist_roll_rate, 0.0, 0.0],
                [-self.hand.imag * tilt_rate, -self.upper_arm.imag, self.forearm.imag],
            ]
        )


class ToolKinematics:
    """The arm's lengths, and where its tool is.

    Args:
        controller: The controller's own model, from which the lengths are read.

    Raises:
        TwinError: The model's axes are not arranged as this module assumes.
    """

    def __init__(self, controller: ControllerModel) -> None:
        position, rotation = controller.tool_pose(np.zeros(len(JOINTS)))
        jacobian = controller.tool_jacobian(np.zeros(len(JOINTS)))
        # The point of each axis nearest to the tool, as a vector to the tool: p = v x w.
        roll, yaw, shoulder, elbow, pitch, wrist, tool = np.cross(jacobian[:3].T, jacobian[3:].T)
        misplaced = [
            np.abs(rotation - np.eye(3)).max(),
            np.abs(jacobian[3:].T - AXES).max(),
            abs(yaw[1] - wrist[1]),
            abs(wrist[1] - tool[1]),
            abs(np.cross(shoulder - elbow, elbow - pitch)[1]),
        ]
        if max(misplaced) > TOLERANCE:
            raise TwinError(
                "the controller's model has other axes than roll x, yaw z, pitch -y, pitch y, pitch -y, yaw z, roll x "
                "at zero angles, both yaw axes and the wrist roll in one plane, the elbow straight at zero"
            )
        # Height along a yaw axis, and the place along a roll axis, are free: take the wrist roll's and the yaw's.
        self._centre_to_tool = (float(wrist[0]), float(wrist[1]), float(tool[2]))
        self._origin = tuple(float(x) for x in position - (yaw[0], roll[1], roll[2]))
        self._across = float(roll[1] - yaw[1])
        self._lengths = (
            complex(yaw[0] - shoulder[0], roll[2] - shoulder[2]),
            complex(shoulder[0] - elbow[0], shoulder[2] - elbow[2]),
            complex(elbow[0] - pitch[0], elbow[2] - pitch[2]),
            complex(pitch[0] - wrist[0], pitch[2] - tool[2]),
        )
        upper_arm, forearm = abs(self._lengths[1]), abs(self._lengths[2])
        self._squares, self._product = upper_arm**2 + forearm**2, 2.0 * upper_arm * forearm

    def radius(self, shoulder: float, elbow: float, tilt: float) -> float:
        """Return the distance of the wrist centre from the yaw axis, in the arm's plane, m, at three angles in rad."""
        base, upper_arm, forearm, hand = self._lengths
        reached = (
            base + upper_arm * rect(1.0, shoulder) + forearm * rect(1.0, shoulder - elbow) + hand * rect(1.0, tilt)
        )
        return reached.real

    def wanted(self, roll: float, position: list[float], rotation: Rotation) -> tuple[Vector, Rotation]:
        """Return a tool pose as its wrist centre and rotation, both seen from behind the shoulder roll.

        Args:
            roll: Angle of the shoulder roll, rad.
            position: Position of the tool, three numbers, m.
            rotation: Rotation of the tool, three rows of three.

        Returns:
            Wrist centre in the frame that the shoulder roll turns, m, and the rotation in the same frame.
        """
        u, v, w = self._centre_to_tool
        x, y, z = (
            p - o - (row[0] * u + row[1] * v + row[2] * w)
            for p, o, row in zip(position, self._origin, rotation, strict=True)
        )
        if roll:
            c, s = cos(roll), sin(roll)
            first, second, third = rotation
            rotation = [
                first,
                [c * m + s * n for m, n in zip(second, third, strict=True)],
                [c * n - s * m for m, n in zip(second, third, strict=True)],
            ]
            y, z = c * y + s * z, c * z - s * y
        return (x, y - self._across, z), rotation

    def posture(
        self, yaw: float, shoulder: float, elbow: float, centre: Vector, rotation: Rotation, near: WristAngles
    ) -> Posture:
        """Return the arm at three angles, the tool oriented as wanted, and how far its wrist centre is from there.

        Args:
            yaw: Shoulder yaw, rad.
            shoulder: Shoulder pitch, rad.
            elbow: Elbow pitch, rad.
            centre: Wanted wrist centre behind the shoulder roll, m.
            rotation: Wanted rotation behind the shoulder roll.
            near: Tilt and wrist roll are given within half a turn of these.
        """
        wrist, rates, tilted = _wrist(yaw, rotation, near)
        base, upper_arm, forearm, hand = self._lengths
        upper_arm *= rect(1.0, shoulder)
        forearm *= rect(1.0, shoulder - elbow)
        hand *= tilted
        reached = base + upper_arm + forearm + hand
        x, y, z = centre
        c, s = cos(yaw), sin(yaw)
        error = (c * x + s * y - reached.real, c * y - s * x, z - reached.imag)
        return Posture(yaw, shoulder, elbow, wrist, rates, reached.real, upper_arm + forearm, forearm, hand, error)

    def reaching(self, centre: Vector, rotation: Rotation, near: WristAngles, side: float = 1.0) -> Posture | None:
        """Return the arm with its tool where and as wanted, its elbow bent the usual way.

        Args:
            centre: Wanted wrist centre behind the shoulder roll, m.
            rotation: Wanted rotation behind the shoulder roll.
            near: Tilt and wrist roll are given within half a turn of these.
            side: Negative for the wrist centre on the far side of the yaw axis.

        Returns:
            The posture; None where no elbow angle reaches.
        """
        x, y, z = centre
        radius, yaw = (hypot(x, y), atan2(y, x)) if side >= 0.0 else (-hypot(x, y), atan2(-y, -x))
        wrist, rates, tilted = _wrist(yaw, rotation, near)
        base, upper_arm, forearm, hand = self._lengths
        hand *= tilted
        span = complex(radius, z) - base - hand
        cosine = (span.real**2 + span.imag**2 - self._squares) / self._product
        if not -1.0 <= cosine <= 1.0:
            return None
        elbow = acos(cosine)
        shoulder = phase(span / (upper_arm + forearm * rect(1.0, -elbow)))
        forearm *= rect(1.0, shoulder - elbow)
        return Posture(yaw, shoulder, elbow, wrist, rates, radius, span, forearm, hand, (0.0, 0.0, 0.0))


def _wrist(yaw: float, rotation: Rotation, near: WristAngles) -> tuple[WristAngles, Vector, complex]:
    """Return the wrist that holds a rotation at a yaw angle, how its angles follow the yaw, and `exp(i tilt)`.

    Solves `Rz(-yaw) @ rotation = Ry(-tilt) @ Rz(wrist yaw) @ Rx(wrist roll)`.
    """
    (r00, r01, r02), (r10, r11, r12), (r20, _, _) = rotation
    c, s = cos(yaw), sin(yaw)
    forward, aside = c * r00 + s * r10, c * r10 - s * r00
    cosine = hypot(forward, r20)
    angles = WristAngles(
        _near(atan2(r20, forward), near.tilt),
        atan2(aside, cosine),
        _near(atan2(s * r02 - c * r12, c * r11 - s * r01), near.roll),
    )
    # At its quarter turn the wrist yaw leaves tilt and wrist roll free; next to it they follow the yaw without bounds.
    cosine = max(cosine, TOLERANCE)
    tilted = complex(forward, r20) / cosine
    rates = (-tilted.imag * aside / cosine, -tilted.real, -tilted.imag / cosine)
    return angles, rates, tilted


def _near(angle: float, reference: float) -> float:
    """Return the angle plus the whole turns that bring it nearest to a reference."""
    return angle + tau * round((reference - angle) / tau)
