"""Payloads of the end effector: uniform boxes, and loads of any shape."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hmtb_twin.files.errors import TwinError, shown


@dataclass(frozen=True)
class Payload:
    """A uniform box in the end effector, which begins at the tool.

    Attributes:
        mass: Its mass, kg.
        size: Its sides along the axes of the tool (3,), m.
    """

    mass: float
    size: tuple[float, float, float]

    @property
    def inertia(self) -> tuple[float, float, float]:
        """Principal moments of inertia about the centre of mass, kg m^2."""
        length, width, height = (side**2 for side in self.size)
        roll = self.mass * (width + height) / 12.0
        pitch = self.mass * (length + height) / 12.0
        yaw = self.mass * (length + width) / 12.0
        return (roll, pitch, yaw)


HEAVIEST, FARTHEST = 1e5, 100.0
"""Largest mass of a payload, kg, and largest distance of its centre from the tool, m."""


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
        far = float(np.abs(self.centre).max())
        if not 0.0 < self.mass < np.inf or not np.isfinite(self.centre).all():
            raise TwinError(f"a payload of {self.mass:g} kg given, expected a mass above 0 kg and a finite centre")
        if not self.mass <= HEAVIEST or not far <= FARTHEST or not largest <= HEAVIEST * FARTHEST**2:
            raise TwinError(
                f"a payload of {self.mass:g} kg, {far:g} m off the tool, with {largest:g} kg m2 given, expected at "
                f"most {HEAVIEST:g} kg within {FARTHEST:g} m"
            )
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
