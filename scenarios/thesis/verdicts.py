"""Rules that turn fits into verdicts: the margin of a tie, held-out fits and the multivariable comparison."""

from collections.abc import Mapping
from statistics import median
from typing import Any

from scenarios.files.errors import MissingRecordError
from scenarios.thesis.comparison import Comparison, ModelResult
from scenarios.thesis.estimates import Fits
from scenarios.thesis.finding import Verdict, verdict
from scenarios.thesis.multivariable import WAYS, ThreeJointModel, Way

MARGIN = 0.2
"""Fits that differ by less are tied, percentage points: the thesis reads fits off its plots to no more digits."""


def ahead(difference: float) -> bool:
    """Whether a fit is ahead of another by more than a tie.

    Args:
        difference: The fit less the other, percentage points.
    """
    return difference >= MARGIN


def tied(difference: float) -> bool:
    """Whether two fits are tied.

    Args:
        difference: One fit less the other, percentage points.
    """
    return abs(difference) < MARGIN


def comparison_word(difference: float) -> str:
    """`ahead`, `tied` or `behind` in words.

    Args:
        difference: One fit less the other, percentage points.
    """
    return "tied" if tied(difference) else ("ahead" if difference > 0 else "behind")


def held_out(study: Comparison, model: ModelResult) -> float:
    """Median fit of simulations to the held-out tests, percent.

    Raises:
        MissingRecordError: There is no such test.
    """
    return median(fit.simulation for fit in _fits(study, model))


def held_out_one_step(study: Comparison, model: ModelResult) -> float:
    """Median fit of one-step predictions to the held-out tests, percent.

    Raises:
        MissingRecordError: There is no such test.
    """
    return median(fit.one_step for fit in _fits(study, model))


def _fits(study: Comparison, model: ModelResult) -> tuple[Fits, ...]:
    fits = model.held_out(study.estimation_test)
    if not fits:
        raise MissingRecordError(
            f"{model.label} has no test to be judged on: there is none beside test {study.estimation_test} and those "
            "of the same sequence"
        )
    return fits


WORDS: Mapping[Way, str] = {"simulation": "in simulation", "one_step": "one step ahead"}


def verdict_by_reading(passed: Mapping[str, tuple[int, int]]) -> tuple[Verdict, str]:
    """Combine the verdicts of a claim's readings from the parts that hold under each.

    Args:
        passed: By reading, in words that follow a verdict: the number of parts that hold, and of all.

    Returns:
        The verdict where all readings agree, else `partly`; and a sentence.
    """
    verdicts = {reading: verdict(*counts) for reading, counts in passed.items()}
    text = ", ".join(
        f"{verdicts[reading]} {reading} ({count} of {total} parts)" for reading, (count, total) in passed.items()
    )
    same = len(set(verdicts.values())) == 1
    return _common_verdict(verdicts), f"{text}: " + (
        "the same by every reading" if same else "the verdict depends on the reading"
    )


def verdict_of_readings(verdicts: Mapping[str, Verdict]) -> tuple[Verdict, str]:
    """Combine the verdicts of several readings: the common verdict, or `partly`, and a sentence.

    Args:
        verdicts: By reading, in words that follow "is".
    """
    text = ", ".join(f"{decision} {reading}" for reading, decision in verdicts.items())
    same = len(set(verdicts.values())) == 1
    return _common_verdict(verdicts), f"{text}: the verdict {'does not depend' if same else 'depends'} on the reading"


def verdict_by_way(passed: Mapping[Way, int], total: int) -> tuple[Verdict, str]:
    """Judge a claim on fits in simulation and one step ahead [Morris1996, ch. VI].

    The thesis does not say which of them its fits are. A model with K = 0 cannot predict: beside one that can it looks
    worse one step ahead for no better reason than that.

    Args:
        passed: Number of parts that hold each way.
        total: Number of parts.

    Returns:
        The verdict where both ways agree, else `partly`; and a sentence.
    """
    verdicts = {way: verdict(passed[way], total) for way in WAYS}
    counts = " and ".join(f"{passed[way]} of {total} parts hold {WORDS[way]}" for way in WAYS)
    if len(set(verdicts.values())) == 1:
        return _common_verdict(verdicts), f"{counts}: the verdict does not depend on which of them the thesis means"
    each = ", ".join(f"{verdicts[way]} {WORDS[way]}" for way in WAYS)
    return _common_verdict(verdicts), f"{counts}: the verdict depends on which of them the thesis means, {each}"


def _common_verdict(verdicts: Mapping[Any, Verdict]) -> Verdict:
    return next(iter(verdicts.values())) if len(set(verdicts.values())) == 1 else "partly"


def without_noise_model(model: ThreeJointModel) -> str:
    """Name the joints of a model that cannot predict."""
    mute = [joint.replace("_", " ") for joint in model.blocks if not model.predicts(joint)]
    if not mute:
        return f"every joint of the {model.name} has a noise model"
    return f"the {model.name} has K = 0 on {' and '.join(mute)}, where one step ahead is simulation again"
