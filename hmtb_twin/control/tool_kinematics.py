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
from hmtb_twin.parameters.variants import JOINTS

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
        # Upper arm and forearm in line, or the wrist centre on the yaw axis.
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
        # By joint for unit error along, upward and across, each column's squares added up.
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
        along, across, up = self.error
        shoulder_change = along * along_shoulder + up * up_shoulder + across * shoulder
        elbow_change = along * along_elbow + up * up_elbow + across * elbow
        return across * yaw, shoulder_change, elbow_change

    def angles_after(self, change: Vector) -> tuple[float, float, float, float, float, float]:
        """Return the six angles after changes of yaw, shoulder and elbow, the wrist following to first order, rad."""
        tilt_rate, wrist_yaw_rate, wrist_roll_rate = self.wrist_rates
        yaw, shoulder, elbow = change
        angles = self.angles
        # The tilt, shoulder - elbow + pitch, follows the yaw alone.
        pitch = angles[3] + tilt_rate * yaw - shoulder + elbow
        wrist_yaw, wrist_roll = angles[4] + wrist_yaw_rate * yaw, angles[5] + wrist_roll_rate * yaw
        return angles[0] + yaw, angles[1] + shoulder, angles[2] + elbow, pitch, wrist_yaw, wrist_roll

    def jacobian(self, bend: float = 0.0) -> np.ndarray:
        """Return how the wrist centre moves with yaw, shoulder and elbow while the orientation is held.

        Args:
            bend: A straighter elbow is taken to be bent by this much, rad.

        Returns:
            Jacobian (3, 3), m/rad: rows along the arm's plane, across it and upward.
        """
        upper_arm, forearm = self.upper_arm, self.forearm
        if self.elbow < bend:
            # Only the forearm turns: what the shoulder moves changes with it.
            forearm *= rect(1.0, self.elbow - bend)
            upper_arm += forearm - self.forearm
        tilt_rate = self.wrist_rates[0]
        # A turn in the plane moves a point at right angles to its arm: times i.
        columns = 1j * tilt_rate * self.hand, 1j * upper_arm, -1j * forearm
        along = [column.real for column in columns]
        up = [column.imag for column in columns]
        return np.array([along, [self.radius, 0.0, 0.0], up])

    def rates(self) -> np.ndarray:
        """Return how the six joints, and the radius, move with yaw, shoulder and elbow: (7, 3), rad/rad and m/rad."""
        tilt_rate, wrist_yaw_rate, wrist_roll_rate = self.wrist_rates
        yaw, shoulder, elbow = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]
        pitch = [tilt_rate, -1.0, 1.0]
        wrist_yaw, wrist_roll = [wrist_yaw_rate, 0.0, 0.0], [wrist_roll_rate, 0.0, 0.0]
        radius = [-self.hand.imag * tilt_rate, -self.upper_arm.imag, self.forearm.imag]
        return np.array([yaw, shoulder, elbow, pitch, wrist_yaw, wrist_roll, radius])


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
        turned = max(np.abs(rotation - np.eye(3)).max(), np.abs(jacobian[3:].T - AXES).max())
        out_of_plane = max(abs(yaw[1] - wrist[1]), abs(wrist[1] - tool[1]))
        elbow_bent = abs(np.cross(shoulder - elbow, elbow - pitch)[1])
        if max(turned, out_of_plane, elbow_bent) > TOLERANCE:
            raise TwinError(
                "the controller's model has other axes than roll x, yaw z, pitch -y, pitch y, pitch -y, yaw z, roll x "
                "at zero angles, both yaw axes and the wrist roll in one plane, the elbow straight at zero"
            )
        # Height along a yaw axis, and the place along a roll axis, are free: take the wrist roll's and the yaw's.
        self._centre_to_tool = (float(wrist[0]), float(wrist[1]), float(tool[2]))
        self._origin = tuple(float(x) for x in position - (yaw[0], roll[1], roll[2]))
        self._across = float(roll[1] - yaw[1])
        base = complex(yaw[0] - shoulder[0], roll[2] - shoulder[2])
        upper_arm = complex(shoulder[0] - elbow[0], shoulder[2] - elbow[2])
        forearm = complex(elbow[0] - pitch[0], elbow[2] - pitch[2])
        hand = complex(pitch[0] - wrist[0], pitch[2] - tool[2])
        self._lengths = (base, upper_arm, forearm, hand)
        # Of the law of cosines, which gives the elbow.
        self._squares = abs(upper_arm) ** 2 + abs(forearm) ** 2
        self._product = 2.0 * abs(upper_arm) * abs(forearm)

    def radius(self, shoulder: float, elbow: float, tilt: float) -> float:
        """Return the distance of the wrist centre from the yaw axis, in the arm's plane, m, at three angles in rad."""
        base, upper_arm, forearm, hand = self._lengths
        reached = base + upper_arm * rect(1.0, shoulder)
        reached += forearm * rect(1.0, shoulder - elbow)
        reached += hand * rect(1.0, tilt)
        return reached.real

    def target(self, roll: float, position: list[float], rotation: Rotation) -> tuple[Vector, Rotation]:
        """Return a tool pose as its wrist centre and rotation, both seen from behind the shoulder roll.

        Args:
            roll: Angle of the shoulder roll, rad.
            position: Position of the tool, three numbers, m.
            rotation: Rotation of the tool, three rows of three.

        Returns:
            Wrist centre in the frame that the shoulder roll turns, m, and the rotation in the same frame.
        """
        u, v, w = self._centre_to_tool
        first, second, third = rotation
        x = position[0] - self._origin[0] - (first[0] * u + first[1] * v + first[2] * w)
        y = position[1] - self._origin[1] - (second[0] * u + second[1] * v + second[2] * w)
        z = position[2] - self._origin[2] - (third[0] * u + third[1] * v + third[2] * w)
        # At its index the roll is zero, and nothing has to be turned back.
        if roll:
            c, s = cos(roll), sin(roll)
            rotation = [first, _combination(c, second, s, third), _combination(c, third, -s, second)]
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
        along, across, up = c * x + s * y - reached.real, c * y - s * x, z - reached.imag
        error = (along, across, up)
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
        if side >= 0.0:
            radius, yaw = hypot(x, y), atan2(y, x)
        else:
            radius, yaw = -hypot(x, y), atan2(-y, -x)
        wrist, rates, tilted = _wrist(yaw, rotation, near)
        base, upper_arm, forearm, hand = self._lengths
        hand *= tilted
        span = complex(radius, z) - base - hand
        cosine = (span.real**2 + span.imag**2 - self._squares) / self._product
        if not -1.0 <= cosine <= 1.0:
            return None
        # The arc cosine is not negative: the elbow bends one way only.
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
    tilt = _near(atan2(r20, forward), near.tilt)
    roll = _near(atan2(s * r02 - c * r12, c * r11 - s * r01), near.roll)
    angles = WristAngles(tilt, atan2(aside, cosine), roll)
    # With wrist yaw w the first column is (cos tilt cos w, sin w, sin tilt cos w), the middle row
    # (sin w, cos w cos roll, -cos w sin roll).
    # At its quarter turn the wrist yaw leaves tilt and wrist roll free; next to it they follow the yaw without bounds.
    cosine = max(cosine, TOLERANCE)
    tilted = complex(forward, r20) / cosine
    rates = (-tilted.imag * aside / cosine, -tilted.real, -tilted.imag / cosine)
    return angles, rates, tilted


def _combination(c: float, first: list[float], s: float, second: list[float]) -> list[float]:
    """Return `c first + s second` of two rows."""
    return [c * m + s * n for m, n in zip(first, second, strict=True)]


def _near(angle: float, reference: float) -> float:
    """Return the angle plus the whole turns that bring it nearest to a reference."""
    return angle + tau * round((reference - angle) / tau)
