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
from dataclasses import dataclass, replace
from types import MappingProxyType

from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.drives import ACTUATORS, Actuator, ElectricDrive, Friction, RollGearFriction
from hmtb_twin.parameters.payloads import PAYLOADS
from hmtb_twin.parameters.quantity import quantity
from hmtb_twin.parameters.values import (
    BUS,
    INDEXED_JOINTS,
    JOINTS,
    LINKS,
    MOTIONS,
    OPERATING_POSE,
    POSES,
    SAMPLE_RATE,
    SERVOS,
    STUDIED_JOINTS,
    Link,
    Servo,
)


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


_NOMINAL = ArmDescription(
    "nominal",
    "about 1 Hz on every joint, as the spectral estimates of the thesis read",
    joints=JOINTS,
    motions=MOTIONS,
    actuators=ACTUATORS,
    servos=SERVOS,
    bus=BUS,
    poses=POSES,
    operating_pose=OPERATING_POSE,
    payloads=PAYLOADS,
    tuned_payload="rpcm",
    links=LINKS,
    servo="flow",
    indexed=INDEXED_JOINTS,
    studied=STUDIED_JOINTS,
    sample_rate=SAMPLE_RATE,
)
_PUBLISHED = replace(
    _NOMINAL,
    name="published",
    description="dominant poles of the models that the thesis chose, shoulder yaw at 0.16 Hz",
    actuators=PUBLISHED_ACTUATORS,
    servos=PUBLISHED_SERVOS,
    servo="torque",
)
_FLIGHT = replace(
    _NOMINAL,
    name="flight",
    description="the arm in orbit: weightless, lighter links, electric drives, about 2 Hz",
    gravity=0.0,
    links=FLIGHT_LINKS,
    actuators=FLIGHT_DRIVES,
    servos=FLIGHT_SERVOS,
    servo="torque",
)
_RELEASED = replace(
    _NOMINAL,
    name="released",
    description="the nominal arm with its shoulder roll free: seven joints move",
    # No pin holds it, so that all seven joints follow commands.
    indexed=(),
)

VARIANTS: Mapping[str, ArmDescription] = MappingProxyType(
    {arm.name: arm for arm in (_NOMINAL, _PUBLISHED, _FLIGHT, _RELEASED)}
)
"""All arms of the test bed by name."""
