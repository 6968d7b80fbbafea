"""The 1553 recorder: resolver angles and wrist wrench at the ticks of the position loop."""

import numpy as np

from hmtb_twin.hand_controller import quantise
from hmtb_twin.parameters import Recorder


def read_resolvers(
    angles: np.ndarray,
    delays: np.ndarray,
    parameters: Recorder,
    rng: np.random.Generator,
    *,
    noise: bool,
    quantisation: bool,
) -> np.ndarray:
    """Return the measured angles that the bus recorded.

    Args:
        angles: Joint angles at the ticks, the arm at rest before the first (N, 7), rad.
        delays: How late each joint's angle reaches the record (7,), samples.
        parameters: The recorder.
        rng: Source of noise; the same number of draws is made whether noise is on or off.
        noise: Whether resolver noise acts.
        quantisation: Whether the resolvers round.

    Returns:
        Measured angles (N, 7), rad.
    """
    ticks = np.arange(len(angles))[:, None] - delays
    read = np.take_along_axis(angles, np.maximum(ticks, 0), axis=0)
    disturbance = parameters.noise * rng.standard_normal(angles.shape)
    if noise:
        read = read + disturbance
    if quantisation:
        read = parameters.resolver_step * quantise(read, parameters.resolver_step)
    return read
