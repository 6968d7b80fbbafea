"""The status word of every tick: what the controller limited, and whether the servos had power."""

from enum import IntFlag


class Status(IntFlag):
    """Flags of one tick; 0 is ordinary operation.

    Attributes:
        VELOCITY_LIMITED: A joint's command moved as fast as its limit allows.
        JOINT_LIMITED: A joint's command stood at an end of its range.
        SINGULAR: The tool could not move as asked near a singular pose, and the step was damped.
        CONVERTER_SATURATED: A hand-controller count stood at an end of the converter.
        SHUT_DOWN: Emergency shutdown: servo power off, valves closed.
        UNIT_HELD: The end effector holds the orbital replacement unit.
    """

    VELOCITY_LIMITED = 1
    JOINT_LIMITED = 2
    SINGULAR = 4
    CONVERTER_SATURATED = 8
    SHUT_DOWN = 16
    UNIT_HELD = 32
