"""The 1553 recorder: resolver angles and wrist wrench at the ticks of the position loop."""

import numpy as np

from hmtb_twin.control.hand_controller import quantise
from hmtb_twin.parameters.values import Recorder


def read_resolvers(angles: np.ndarray, noise: np.ndarray, parameters: Recorder, *, resolver: bool) -> np.ndarray:
    """Return resolver readings of joint angles.

    Args:
        angles: Joint angles, any shape, rad.
        noise: Standard normal numbers of the same shape.
        parameters: The recorder.
        resolver: Whether the resolvers have noise and round.

    Returns:
        Readings, same shape, rad.
    """
    if not resolver:
        return angles
    return parameters.resolver_step * quantise(angles + parameters.noise * noise, parameters.resolver_step)


def delayed(readings: np.ndarray, delays: np.ndarray) -> np.ndarray:
    """Return readings (N, 7) delayed by samples (7,) per joint, as in the bus record; at rest before the first tick."""
    ticks = np.arange(len(readings))[:, None] - delays
    # The arm rests before the first tick: the first reading stands for those before it.
    return np.take_along_axis(readings, np.maximum(ticks, 0), axis=0)
