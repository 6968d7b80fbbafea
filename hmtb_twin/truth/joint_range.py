"""Where the arm's joints may stand for its linear truth to exist."""

import numpy as np

from hmtb_twin.parameters.errors import TwinError
from hmtb_twin.parameters.values import INDEXED_JOINTS, JOINTS, MOTIONS

CLEARANCE = 1e-3
"""Nearest that a joint may come to its stop, rad: ten steps of the finite differences, which must not touch it."""

INDEX = 0.0
"""Angle at which the pin of an indexed joint holds it, rad."""

AT_INDEX = 1e-9
"""How near to it an indexed joint has to be given, rad: a pin pushed aside pulls by its stiffness."""


def check_range(angles: np.ndarray) -> None:
    """Refuse angles at which a joint would stand on its stop, or an indexed joint beside its pin.

    Args:
        angles: Joint angles (7,), rad.

    Raises:
        TwinError: One is not inside its joint's range.
    """
    for name, angle in zip(JOINTS, angles, strict=True):
        given = f"pose: {name} = {np.degrees(angle):g} deg given, expected"
        if name in INDEXED_JOINTS:
            if abs(angle - INDEX) > AT_INDEX:
                raise TwinError(f"{given} {np.degrees(INDEX):g} deg, where its pin holds it")
        elif not clear_of_stops(name, float(angle)):
            low, high = np.degrees((MOTIONS[name].lower, MOTIONS[name].upper))
            raise TwinError(f"{given} between {low:g} and {high:g} deg, at least {CLEARANCE:g} rad off the stops")


def clear_of_stops(joint: str, angle: float) -> bool:
    """Return whether a joint at an angle in rad moves freely either way."""
    return MOTIONS[joint].lower + CLEARANCE <= angle <= MOTIONS[joint].upper - CLEARANCE
