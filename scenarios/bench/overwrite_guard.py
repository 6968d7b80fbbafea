"""A run never takes the place of a fuller one: which figures and records of a result another run would not have."""

import re
from collections.abc import Sequence

from scenarios.bench.metric import DRAWS, MetricDefinition
from scenarios.bench.result import Result
from scenarios.problems.trial import Trial

MOST_NAMED = 4
"""Figures that are named; more are counted."""

EFFORT = re.compile(rf"({'|'.join(DRAWS)})(?:, at most (\d{1, 9}) records? of a problem)?")


def told_effort(effort: str, records: int | None) -> str:
    """An effort in words, as results have it.

    Args:
        effort: One of `DRAWS`.
        records: At most so many of each problem; None: all.
    """
    return effort if records is None else f"{effort}, at most {records} record{'s' * (records > 1)} of a problem"


def trials_within(maker: MetricDefinition, effort: str, records: int | None) -> tuple[Trial, ...]:
    """Trials of a figure with at most so many records of each problem; see `told_effort`."""
    every = maker.trials(effort)
    return every if records is None else tuple(trial for trial in every if trial.draw < records)


def lost(there: Result, figures: Sequence[MetricDefinition], effort: str, records: int | None) -> str:
    """What a result has that a run would not, in words; empty where the run has it all.

    Args:
        there: The result.
        figures: Of the run.
        effort: Of the run; see `told_effort`.
        records: Of the run.
    """
    makers = {maker.name: maker for maker in figures}
    gone = [name for name in there.figures if name not in makers]
    if gone:
        named = ", ".join(gone) if len(gone) <= MOST_NAMED else f"{len(gone)} of its {len(there.figures)}"
        return f"figures that this run does not make ({named})"
    known = EFFORT.fullmatch(there.effort) if isinstance(there.effort, str) else None  # anyone may have written it
    if known is None:
        return ""
    its_effort, its_records = known[1], int(known[2]) if known[2] else None
    for maker in (makers[name] for name in there.figures):
        if set(trials_within(maker, its_effort, its_records)) - set(trials_within(maker, effort, records)):
            return f"records that this run does not ask ({there.effort}; now {told_effort(effort, records)})"
    return ""
