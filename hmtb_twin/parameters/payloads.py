"""Payloads of the end effector, and the seats and latch that hold the replacement unit at the worksite."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import cos, pi, radians, sin
from types import MappingProxyType

import numpy as np

from hmtb_twin.files.errors import TwinError, shown
from hmtb_twin.parameters.quantity import quantity


@dataclass(frozen=True)
class Payload:
    """The RPCM orbital replacement unit in the end effector, a uniform box."""

    mass: float = quantity(4.1, "kg", "analogue", "9 lb flight unit, press reports of 2011; mock-up mass unstated")
    size: tuple[float, float, float] = quantity((0.20, 0.17, 0.09), "m", "assumed", "size of a hand-sized unit")

    @property
    def inertia(self) -> tuple[float, float, float]:
        """Principal moments of inertia about the centre of mass, kg m^2."""
        length, width, height = (side**2 for side in self.size)
        roll = self.mass * (width + height) / 12.0
        pitch = self.mass * (length + height) / 12.0
        yaw = self.mass * (length + width) / 12.0
        return (roll, pitch, yaw)


@dataclass(frozen=True)
class Load:
    """A payload of any shape.

    Attributes:
        mass: Its mass, kg.
        centre: Its centre of mass in the frame of the tool (3,), m.
        inertia: Its inertia about the centre, along the axes of the tool: xx, yy, zz, xy, xz, yz, kg m^2.
    """

    mass: float
    centre: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]

    def __post_init__(self) -> None:
        moments = self.principal[0]
        largest = float(moments.max(initial=0.0))
        if not 0.0 < self.mass < np.inf or not np.isfinite(self.centre).all():
            raise TwinError(f"a payload of {self.mass:g} kg given, expected a mass above 0 kg and a finite centre")
        # No body has a moment above the sum of the other two; a point mass has none at all.
        if moments.min() < -1e-12 * largest or 2.0 * largest > (1.0 + 1e-9) * float(moments.sum()):
            shown_moments = ", ".join(f"{moment:.3g}" for moment in moments)
            raise TwinError(
                f"a payload with principal moments {shown_moments} kg m2 given, expected none below 0, and none above "
                "the sum of the others"
            )

    @property
    def text(self) -> str:
        """The payload as one word of a scenario or a command, all its digits; `load_of` reads it back."""
        parts = {"mass": (self.mass,), "centre": self.centre, "inertia": self.inertia}
        return " ".join(f"{key}={','.join(repr(float(number)) for number in part)}" for key, part in parts.items())

    @property
    def principal(self) -> tuple[np.ndarray, np.ndarray]:
        """Principal moments (3,), kg m^2, and axes as columns (3, 3), right-handed."""
        xx, yy, zz, xy, xz, yz = self.inertia
        moments, axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
        axes[:, 0] *= np.sign(np.linalg.det(axes))
        return moments, axes


OWN = "mass="
"""Begins the text of a payload of one's own."""

OWN_FORM = "mass=KG centre=X,Y,Z inertia=XX,YY,ZZ"
"""Form of such a text; `centre` and `inertia` may be missing, and an inertia may have six numbers."""


def load_of(text: str) -> Load:
    """Read a payload from its text, `OWN_FORM`: numbers in kg, m and kg m^2, in the frame of the tool.

    Raises:
        TwinError: It has another form, or no body has such an inertia.
    """
    values: dict[str, tuple[float, ...]] = {"centre": (0.0,) * 3, "inertia": (0.0,) * 6}
    seen = set()
    for part in text.split():
        key, _, numbers = part.partition("=")
        if key not in ("mass", "centre", "inertia") or key in seen:
            raise TwinError(f"payload {shown(text)} given, expected {OWN_FORM}: {shown(part)} is none of it")
        seen.add(key)
        try:
            values[key] = tuple(float(number) for number in numbers.split(","))
        except ValueError as error:
            raise TwinError(f"payload {shown(text)} given, expected {OWN_FORM}, all numbers: {error}") from error
    return load_from(values)


def load_from(values: Mapping[str, Sequence[float]]) -> Load:
    """Return a payload of a mass, a centre and an inertia of three numbers along the axes of the tool, or of six.

    Raises:
        TwinError: Other counts of numbers, or no body has such an inertia.
    """
    inertia = tuple(values["inertia"])
    if len(inertia) == 3:
        inertia = (*inertia, 0.0, 0.0, 0.0)
    mass, centre = tuple(values.get("mass", ())), tuple(values["centre"])
    if (len(mass), len(centre), len(inertia)) != (1, 3, 6):
        raise TwinError(
            f"payload with {len(mass)} numbers of mass, {len(centre)} of centre and {len(values['inertia'])} of "
            "inertia given, expected one, three, and three or six"
        )
    if not np.isfinite([*mass, *centre, *inertia]).all():
        raise TwinError(f"payload {shown((*mass, *centre, *inertia))} given, expected finite numbers")
    x, y, z = centre
    xx, yy, zz, xy, xz, yz = inertia
    return Load(mass[0], (x, y, z), (xx, yy, zz, xy, xz, yz))


@dataclass(frozen=True)
class Ballast(Payload):
    """A uniform block by which the effect of loading is studied."""

    mass: float = quantity(10.0, "kg", "assumed", "between the RPCM and the multiplexer")
    size: tuple[float, float, float] = quantity((0.20, 0.17, 0.09), "m", "assumed", "as the RPCM")


@dataclass(frozen=True)
class Multiplexer(Payload):
    """An external multiplexer-demultiplexer, a computer of the space station's truss."""

    mass: float = quantity(23.1, "kg", "analogue", "51 lb, press reports of its exchange in April 2014")
    size: tuple[float, float, float] = quantity((0.38, 0.42, 0.27), "m", "assumed", "size of a unit of that mass")


PAYLOADS: Mapping[str, Payload | None] = MappingProxyType(
    {"rpcm": Payload(), "none": None, "ballast": Ballast(), "mdm": Multiplexer()}
)
"""Payloads of the end effector by name."""

WORKSITE_PAYLOADS = ("rpcm", "none")
"""Payloads with which an experiment at the worksite may start."""


UNIT = Payload()
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
