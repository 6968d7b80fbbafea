"""Tolerance of a method: the degree of a disturbance up to which its models stay comparable to the clean record's."""

from dataclasses import dataclass
from statistics import median

from scenarios.thesis.disturbances import AS_IT_IS, DISTURBANCES
from scenarios.thesis.robustness_outcome import Robustness, RobustnessOutcome

COMPARABLE = (10.0, 5.0)
"""A model is comparable to the one from the clean record when its bandwidth moves by at most so many percent and its
median fit in simulation to records of other waveforms falls by at most so many points."""

NO_BANDWIDTH = 100.0
"""Percent that a bandwidth counts as moved by where the spoilt record gives none."""


@dataclass(frozen=True)
class Tolerance:
    """Tolerance of a method to a disturbance on one joint.

    Attributes:
        degree: The largest degree up to which every one tried is tolerated, in the disturbance's unit; None where the
            smallest is not.
        everything: Whether the largest one tried is tolerated.
    """

    degree: float | None
    everything: bool


def clean(found: Robustness, joint: str, method: str) -> RobustnessOutcome:
    """The model from the record as it is."""
    return found.of("bias", joint, method)[0.0][0]


def shift(entry: RobustnessOutcome, reference: RobustnessOutcome) -> float:
    """Percent by which the bandwidth moves."""
    return NO_BANDWIDTH if entry.failure else 100 * abs(entry.bandwidth_hz / reference.bandwidth_hz - 1)


def comparable(entries: tuple[RobustnessOutcome, ...], reference: RobustnessOutcome) -> bool:
    """Whether the median draw stays comparable; a record that the estimator refuses does not."""
    percent, points = COMPARABLE
    if any(entry.failure == "refused" for entry in entries):
        return False
    return (
        median(shift(entry, reference) for entry in entries) <= percent
        and median(reference.fit - entry.fit for entry in entries) <= points
    )


def tolerance(
    found: Robustness, disturbance: str, joint: str, method: str, treatment: str = AS_IT_IS[0]
) -> Tolerance | None:
    """Find how much is tolerated.

    Args:
        found: The experiment.
        disturbance: Key of the disturbance.
        joint: The joint.
        method: The method.
        treatment: What is taken off the record before.

    Returns:
        The tolerance; None where it was not tried.
    """
    kind = DISTURBANCES[disturbance]
    draws = found.of(disturbance, joint, method, treatment)
    tried = sorted((d for d in draws if d or kind.decibel), reverse=kind.falling)
    if not tried:
        return None
    reference = clean(found, joint, method)
    last = None
    for degree in tried:
        if not comparable(draws[degree], reference):
            return Tolerance(last, False)
        last = degree
    return Tolerance(last, True)
