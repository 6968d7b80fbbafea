"""Numbers of the study that do not hold, for the section of the report that lists them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from scenarios.identification.recovered_bandwidth import near_1_hz
from scenarios.thesis.comparison import Comparison, ModelResult
from scenarios.truth.published import PublishedModel


class MissedInterval(NamedTuple):
    """A bandwidth that disagrees with the best linear truth; how far, in percent and half widths of the interval."""

    joint: str
    label: str
    percent: float
    half_widths: float


@dataclass(frozen=True)
class Shortcomings:
    """Numbers of the report that do not hold.

    Attributes:
        missed_intervals: Bandwidths that disagree with the best linear truth, the farthest first.
        identified: Number of identified models.
        printed: Number of printed models.
        identified_far: Identified models, with their joint, that are not near 1 Hz.
        printed_far: Printed models, with their joint, that are not near 1 Hz.
    """

    missed_intervals: Sequence[MissedInterval]
    identified: int
    printed: int
    identified_far: Sequence[tuple[str, ModelResult]]
    printed_far: Sequence[tuple[str, PublishedModel]]


def shortcomings(study: Comparison) -> Shortcomings:
    """Collect the numbers of a study that do not hold."""
    missed: list[MissedInterval] = []
    identified_far: list[tuple[str, ModelResult]] = []
    printed_far: list[tuple[str, PublishedModel]] = []
    identified = printed = 0
    for joint, result in study.joints.items():
        identified += len(result.models)
        printed += len(result.published)
        for model in result.models.values():
            if not model.covers:
                distance = model.bandwidth_hz - result.best_linear.hz
                # By the width alone: the bandwidth need not lie in the middle of its interval.
                half_widths = 2 * abs(distance) / float(np.ptp(model.ci95))
                missed.append(MissedInterval(joint, model.label, 100 * distance / result.best_linear.hz, half_widths))
            if not near_1_hz(model.bandwidth_hz):
                identified_far.append((joint, model))
        printed_far += [(joint, model) for model in result.published if not near_1_hz(model.bandwidth_hz)]
    missed.sort(key=lambda interval: -abs(interval.percent))
    return Shortcomings(missed, identified, printed, identified_far, printed_far)
