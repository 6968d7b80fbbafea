"""The worksite: the seats and the latch that hold the replacement unit, and its touch."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, pi, radians, sin

import numpy as np

from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.payloads import Payload
from hmtb_twin.parameters.quantity import quantity
from hmtb_twin.parameters.variants import PAYLOADS

UNIT_NAME = "rpcm"
"""Name of the replacement unit among the payloads."""

WORKSITE_PAYLOADS = (UNIT_NAME, "none")
"""Payloads with which an experiment at the worksite may start."""


def _unit() -> Payload:
    """The replacement unit, a box."""
    unit = PAYLOADS[UNIT_NAME]
    if not isinstance(unit, Payload):
        raise TwinError(
            f"payload {UNIT_NAME} of the nominal arm without a size given, expected a box, as the seats are"
        )
    return unit


UNIT = _unit()
"""The unit that fits the seats, its length along the tool."""


@dataclass(frozen=True)
class Plate:
    """A wall or guide of a seat: a box in the seat's frame.

    Attributes:
        position: Centre (3,), m.
        half_size: Half its sides (3,), m.
        tilt: Rotation about the seat's x and y axes, rad.
    """

    position: tuple[float, float, float]
    half_size: tuple[float, float, float]
    tilt: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Seat:
    """A well with vertical walls whose lead-in guides open upward, on the worksite panel.

    Its frame stands on the floor of the well, z up; the unit's narrow side lies along x, its wide side along y.
    """

    position: tuple[float, float, float] = quantity((0.0, 0.0, 0.0), "m", "assumed", "on the panel, within reach")
    yaw: float = quantity(0.0, "rad", "assumed", "narrow sides away from the shoulder, as the tool at rest")
    depth: float = quantity(0.0, "m", "assumed", "height of the walls, about half the unit's")
    clearance: float = quantity(0.0, "m", "assumed", "on each side of the unit")
    guide_length: float = quantity(0.035, "m", "assumed", "along the slope: takes in a unit 17 mm off")
    guide_slope: float = quantity(radians(30.0), "rad", "assumed", "from the vertical")
    wall: float = quantity(0.012, "m", "assumed", "thickness of walls and guides")

    @property
    def interior(self) -> tuple[float, float]:
        """Half the width of the well along x and y, m."""
        return (UNIT.size[2] / 2 + self.clearance, UNIT.size[1] / 2 + self.clearance)

    @property
    def mouth(self) -> float:
        """Height of the guides' upper edge above the floor, m."""
        return self.depth + self.guide_length * cos(self.guide_slope)

    @property
    def seated(self) -> tuple[np.ndarray, np.ndarray]:
        """Pose of the tool, and so of the unit's frame, when the unit stands in the seat.

        Returns:
            Position (3,), m, and rotation (3, 3) in the world: x down, z along the seat's x axis.
        """
        # The columns are the tool's axes: down, to the side, along the seat's x axis.
        c, s = cos(self.yaw), sin(self.yaw)
        rotation = np.array([[0.0, -s, c], [0.0, c, s], [-1.0, 0.0, 0.0]])
        x, y, z = self.position
        return np.array([x, y, z + UNIT.size[0]]), rotation

    def plates(self) -> Iterator[Plate]:
        """Yield the four walls, then the four guides."""
        (a, b), t, h = self.interior, self.wall / 2, self.depth / 2
        c, s = cos(self.guide_slope), sin(self.guide_slope)
        along, reach, height = self.guide_length / 2, self.guide_length * s, self.depth
        # The walls across x cover the ends of those across y.
        for side in (1.0, -1.0):
            yield Plate((side * (a + t), 0.0, h), (t, b + 2 * t, h))
        for side in (1.0, -1.0):
            yield Plate((0.0, side * (b + t), h), (a, t, h))
        # A guide's inner face begins at the upper inner edge of its wall and leans outward.
        offset, level = along * s + t * c, height + along * c - t * s
        for side in (1.0, -1.0):
            yield Plate((side * (a + offset), 0.0, level), (t, b + reach, along), (0.0, side * self.guide_slope))
        for side in (1.0, -1.0):
            yield Plate((0.0, side * (b + offset), level), (a + reach, t, along), (-side * self.guide_slope, 0.0))


SEATS = {
    "holster": Seat((1.01553709, 0.31502974, 0.43), pi / 9, depth=0.12, clearance=0.005),
    "receptacle": Seat((0.98, -0.02, 0.43), 0.0, depth=0.08, clearance=0.003),
}
"""The holster, below the holster-out approach point, and the receptacle for the unit."""


@dataclass(frozen=True)
class Latch:
    """Latch of the end effector: how far off the fitting it still grips, and how stiffly it holds the unit."""

    reach: float = quantity(0.004, "m", "assumed", "the tool may stand so far off the unit's grip")
    turn: float = quantity(radians(4.0), "rad", "assumed", "and be turned by so much")
    time_constant: float = quantity(
        0.002, "s", "assumed", "of the constraint that holds the unit: the stiffest stable one"
    )
    damping_ratio: float = quantity(0.5, "1", "assumed", "of the same")
    pad: float = quantity(0.001, "m", "assumed", "the fingers end so far behind the grip")


@dataclass(frozen=True)
class Touch:
    """Contact of the unit with seats, panel and fingers."""

    friction: float = quantity(0.2, "1", "assumed", "coated aluminium on coated aluminium")
    time_constant: float = quantity(
        0.01, "s", "assumed", "of the contact constraint, critically damped: firm against the arm"
    )


LATCH = Latch()
TOUCH = Touch()
