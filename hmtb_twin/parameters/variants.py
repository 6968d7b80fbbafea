"""The variants of the arm: nominal, published, flight and released.

`published` has the dominant poles of the printed models [Morris1996, eq. 4.14]: shoulder yaw ARMAX (4.7), shoulder
pitch OE (4.10) and elbow pitch ARMAX (4.12), which the thesis chose. Its servo poles are solutions for the coupled arm,
so that the poles of the arm, not of the servos, are the printed ones; `python -m docs.images.published_servos` solves
for them again. The bus delays are the nominal ones, which are the printed nk. docs/published-variant.md describes what
could not be matched.

`flight` is the arm in orbit that the ground arm is to answer like [Morris1996, VII.2]. The thesis names it, the
Dexterous Orbital Servicing System after the Flight Telerobotic Servicer, says that the ground arm has its kinematics,
and gives no number of it. Its numbers are assumed, within what public documents say of electric arms for space: geared
brushless motors, brakes that hold without power, no weight to carry.

`released` is the nominal arm without the pin of its shoulder roll. The thesis indexed that joint and left it to future
work [Morris1996, VII.1]; its drive and servo have the assumed numbers of the nominal arm, which the pin hides there.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf
from types import MappingProxyType

from hmtb_twin.files.errors import TwinError, shown
from hmtb_twin.parameters.drives import ACTUATORS, Actuator, Drive, ElectricDrive, Friction, RollGearFriction
from hmtb_twin.parameters.quantity import quantity
from hmtb_twin.parameters.servo_valve import POWER_UNIT
from hmtb_twin.parameters.values import BUS, INDEXED_JOINTS, JOINTS, LINKS, MOTIONS, SERVOS, BusTerminal, Link, Servo


@dataclass(frozen=True)
class FittedServo(Servo):
    """A servo with which the coupled arm has the printed poles."""

    slow_pole: float = quantity(-6.0, "rad/s", "derived", "the coupled arm's poles are those of (4.7), (4.10), (4.12)")
    fast_pole: float = quantity(
        -60.0, "rad/s", "derived", "likewise; of shoulder yaw the best fit to the response of (4.7)"
    )


@dataclass(frozen=True)
class SlowServo(Servo):
    """A servo with a solved slow pole and the nominal damping."""

    slow_pole: float = quantity(-6.0, "rad/s", "derived", "moves with the pitch joints: printed poles exactly met")


@dataclass(frozen=True)
class LightFriction(Friction):
    """Seals that a soft servo still overcomes."""

    coulomb: float = quantity(
        0.0001, "1", "derived", "breakaway within a 1 V command; the printed DC gain of the yaw is above one"
    )


PUBLISHED_SERVOS: Mapping[str, Servo] = MappingProxyType(
    {
        **SERVOS,
        "shoulder_yaw": FittedServo(-1.002, -36.50),
        "shoulder_pitch": FittedServo(-6.320, -54.30),
        "elbow_pitch": FittedServo(-6.410, -64.87),
        "wrist_pitch": SlowServo(-5.879, SERVOS["wrist_pitch"].fast_pole),
    }
)
"""The servo of each joint."""

# The servos of these joints are so soft that nominal seals would hold them through a command of 1 V.
_LIGHT_YAW = replace(ACTUATORS["shoulder_yaw"], friction=LightFriction())
_LIGHT_ROLL = replace(ACTUATORS["wrist_roll"], friction=LightFriction())

PUBLISHED_ACTUATORS: Mapping[str, Actuator] = MappingProxyType(
    {**ACTUATORS, "shoulder_yaw": _LIGHT_YAW, "wrist_roll": _LIGHT_ROLL}
)
"""The drive of each joint: nominal but for the seals of two joints, whose servos are too soft for nominal ones."""


@dataclass(frozen=True)
class FlightLink(Link):
    """A link of the arm in orbit, of the ground arm's length."""

    length: float = quantity(0.0, "m", "source", "as the ground arm's: same kinematics, thesis I.2; assumed there")
    mass: float = quantity(
        0.0, "kg", "assumed", "40 kg in all, half the ground arm; electric 7-joint arms weigh 15 to 75 kg"
    )
    radius: float = quantity(0.0, "m", "assumed", "outer radius of a link of that mass")


@dataclass(frozen=True)
class FlightServo(Servo):
    """A position servo of the arm in orbit."""

    slow_pole: float = quantity(
        -13.0, "rad/s", "assumed", "2 Hz, twice the ground arm: electric joint servos reach several"
    )
    fast_pole: float = quantity(-70.0, "rad/s", "assumed", "well apart from the slow one, more outward")


_MASSES_AND_RADII = {
    "shoulder_roll": (6.0, 0.09),
    "shoulder_yaw": (6.0, 0.09),
    "shoulder_pitch": (9.0, 0.08),
    "elbow_pitch": (6.5, 0.07),
    "wrist_pitch": (4.0, 0.06),
    "wrist_yaw": (3.5, 0.055),
    "wrist_roll": (2.0, 0.05),
    "end_effector": (3.0, 0.045),
}


def _flight_links() -> dict[str, Link]:
    """Return the links of the arm in orbit, which have the ground arm's lengths."""
    links: dict[str, Link] = {}
    for name, (mass, radius) in _MASSES_AND_RADII.items():
        links[name] = FlightLink(LINKS[name].length, mass, radius)
    return links


FLIGHT_LINKS: Mapping[str, Link] = MappingProxyType(_flight_links())
"""The link that each joint moves, and the end effector."""

