"""Closed-form kinematics of the arm behind its indexed shoulder roll, at a prescribed tool orientation.

Behind the roll come yaw, three parallel pitches, yaw and roll: the tool's rotation is
`Rz(yaw) Ry(-tilt) Rz(wrist yaw) Rx(wrist roll)` with `tilt = shoulder pitch - elbow pitch + wrist pitch`. Whatever the
first three joints do, the last three can hold the rotation, exactly and without iteration. What is left is an arm of
three joints that positions the wrist centre, in a plane that the yaw turns, at
`x + i z = l0 + l1 exp(i shoulder) + l2 exp(i (shoulder - elbow)) + l3 exp(i tilt)`.

Plain numbers throughout: at this size they are faster than arrays.
"""

from cmath import rect
from math import atan2, cos, hypot, sin, sqrt, tan, tau
from typing import NamedTuple

import numpy as np

from hmtb_twin.controller_model import ControllerModel
from hmtb_twin.errors import TwinError
from hmtb_twin.parameters import JOINTS

AXES = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [1, 0, 0]], dtype=float)
"""Axis of each joint at zero angles, in the frame of the tool."""

TOLERANCE = 1e-9
"""How exactly an arm must have the structure of this module, m and rad."""

Vector = tuple[float, float, float]
Rotation = list[list[float]]


class WristAngles(NamedTuple):
    """What holds an orientation at a yaw angle, rad."""

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

    @property
    def wrist_rates(self) -> Vector:
        """How tilt, wrist yaw and wrist roll follow the yaw while the orientation is held, rad/rad."""
        tilt, yaw, _ = self.wrist
        return -sin(tilt) * tan(yaw), -cos(tilt), -sin(tilt) / cos(yaw)

    def resolved(self) -> tuple[float, Vector]:
        """Return how rigidly the joints hold the tool, and the step that takes the error away, the orientation held.

        The rigidity is `1 / ||rates @ inv(jacobian)||`, m/rad, by the Frobenius norm: a motion of the tool of this
        length turns the joints by at most 1 rad, in the worst direction. It bounds the smallest singular value of the
        tool's motion over unit joint motion from below, within sqrt(3), and is zero at singular poses.

        Returns:
            Rigidity in m/rad, and the changes of yaw, shoulder and elbow in rad; zero where the pose is singular.
        """
        tilt_rate, wrist_yaw_rate, wrist_roll_rate = self.wrist_rates
        radius = self.radius
        # Columns of the arm's plane: a rotation by the angle turns i times the vector; the elbow turns the other way.
        a, b = -self.upper_arm.imag, self.upper_arm.real
        c, d = self.forearm.imag, -self.forearm.real
        determinant = a * d - b * c
        if determinant == 0.0 or radius == 0.0:
            return 0.0, (0.0, 0.0, 0.0)
        # Joint changes for a unit of error along, upward and across the plane.
        along_shoulder, along_elbow = d / determinant, -b / determinant
        up_shoulder, up_elbow = -c / determinant, a / determinant
        yaw = 1.0 / radius
        along, up = self.hand.imag * tilt_rate * yaw, -self.hand.real * tilt_rate * yaw
        shoulder = along * along_shoulder + up * up_shoulder
        elbow = along * along_elbow + up * up_elbow
        squares = (
            along_shoulder**2
            + along_elbow**2
            + (along_elbow - along_shoulder) ** 2
            + up_shoulder**2
            + up_elbow**2
            + (up_elbow - up_shoulder) ** 2
            + yaw**2 * (1.0 + wrist_yaw_rate**2 + wrist_roll_rate**2)
            + shoulder**2
            + elbow**2
            + (tilt_rate * yaw - shoulder + elbow) ** 2
        )
        x, y, z = self.error
        change = (
            y * yaw,
            x * along_shoulder + z * up_shoulder + y * shoulder,
            x * along_elbow + z * up_elbow + y * elbow,
        )
        return 1.0 / sqrt(squares), change

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
        ]
        if max(misplaced) > TOLERANCE:
            raise TwinError(
                "the controller's model has other axes than roll x, yaw z, pitch -y, pitch y, pitch -y, yaw z, roll x "
                "at zero angles, with both yaw axes and the wrist roll in one plane: no closed form holds its tool"
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

    @property
    def reach(self) -> float:
        """Distance of the last pitch axis from the shoulder pitch axis with a straight elbow, m."""
        return abs(self._lengths[1]) + abs(self._lengths[2])

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
        (r00, r01, r02), (r10, r11, r12), (r20, _, _) = rotation
        c, s = cos(yaw), sin(yaw)
        forward = c * r00 + s * r10
        wrist = WristAngles(
            _near(atan2(r20, forward), near.tilt),
            atan2(c * r10 - s * r00, hypot(forward, r20)),
            _near(atan2(s * r02 - c * r12, c * r11 - s * r01), near.roll),
        )
        base, upper_arm, forearm, hand = self._lengths
        upper_arm *= rect(1.0, shoulder)
        forearm *= rect(1.0, shoulder - elbow)
        hand *= rect(1.0, wrist.tilt)
        reached = base + upper_arm + forearm + hand
        x, y, z = centre
        error = (c * x + s * y - reached.real, c * y - s * x, z - reached.imag)
        return Posture(yaw, shoulder, elbow, wrist, reached.real, upper_arm + forearm, forearm, hand, error)


def _near(angle: float, reference: float) -> float:
    """Return the angle plus the whole turns that bring it nearest to a reference."""
    return angle + tau * round((reference - angle) / tau)
