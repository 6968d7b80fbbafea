"""How estimators look in the figures of the leaderboard: each the same in all."""

import textwrap
from collections.abc import Sequence

from scenarios.bench.leaderboard_entry import Entry
from sysid.plots.palette import PALETTE, Style

NOT_METHODS = ("truth", "measured", "bla", "published", "welch", "etfe", "cra", "spa")
"""Styles that mean something else everywhere."""

WIDEST = 18
"""Characters of a name on one line of a figure."""


def styles(entries: Sequence[Entry]) -> dict[int, Style]:
    """Style of each estimator by its number: that of the method that its name ends in, else one that is free.

    When there are more estimators than styles, styles repeat; figures name each by its number too.
    """
    methods = {name: style for name, style in PALETTE.items() if name not in NOT_METHODS}
    found: dict[int, Style] = {}
    free = dict(methods)
    for entry in entries:
        words = "_" + entry.name.lower().replace("-", "_")
        named = [name for name in free if words.endswith(f"_{name}")]
        if named:
            found[entry.number] = free.pop(max(named, key=len))
    spare = list(free.values()) or list(methods.values())
    others = [entry for entry in entries if entry.number not in found]
    found |= {entry.number: spare[k % len(spare)] for k, entry in enumerate(others)}
    return found


def label(entry: Entry, width: int = WIDEST) -> str:
    """Number and name on at most two lines of a figure; the number tells names apart that are cut."""
    lines = textwrap.wrap(entry.title, width, max_lines=2, placeholder="…")
    return literal("\n".join(lines))


def literal(text: str) -> str:
    """Text that matplotlib shall not read as a formula."""
    return text.replace("\\", "\N{REVERSE SOLIDUS OPERATOR}").replace("$", r"\$")
