"""What the physics engine warned of, in words."""

import mujoco
import numpy as np


def warned_of(counts: np.ndarray) -> str:
    """Return the names of the warnings that were raised, with commas; nothing where none was.

    Args:
        counts: How often each warning of MuJoCo was raised (n,).
    """
    return ", ".join(str(mujoco.mjtWarning(i)).rsplit("mjWARN_", 1)[-1] for i in np.flatnonzero(counts))
