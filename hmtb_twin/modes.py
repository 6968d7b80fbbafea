"""Control modes: how stick motions become joint commands, within velocity limits and joint ranges."""

import numpy as np

from hmtb_twin.errors import TwinError
from hmtb_twin.parameters import JOINTS, MOTIONS

MODES = ("single_joint",)
"""The control modes that exist."""


def joint_index(name: str) -> int:
    """Return a joint's place in `JOINTS`.

    Raises:
        TwinError: There is no such joint.
    """
    if name not in JOINTS:
        raise TwinError(f"unknown joint {name!r}, available: {', '.join(JOINTS)}")
    return JOINTS.index(name)


def wanted_angles(pose: np.ndarray, axes: tuple[str, ...], offset: np.ndarray) -> np.ndarray:
    """Return what the stick asks of the joints in single-joint mode: the others keep their pose.

    Args:
        pose: Operating pose (7,), rad.
        axes: Joints that the stick moves.
        offset: Commanded offsets (N, n_axes), rad.

    Returns:
        Wanted angles (N, 7), rad.
    """
    wanted = np.tile(pose, (len(offset), 1))
    for column, name in enumerate(axes):
        wanted[:, joint_index(name)] += offset[:, column]
    return wanted


def limit_command(wanted: np.ndarray, previous: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Return the next joint command: toward the wanted angle, within velocity limit and joint range.

    Args:
        wanted: Wanted angles (..., 7), rad.
        previous: Last command (..., 7), rad.
        step: Largest change in one tick (7,), rad.

    Returns:
        The command (..., 7), rad.
    """
    return np.clip(previous + np.clip(wanted - previous, -step, step), _LOWER, _UPPER)


_LOWER = np.array([MOTIONS[name].lower for name in JOINTS])
_UPPER = np.array([MOTIONS[name].upper for name in JOINTS])
