"""When the bandwidth of a best linear approximation says little about the joint."""

import numpy as np

from hmtb_twin import Truth
from scenarios.truth.best_linear import BestLinearTruth

SLOWEST = 0.3
"""Lines up to this frequency tell the gain at low frequency, Hz."""

DISTORTED = 10.0
"""Nonlinear distortion from which on no one linear model is good, percent."""

WIDE = 1.5
"""Factor between the ends of an interval from which on the bandwidth in it is a rough guess."""

STUCK = 0.7
"""Gain at low frequency, over the truth's, below which the joint sticks: its bandwidth is relative to that gain."""


def slow_gain(found: BestLinearTruth, truth: Truth) -> float:
    """Return the gain from commanded to measured angle over that of the small-signal truth, lines up to `SLOWEST`.

    Args:
        found: The approximation of one joint, excited alone.
        truth: The small-signal truth of the same arm.
    """
    response, joint = found.servo.response, found.measured[0]
    slow = response.frequencies <= SLOWEST
    expected = truth.channel(joint, joint).frequency_response(response.frequencies[slow])[:, 0, 0]
    return float(np.abs(response.response[slow, 0, 0] / expected).mean())


def cautions(found: BestLinearTruth, truth: Truth) -> tuple[str, ...]:
    """Return in words why the bandwidth of an approximation says little; nothing where it may be relied upon.

    Args:
        found: The approximation of one joint, excited alone.
        truth: The small-signal truth of the same arm.
    """
    said = []
    band, distortion, gain = found.bandwidth, float(found.distortion_percent[0]), slow_gain(found, truth)
    hz, low, high = (float(part[0, 0]) for part in (band.hz, *band.ci95))
    if gain < STUCK:
        said.append(f"it follows {100 * gain:.0f} % of a slow command, and the bandwidth is relative to that")
    if distortion > DISTORTED:
        said.append(f"distortion is {distortion:.0f} %, so no linear model is good")
    if not np.isfinite(hz):
        said.append("no bandwidth shows")
    elif not high <= WIDE * low:
        said.append(f"the interval's ends differ by a factor of {high / low:.1f}")
    return tuple(said)
