"""What the rounding of a printed model leaves open."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from scenarios.published import PublishedModel, published_model

DRAWS = 100
"""Models that would be printed alike, of which the range is taken."""


@dataclass(frozen=True)
class DigitRange:
    """Range of what follows from a print, over models that round to the same digits.

    Attributes:
        bandwidth_hz: Lowest and highest bandwidth, Hz.
        dc_gain: Lowest and highest gain at 0 Hz, rad/rad.
        stable: Part of the models that are stable; ranges are of these.
    """

    bandwidth_hz: tuple[float, float]
    dc_gain: tuple[float, float]
    stable: float


@cache
def digit_range(name: str) -> DigitRange:
    """Draw models within the rounding of a print, evenly, and take the ranges.

    Args:
        name: Name of a printed model of one joint.

    Returns:
        The ranges; the same on every call.

    Raises:
        ScenarioError: There is no such model.
    """
    entry = published_model(name)
    if not isinstance(entry, PublishedModel):
        raise ValueError(f"{name!r} is a model of {len(entry.joints)} joints; expected one of a single joint")
    rng = np.random.default_rng(0)
    models = [entry.within_rounding(rng) for _ in range(DRAWS)]
    stable = [model for model in models if model.is_stable()]
    bandwidths = [float(model.bandwidth()[0, 0]) for model in stable]
    gains = [float(model.dc_gain()[0, 0]) for model in stable]
    return DigitRange((min(bandwidths), max(bandwidths)), (min(gains), max(gains)), len(stable) / DRAWS)
