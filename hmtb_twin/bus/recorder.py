"""The 1553 recorder: resolver angles and wrist wrench at the ticks of the position loop."""

import numpy as np

from hmtb_twin.control.hand_controller import quantise
from hmtb_twin.parameters.values import Recorder


def read_resolvers(angles: np.ndarray, noise: np.ndarray, parameters: Recorder, *, resolver: bool) -> np.ndarray:
    """Return what resolvers tell of joint angles.

    Args:
        angles: Joint angles, any shape, rad.
        noise: Standard normal numbers of the same shape.
        parameters: The recorder.
        resolver: Whether the resolvers are noisy and round.

    Returns:
        Readings, same shape, rad.
    """
    if not resolver:
        return angles
    return parameters.resolver_step * quantise(angles + parameters.noise * noise, parameters.resolver_step)


def delayed(readings: np.ndarray, delays: np.ndarray) -> np.ndarray:
    """Return readings as the bus record has them: each joint late, at rest before the first tick.

    Args:
        readings: At the ticks (N, 7).
        delays: How late each joint's reading reaches the record (7,), samples.

    Returns:
        The record (N, 7).
    """
    ticks = np.arange(len(readings))[:, None] - delays
    return np.take_along_axis(readings, np.maximum(ticks, 0), axis=0)
