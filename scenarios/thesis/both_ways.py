"""Verdicts on fits, always both ways [Morris1996, ch. VI].

The thesis does not say whether its fits are simulations or one-step predictions. A model with K = 0 cannot predict:
beside one that can it looks worse one step ahead for no better reason than that.
"""

from collections.abc import Mapping

from scenarios.thesis.finding import Verdict, verdict
from scenarios.thesis.multivariable import WAYS, ThreeJointModel, Way

WORDS: Mapping[Way, str] = {"simulation": "in simulation", "one_step": "one step ahead"}


def both_ways(passed: Mapping[Way, int], total: int) -> tuple[Verdict, str]:
    """A verdict that holds both ways, or `partly` and a sentence that it depends on the way.

    Args:
        passed: Parts that hold, in simulation and one step ahead.
        total: Parts there are.

    Returns:
        The verdict and what to say of it.
    """
    found = {way: verdict(passed[way], total) for way in WAYS}
    counts = " and ".join(f"{passed[way]} of {total} parts hold {WORDS[way]}" for way in WAYS)
    if len(set(found.values())) == 1:
        return found["simulation"], f"{counts}: the verdict does not depend on which of them the thesis means"
    return "partly", (
        f"{counts}: the verdict depends on which of them the thesis means, "
        f"{found['simulation']} {WORDS['simulation']}, {found['one_step']} {WORDS['one_step']}"
    )


def readings(found: Mapping[str, Verdict]) -> tuple[Verdict, str]:
    """One verdict of several readings of a claim: theirs where they agree, else `partly`.

    Args:
        found: Verdict by reading, in words that follow "is".

    Returns:
        The verdict and what to say of it.
    """
    said = ", ".join(f"{decision} {reading}" for reading, decision in found.items())
    if len(set(found.values())) == 1:
        return next(iter(found.values())), f"{said}: the verdict does not depend on the reading"
    return "partly", f"{said}: the verdict depends on the reading"


def without_noise_model(model: ThreeJointModel) -> str:
    """Which joints of a model cannot predict."""
    mute = [joint.replace("_", " ") for joint in model.blocks if not model.predicts(joint)]
    if not mute:
        return f"every joint of the {model.name} has a noise model"
    return f"the {model.name} has K = 0 on {' and '.join(mute)}, where one step ahead is simulation again"
