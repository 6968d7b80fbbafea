"""What the end effector may hold: orbital replacement units and a block, each a uniform box."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from hmtb_twin.parameters.quantity import quantity


@dataclass(frozen=True)
class Payload:
    """The RPCM orbital replacement unit in the end effector, a uniform box."""

    mass: float = quantity(4.1, "kg", "analogue", "9 lb flight unit, press reports of 2011; mock-up mass unstated")
    size: tuple[float, float, float] = quantity((0.20, 0.17, 0.09), "m", "assumed", "size of a hand-sized unit")

    @property
    def inertia(self) -> tuple[float, float, float]:
        """Principal moments of inertia about the centre of mass, kg m^2."""
        x, y, z = (side**2 for side in self.size)
        return (self.mass * (y + z) / 12.0, self.mass * (x + z) / 12.0, self.mass * (x + y) / 12.0)


@dataclass(frozen=True)
class Ballast(Payload):
    """A block to study loading with."""

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
"""What the end effector may hold."""

WORKSITE_PAYLOADS = ("rpcm", "none")
"""What it may hold at first where the seats of the RPCM are."""
