"""The variant `flight`: the arm in orbit that the ground arm is to answer like [Morris1996, VII.2].

The thesis names it, the Dexterous Orbital Servicing System after the Flight Telerobotic Servicer, says that the ground
arm has its kinematics, and gives no number of it. Everything below is assumed, within what public documents say of
electric arms for space: geared brushless motors, brakes that hold without power, no weight to carry.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from hmtb_twin.parameters.electric_drive import ElectricDrive
from hmtb_twin.parameters.quantity import quantity
from hmtb_twin.parameters.values import JOINTS, LINKS, Link, Servo


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


_MASSES = {
    "shoulder_roll": (6.0, 0.09),
    "shoulder_yaw": (6.0, 0.09),
    "shoulder_pitch": (9.0, 0.08),
    "elbow_pitch": (6.5, 0.07),
    "wrist_pitch": (4.0, 0.06),
    "wrist_yaw": (3.5, 0.055),
    "wrist_roll": (2.0, 0.05),
    "end_effector": (3.0, 0.045),
}

FLIGHT_LINKS: Mapping[str, Link] = MappingProxyType(
    {name: FlightLink(LINKS[name].length, mass, radius) for name, (mass, radius) in _MASSES.items()}
)
"""The link that each joint moves, and the end effector."""

_SHOULDER = ElectricDrive(torque_constant=0.15, resistance=0.5, rotor_inertia=6e-5, largest_current=12.0)
_ELBOW = ElectricDrive(torque_constant=0.12, resistance=0.7, rotor_inertia=4e-5, largest_current=8.5)
_WRIST = ElectricDrive(torque_constant=0.07, gear_ratio=100.0, resistance=1.0, rotor_inertia=1e-5, largest_current=7.0)

FLIGHT_DRIVES: Mapping[str, ElectricDrive] = MappingProxyType(
    dict(zip(JOINTS, (_SHOULDER,) * 3 + (_ELBOW,) + (_WRIST,) * 3, strict=True))
)
"""The drive of each joint: 288, 163 and 49 N m at shoulder, elbow and wrist."""

FLIGHT_SERVOS: Mapping[str, Servo] = MappingProxyType(
    dict(
        zip(
            JOINTS,
            map(FlightServo, (-13.0,) * 7, (-70.0, -70.0, -90.0, -140.0, -200.0, -200.0, -200.0)),
            strict=True,
        )
    )
)
"""The servo of each joint."""
