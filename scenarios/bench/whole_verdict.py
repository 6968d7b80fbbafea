"""The verdict of all figures of an estimator together."""

import math
from collections.abc import Mapping

from scenarios.bench.metric import Figure

OF_ANY_ANSWER = ("reliability", "speed", "bandwidth")
"""Figures that say nothing of whether a model is right."""


def all_pass(figures: Mapping[str, Figure]) -> bool:
    """Whether no figure fails that theory expects to pass, and something was judged at all.

    An estimator that refuses everything, or of whose models too few are there for any verdict, has not passed. Where
    only figures are wanted that say nothing of whether a model is right, one of them must at least have a value.

    Args:
        figures: By name.
    """
    if any(figure.passed is False for figure in figures.values()):
        return False
    judging = [figure for name, figure in figures.items() if name not in OF_ANY_ANSWER]
    if not judging:
        return any(math.isfinite(figure.value) for figure in figures.values())
    return any(map(has_verdict, judging))


def has_verdict(figure: Figure) -> bool:
    """Whether something of a figure was judged, be it only what theory expects to fail."""
    return figure.passed is not None or any(part.passed is not None for part in figure.parts)
