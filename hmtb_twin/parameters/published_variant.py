"""The variant `published`: an arm whose truth has the dominant poles of the printed models [Morris1996, eq. 4.14].

Shoulder yaw ARMAX (4.7), shoulder pitch OE (4.10) and elbow pitch ARMAX (4.12) are the models that the thesis chose.
The servo poles below are solutions for the coupled arm, so that the arm's poles, not these, are the printed ones;
`python -m docs.images.published_servos`
finds them again. The bus delays are the nominal ones, which are the printed nk.
What could not be matched is told in docs/published-variant.md.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from hmtb_twin.parameters.quantity import quantity
from hmtb_twin.parameters.values import ACTUATORS, SERVOS, Actuator, Friction, Servo


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
        0.01, "1", "derived", "as the nominal arm's beside the servo's stiffness: the printed DC gain is above one"
    )


PUBLISHED_SERVOS: Mapping[str, Servo] = MappingProxyType(
    {
        **SERVOS,
        "shoulder_yaw": FittedServo(-1.004, -34.84),
        "shoulder_pitch": FittedServo(-6.138, -63.36),
        "elbow_pitch": FittedServo(-6.450, -55.68),
        "wrist_pitch": SlowServo(-5.966, SERVOS["wrist_pitch"].fast_pole),
    }
)
"""The servo of each joint."""

PUBLISHED_ACTUATORS: Mapping[str, Actuator] = MappingProxyType(
    {**ACTUATORS, "shoulder_yaw": replace(ACTUATORS["shoulder_yaw"], friction=LightFriction(0.0015))}
)
"""The drive of each joint: nominal but for the shoulder yaw's seals.

Its servo is so soft that nominal seals would hold the joint back by a sixth of a 1 V command.
"""
