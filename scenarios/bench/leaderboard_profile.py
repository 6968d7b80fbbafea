"""What the page says of one estimator."""

from collections.abc import Sequence
from dataclasses import dataclass

from scenarios.bench.leaderboard_entry import Entry
from scenarios.bench.leaderboard_reading import FIGURES
from scenarios.bench.leaderboard_table import Cell, Table, number, number_cell, pair, verdict_cell
from scenarios.bench.leaderboard_tables import figure_names
from scenarios.bench.leaderboard_verdict import Verdict, part_verdict, verdict
from scenarios.estimators.contestant import METHODS
from scenarios.estimators.outcome import KINDS
from scenarios.files.printable import one_line

COLUMNS = ("Figure", "Problem", "Verdict", "Value", "95 % interval", "Passes", "Records", "Why")


@dataclass(frozen=True)
class Profile:
    """One estimator.

    Attributes:
        entry: Its row.
        facts: What it is and how it was run, as pairs of words.
        command: The command line that makes its row again.
        figures: Its verdicts, one line each.
        failing: Parts that did not pass, and those that pass although theory says that they fail; None without any.
        outcomes: How its requests ended, in words.
        reasons: The commonest reasons of failures, with how often.
    """

    entry: Entry
    facts: tuple[tuple[str, str], ...]
    command: str
    figures: Table
    failing: Table | None
    outcomes: tuple[tuple[str, str], ...]
    reasons: tuple[tuple[str, int], ...]


def profile(entry: Entry) -> Profile:
    """What is told of an estimator."""
    result = entry.result
    kinds = [*KINDS, *sorted(set(result.outcomes) - set(KINDS))]
    return Profile(
        entry=entry,
        facts=tuple((word, one_line(text)) for word, text in _facts(entry) if text),
        command=one_line(result.command),
        figures=_figures(entry),
        failing=_failing(entry),
        outcomes=tuple(
            (f"{result.outcomes[kind]} × {one_line(kind).replace('_', ' ')}", KINDS.get(kind, ""))
            for kind in kinds
            if result.outcomes.get(kind)
        ),
        reasons=tuple((one_line(text), times) for text, times in sorted(result.reasons.items(), key=lambda r: -r[1])),
    )


def _facts(entry: Entry) -> Sequence[tuple[str, str]]:
    result, contestant = entry.result, entry.result.contestant
    kind = "program" if contestant.program else "function"
    stays = ", started once for all requests" if contestant.stays else ""
    return (
        ("Called", f"{kind} {contestant.target}{stays}"),
        ("Version", contestant.version or "not stated"),
        ("Settings", contestant.settings or "none stated"),
        ("Structure", contestant.structure or "the one that is asked"),
        ("Method", METHODS.get(contestant.method or "", contestant.method or "not stated: all is expected of it")),
        ("Run", f"{result.effort}, seed {result.seed}, protocol {result.protocol}"),
        ("Limits", f"{result.limits.seconds:g} s and {result.limits.memory_bytes / 2**20:.0f} MiB for each answer"),
        ("Processor time", f"{number(result.seconds)} s for all answers"),
        ("Machine", result.machine or "not stated"),
        ("Versions", ", ".join(f"{name} {version}" for name, version in result.versions.items())),
        ("SHA-256 of its source", result.source or "none: it has no file of its own"),
        ("File", entry.path.name),
    )


def _figures(entry: Entry) -> Table:
    rows = []
    for name in figure_names([entry]):
        figure = entry.result.figures[name]
        rows.append(
            (
                Cell(one_line(figure.title) or one_line(name)),
                verdict_cell(verdict(figure)),
                number_cell(figure.value),
                number_cell(figure.expected),
                Cell(pair(figure.interval)),
                Cell(one_line(figure.unit)),
                Cell(one_line(figure.why)),
            )
        )
    caption = "Its figures: each by the part furthest beyond its limits, or nearest to them"
    columns = ("Figure", "Verdict", "Value", "Expected", "95 % interval", "Unit", "Why")
    return Table(caption, columns, tuple(rows), (False,) * 2 + (True,) * 3 + (False,) * 2, False)


def _failing(entry: Entry) -> Table | None:
    rows = []
    for name in figure_names([entry]):
        for part in entry.result.figures[name].parts:
            found = part_verdict(part)
            unexpected = found is Verdict.PASSES and not part.theory
            if found in (Verdict.PASSES, Verdict.NONE) and not unexpected:
                continue
            reason = f"theory says that it fails: {part.why}" if unexpected else part.why
            rows.append(
                (
                    Cell(FIGURES[name].short if name in FIGURES else one_line(name)),
                    Cell(one_line(part.label)),
                    verdict_cell(found),
                    number_cell(part.value),
                    Cell(pair(part.interval)),
                    Cell(pair(part.limits)),
                    Cell(str(part.draws)),
                    Cell(one_line(reason)),
                )
            )
    if not rows:
        return None
    numeric = (False, False, False, True, True, True, True, False)
    return Table(
        "Where it does not pass, and where it does though theory says that it fails",
        COLUMNS,
        tuple(rows),
        numeric,
        False,
    )
