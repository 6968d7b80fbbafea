"""The arms that exist: what each is made of."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from hmtb_twin.parameters.electric_drive import Drive
from hmtb_twin.parameters.errors import TwinError
from hmtb_twin.parameters.flight_variant import FLIGHT_DRIVES, FLIGHT_LINKS, FLIGHT_SERVOS
from hmtb_twin.parameters.published_variant import PUBLISHED_ACTUATORS, PUBLISHED_SERVOS
from hmtb_twin.parameters.values import ACTUATORS, BUS, LINKS, SERVOS, BusTerminal, Link, Servo

EARTH = 9.81
"""Acceleration of gravity that the arm feels on the ground, m/s^2."""


@dataclass(frozen=True, eq=False)
class Variant:
    """One arm: whatever may differ from the nominal one.

    Attributes:
        name: What it is called.
        description: One line for lists.
        gravity: Acceleration of gravity, m/s^2.
        links: Link that each joint moves, and the end effector.
        actuators: Drive of each joint.
        servos: Servo of each joint.
        bus: Bus terminal of each joint.
        step: Physics step in free space, s, a whole part of a tick; servo valves have one of their own. The default is
            that of the model's file.
    """

    name: str
    description: str
    gravity: float = EARTH
    links: Mapping[str, Link] = field(default_factory=lambda: LINKS)
    actuators: Mapping[str, Drive] = field(default_factory=lambda: ACTUATORS)
    servos: Mapping[str, Servo] = field(default_factory=lambda: SERVOS)
    bus: Mapping[str, BusTerminal] = field(default_factory=lambda: BUS)
    step: float = 0.0005


VARIANTS: Mapping[str, Variant] = MappingProxyType(
    {
        arm.name: arm
        for arm in (
            Variant("nominal", "about 1 Hz on every joint, as the spectral estimates of the thesis read"),
            Variant(
                "published",
                "dominant poles of the models that the thesis chose, shoulder yaw at 0.16 Hz",
                actuators=PUBLISHED_ACTUATORS,
                servos=PUBLISHED_SERVOS,
            ),
            Variant(
                "flight",
                "the arm in orbit: weightless, lighter links, electric drives, about 2 Hz",
                gravity=0.0,
                links=FLIGHT_LINKS,
                actuators=FLIGHT_DRIVES,
                servos=FLIGHT_SERVOS,
                # Stiff servos on light links: with the heaviest payload 0.25 ms is still too long.
                step=0.000125,
            ),
        )
    }
)
"""Every arm by its name."""


def variant_named(name: str) -> Variant:
    """Return a variant.

    Raises:
        TwinError: There is none of that name.
    """
    if not isinstance(name, str) or name not in VARIANTS:
        raise TwinError(f"unknown variant {name!r}, available: {', '.join(VARIANTS)}")
    return VARIANTS[name]
