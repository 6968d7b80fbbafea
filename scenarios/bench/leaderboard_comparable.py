"""Where results on one page are not comparable, or not whole."""

from collections.abc import Callable, Sequence

from scenarios.bench.leaderboard_entry import Entry
from scenarios.bench.leaderboard_reading import FIGURES
from scenarios.bench.leaderboard_response_error import compared, missing
from scenarios.bench.leaderboard_verdict import Verdict, verdict
from scenarios.estimators.outcome import MODEL, REFUSED
from scenarios.files.printable import one_line

CONDITIONS: dict[str, tuple[Callable[[Entry], str], str]] = {
    "seed": (
        lambda entry: str(entry.result.seed),
        "they saw different records, and differences within their intervals may be chance",
    ),
    "effort": (
        lambda entry: entry.result.effort,
        "their intervals and limits are of different numbers of records, and problems may differ",
    ),
    "limits": (
        lambda entry: f"{entry.result.limits.seconds:g} s and {entry.result.limits.memory_bytes / 2**20:.0f} MiB",
        "failures by time and memory do not compare",
    ),
    "protocol": (lambda entry: str(entry.result.protocol), "they were asked in different ways"),
    "version of the bench": (
        lambda entry: entry.result.versions.get("hmtb-twin", "not stated"),
        "problems, records and limits may differ",
    ),
    "machine": (
        lambda entry: entry.result.machine or "not stated",
        "speeds compare as multiples of the ruler only, and limits of time are not the same",
    ),
}
"""What must be equal for two rows to compare, how it is read from one, and what follows if it is not."""


def groups(entries: Sequence[Entry], condition: str) -> dict[str, list[Entry]]:
    """Entries by the value of a condition, in the order of the page."""
    read, _ = CONDITIONS[condition]
    found: dict[str, list[Entry]] = {}
    for entry in entries:
        found.setdefault(one_line(read(entry)), []).append(entry)
    return found


def runs(entries: Sequence[Entry]) -> list[list[Entry]]:
    """Entries that were run side by side; one whose file names no run stands alone."""
    found: dict[str, list[Entry]] = {}
    for entry in entries:
        found.setdefault(entry.result.run or f"\n{entry.number}", []).append(entry)
    return list(found.values())


def notes(entries: Sequence[Entry]) -> list[str]:
    """What a reader who compares rows must know, a sentence each; none where all is equal, whole and of one run."""
    said = []
    for condition, (_, consequence) in CONDITIONS.items():
        found = groups(entries, condition)
        if len(found) > 1:
            values = "; ".join(f"{value}: {names(group)}" for value, group in found.items())
            said.append(f"Rows differ in {condition}, so {consequence}. {values}.")
    together = runs(entries)
    if len(together) > 1:
        sides = [group for group in together if len(group) > 1]
        alone = [group[0] for group in together if len(group) == 1]
        parts = [f"run side by side: {names(group)}" for group in sides]
        parts += [f"each run on its own: {names(alone)}"] if alone else []
        said.append(
            "Rows are not all of one run, so compare their speeds as multiples of the ruler only. "
            + "; ".join(parts)[:1].upper()
            + "; ".join(parts)[1:]
            + "."
        )
    return said + incomplete(entries)


def incomplete(entries: Sequence[Entry]) -> list[str]:
    """What is not there to be compared: figures that were not made, what was not answered or could not be judged."""
    said = []
    parts: dict[int, list[Entry]] = {}
    for entry in entries:
        made = len(FIGURES.keys() & entry.result.figures)
        if made < len(FIGURES):
            parts.setdefault(made, []).append(entry)
    if parts:
        told = "; ".join(
            f"{made} of {len(FIGURES)}: {'all rows' if len(group) == len(entries) > 1 else names(group)}"
            for made, group in parts.items()
        )
        said.append(f"Rows without all figures, of which fewer could pass or fail. {told}.")
    for entry in entries:
        if not entry.result.outcomes.get(MODEL):
            ends = ", ".join(
                f"{n} × {one_line(kind).replace('_', ' ')}" for kind, n in entry.result.outcomes.items() if n
            )
            said.append(f"{entry.name} gave no model at all ({ends or 'no request'}): it has not passed anything.")
        elif all(verdict(figure) is Verdict.NONE for figure in entry.result.figures.values()):
            said.append(f"Nothing of {entry.name} could be judged: it has not passed anything.")
    return said + unanswered(entries)


def unanswered(entries: Sequence[Entry]) -> list[str]:
    """Who is judged by a part of the requests only."""
    problems = compared(entries)
    refused: dict[str, list[Entry]] = {}
    absent: dict[str, list[Entry]] = {}
    for entry in entries:
        outcomes = entry.result.outcomes
        if not outcomes.get(MODEL):
            continue
        if number := outcomes.get(REFUSED, 0):
            of = ", ".join(f"{times} × {one_line(kind)}" for kind, times in entry.result.refused.items() if times)
            told = f"{number} of {sum(outcomes.values())} requests{f' ({of})' if of else ''}"
            refused.setdefault(told, []).append(entry)
        if lacking := missing(entry, problems):
            absent.setdefault(", ".join(map(one_line, lacking)), []).append(entry)
    said = [
        f"{names(group)} refused {told}, and {'is' if len(group) == 1 else 'are'} judged by the others only."
        for told, group in refused.items()
    ]
    return said + [
        f"{names(group)} answered too few records of {lacking} for a verdict: no response error, and all other "
        "numbers are of what was answered."
        for lacking, group in absent.items()
    ]


def names(entries: Sequence[Entry]) -> str:
    """Names of entries in a sentence."""
    return ", ".join(entry.name for entry in entries)
