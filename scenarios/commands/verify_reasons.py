"""Why figures of `hmtb verify` fail: a block for each with its worst parts; all that fail where that is wanted."""

import math
import shutil
import textwrap
from collections.abc import Iterable, Sequence

from scenarios.bench.consistency import WHERE_IT_FAILS
from scenarios.bench.leaderboard_verdict import INFORMATIVE, Verdict, part_verdict, verdict
from scenarios.bench.metric import Metric, Part, excess
from scenarios.commands.output import say
from scenarios.commands.verify_numbers import limits, number

SHOWN_PARTS = 5
"""Parts of a figure that are printed, where not all are wanted."""

WIDEST, INDENT = 120, "    "
"""Of lines of text."""


def show_reasons(figures: Iterable[Metric], *, verbose: bool) -> None:
    """Print a block for each figure that does not simply pass.

    Args:
        figures: The figures.
        verbose: All figures, with all that their verdicts rest on, and all parts that fail.
    """
    told: dict[str, str] = {}
    for figure in figures:
        found = verdict(figure)
        if verbose:
            failed = [part for part in figure.parts if part.passed is False]
            _block(figure, [figure.why], failed, most=len(failed))
            continue
        if found is Verdict.NONE and figure.name not in INFORMATIVE:
            say(wrapped(f"{found.sign} {figure.title}: {figure.why.rpartition('; ')[2]}", INDENT))
        parts = [part for part in figure.parts if part_verdict(part) is found] if _fails(found) else []
        if found is Verdict.FAILS:
            measures, *more = figure.why.split("; ")
            _block(figure, [measures, *(one for one in more if one.startswith(WHERE_IT_FAILS))], parts)
        elif found is Verdict.FAILS_AS_THEORY_SAYS:
            _block(figure, _reasons(figure, parts, told), parts)
    say("")


def _fails(found: Verdict) -> bool:
    return found in (Verdict.FAILS, Verdict.FAILS_AS_THEORY_SAYS)


def _reasons(figure: Metric, parts: Sequence[Part], told: dict[str, str]) -> list[str]:
    """What theory says, each of it in full only once."""
    short = figure.title.partition(":")[0]
    reasons = []
    for why in dict.fromkeys(part.why for part in parts if part.why):
        first = told.setdefault(why, short)
        reasons.append(why if first == short else f"theory says the same as of “{first}”")
    return list(dict.fromkeys(reasons))


def _block(figure: Metric, reasons: Sequence[str], parts: Sequence[Part], *, most: int = SHOWN_PARTS) -> None:
    found = verdict(figure)
    say(f"{found.sign} {figure.title}: {found.word}")
    for reason in reasons:
        say(wrapped(INDENT + reason, INDENT))
    shown = sorted(parts, key=lambda part: -excess(part))[:most]
    rows = [(part.label, number(part.value)) for part in shown]
    widths = [max((len(row[place]) for row in rows), default=0) for place in (0, 1)]
    for (label, value), part in zip(rows, shown, strict=True):
        mark = f" {part_verdict(part).sign}" if part_verdict(part) is not found else ""
        say(wrapped(f"{INDENT}{label:<{widths[0]}}  {value:>{widths[1]}}  {_rests_on(part)}{mark}", 2 * INDENT))
    if len(parts) > len(shown):
        say(f"{INDENT}and {len(parts) - len(shown)} more: --verbose has them")


def _rests_on(part: Part) -> str:
    """Its limit in words, or why it fails without one."""
    low, high = part.limits
    if math.isinf(low) and math.isinf(high):
        return part.why
    both = math.isfinite(low) and math.isfinite(high) and low != high
    return f"limit{'s' * both}: {limits(part.limits)}"


def wrapped(text: str, indent: str = "") -> str:
    """Text in lines as wide as the terminal.

    Args:
        text: The text.
        indent: Of all lines but the first.
    """
    width = min(WIDEST, shutil.get_terminal_size((WIDEST, 24)).columns)
    return textwrap.fill(text, max(40, width), subsequent_indent=indent, break_on_hyphens=False)