# Torque constant times gear ratio times largest current gives the torques named below.
_SHOULDER = ElectricDrive(torque_constant=0.15, resistance=0.5, rotor_inertia=6e-5, largest_current=12.0)
_ELBOW = ElectricDrive(torque_constant=0.12, resistance=0.7, rotor_inertia=4e-5, largest_current=8.5)
_WRIST = ElectricDrive(torque_constant=0.07, gear_ratio=100.0, resistance=1.0, rotor_inertia=1e-5, largest_current=7.0)
_ROLL = replace(_WRIST, friction=RollGearFriction())

FLIGHT_DRIVES: Mapping[str, ElectricDrive] = MappingProxyType(
    dict(zip(JOINTS, (_SHOULDER,) * 3 + (_ELBOW,) + (_WRIST,) * 2 + (_ROLL,), strict=True))
)
"""The drive of each joint: 288, 163 and 49 N m at shoulder, elbow and wrist."""

# Faster outward, as on the ground.
_FAST_POLES = (-70.0, -70.0, -90.0, -140.0, -200.0, -200.0, -200.0)

FLIGHT_SERVOS: Mapping[str, Servo] = MappingProxyType(
    {joint: FlightServo(fast_pole=pole) for joint, pole in zip(JOINTS, _FAST_POLES, strict=True)}
)
"""The servo of each joint."""


LEAST_VOLUME = 1.2
"""Least trapped volume of an actuator over the volume that its joint sweeps: chambers, ports and lines."""

EARTH = 9.81
"""Acceleration of gravity that the arm feels on the ground, m/s^2."""


@dataclass(frozen=True, eq=False)
class Variant:
    """One arm: everything that may differ from the nominal one.

    Attributes:
        name: Its name.
        description: One line for lists.
        gravity: Acceleration of gravity, m/s^2.
        links: Link that each joint moves, and the end effector.
        actuators: Drive of each joint.
        servos: Servo of each joint.
        bus: Bus terminal of each joint.
        servo: Servo law, "flow" or "torque"; a `Plant` may ask for the other one.
        indexed: Joints that a pin holds, which follow no command.
    """

    name: str
    description: str
    gravity: float = EARTH
    links: Mapping[str, Link] = field(default_factory=lambda: LINKS)
    actuators: Mapping[str, Drive] = field(default_factory=lambda: ACTUATORS)
    servos: Mapping[str, Servo] = field(default_factory=lambda: SERVOS)
    bus: Mapping[str, BusTerminal] = field(default_factory=lambda: BUS)
    servo: str = "torque"
    indexed: tuple[str, ...] = INDEXED_JOINTS

    def __post_init__(self) -> None:
        """Raise `TwinError` for hydraulics that cannot be."""
        hydraulic = {name: drive for name, drive in self.actuators.items() if isinstance(drive, Actuator)}
        for name, actuator in hydraulic.items():
            smallest = LEAST_VOLUME * actuator.displacement * (MOTIONS[name].upper - MOTIONS[name].lower)
            if actuator.trapped_volume < smallest:
                raise TwinError(
                    f"{self.name}: trapped volume {actuator.trapped_volume:g} cm3 of the {name.replace('_', ' ')} "
                    f"given, expected at least {smallest:.0f}: {LEAST_VOLUME:g} times what the joint sweeps over its "
                    "range"
                )
        # All joints at full speed must not starve each other: the pump feeds every valve at once.
        flow = sum(actuator.rated_flow for actuator in hydraulic.values())
        if flow > POWER_UNIT.largest_flow:
            raise TwinError(
                f"{self.name}: valves that pass {flow:.0f} cm3/s together given, expected at most the pump's "
                f"{POWER_UNIT.largest_flow:g}"
            )
        for name, drive in self.actuators.items():
            friction = drive.friction
            if friction is None:
                continue
            # `Friction.bristles` would silently reduce the damping; a variant's own numbers must not need that.
            damping = friction.bristle_time * drive.coulomb_torque / friction.presliding
            passive = drive.drag / (friction.static_ratio - 1.0) if friction.static_ratio > 1.0 else inf
            if damping > passive:
                raise TwinError(
                    f"{self.name}: LuGre damping {damping:.3g} N m s/rad of the {name.replace('_', ' ')} given, "
                    f"expected at most {passive:.3g}: beyond, the friction is not passive"
                )


_NOMINAL = Variant("nominal", "about 1 Hz on every joint, as the spectral estimates of the thesis read", servo="flow")
_PUBLISHED = Variant(
    "published",
    "dominant poles of the models that the thesis chose, shoulder yaw at 0.16 Hz",
    actuators=PUBLISHED_ACTUATORS,
    servos=PUBLISHED_SERVOS,
)
_FLIGHT = Variant(
    "flight",
    "the arm in orbit: weightless, lighter links, electric drives, about 2 Hz",
    gravity=0.0,
    links=FLIGHT_LINKS,
    actuators=FLIGHT_DRIVES,
    servos=FLIGHT_SERVOS,
)
_RELEASED = Variant(
    "released", "the nominal arm with its shoulder roll free: seven joints move", servo="flow", indexed=()
)

VARIANTS: Mapping[str, Variant] = MappingProxyType(
    {arm.name: arm for arm in (_NOMINAL, _PUBLISHED, _FLIGHT, _RELEASED)}
)
"""All arms by name."""


def variant_named(name: str) -> Variant:
    """Return a variant by name; raises `TwinError` for an unknown one."""
    if not isinstance(name, str) or name not in VARIANTS:
        raise TwinError(f"unknown variant {shown(name)}, available: {', '.join(VARIANTS)}")
    return VARIANTS[name]
