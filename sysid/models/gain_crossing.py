"""Where a gain falls below a level; beside the bandwidth it does not depend on the gain at 0 Hz."""

import numpy as np

from sysid import FrequencyResponse, StateSpace

HALF_POWER = float(np.sqrt(0.5))
"""The gain 0.707: half of the power of an answer that follows its command."""


def crossing(response: FrequencyResponse, level: float) -> float:
    """First frequency at which the gain falls below a level, interpolated between lines on logarithmic axes.

    Args:
        response: Response on its lines, one input and one output.
        level: Gain.

    Returns:
        Frequency, Hz; NaN if the gain never falls so low, or lies below it from the first line on.
    """
    f, gain = response.frequencies, response.magnitude[:, 0, 0]
    below = np.flatnonzero(gain < level)
    if not len(below) or below[0] == 0:
        return float("nan")
    k = int(below[0])
    x = np.interp(-np.log(level), -np.log(gain[[k - 1, k]]), np.log(f[[k - 1, k]]))
    return float(np.exp(x))


def half_power_hz(model: StateSpace) -> float:
    """First frequency at which a model's gain is 0.707, whatever it is at 0 Hz.

    Where the input has power on both sides of it, this frequency is measured. The bandwidth, 3.01 dB below the gain at
    0 Hz, is extrapolated as long as nothing near 0 Hz is excited.

    Args:
        model: One input and one output.

    Returns:
        Frequency, Hz; NaN if the gain never falls so low, or lies below it from the first.
    """
    f = np.geomspace(0.005, 0.5 / model.dt, 4000)
    return crossing(FrequencyResponse(f, model.frequency_response(f), model.dt, "model"), HALF_POWER)
