"""Figures of the test bench by name."""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace

from scenarios.bench.metric import FigureMaker
from scenarios.bench.metrics import ALL_FIGURES
from scenarios.files.errors import ScenarioError, unknown

OTHERS = "others"
"""Attribute of figures that rest on the trials of other figures."""


def figures_of(names: Sequence[str]) -> tuple[FigureMaker, ...]:
    """Figures in their usual sequence.

    Those that rest on the trials of all others rest on those of the chosen ones here, where there are any.

    Args:
        names: Their names; empty for all.

    Raises:
        ScenarioError: There is none of a name.
    """
    known = {maker.name: maker for maker in ALL_FIGURES}
    for name in names:
        if name not in known:
            raise ScenarioError(unknown("figure", name, known))
    if not names:
        return ALL_FIGURES
    chosen = [maker for maker in ALL_FIGURES if maker.name in names]
    own = tuple(maker for maker in chosen if not _rests_on_others(maker))
    return tuple(replace(maker, others=own) if own and _rests_on_others(maker) else maker for maker in chosen)  # type: ignore[type-var]


def _rests_on_others(maker: FigureMaker) -> bool:
    return is_dataclass(maker) and OTHERS in {one.name for one in fields(maker)}
