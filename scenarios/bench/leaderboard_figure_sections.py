"""The sections of the figures: how each is read, its numbers by problem, its drawing."""

from collections.abc import Sequence
from dataclasses import dataclass

from scenarios.bench.leaderboard_drawings import drawing
from scenarios.bench.leaderboard_entry import Entry
from scenarios.bench.leaderboard_reading import FIGURES
from scenarios.bench.leaderboard_table import Table
from scenarios.bench.leaderboard_tables import by_part, figure_names, title
from scenarios.report.figures import Gallery, Picture


@dataclass(frozen=True)
class FigureSection:
    """A figure of the bench on the page.

    Attributes:
        mark: Anchor.
        title: Heading.
        measures: What it measures and when it passes; empty for one that this version does not know.
        blind: What it cannot see.
        false_alarm: The largest probability with which a perfect estimator fails it in one of these runs.
        table: Its numbers by problem, or None.
        picture: Its drawing, or None.
    """

    mark: str
    title: str
    measures: str
    blind: str
    false_alarm: float
    table: Table | None
    picture: Picture | None


def figure_sections(entries: Sequence[Entry], gallery: Gallery) -> list[FigureSection]:
    """A section for each figure that any row has."""
    return [_section(entries, name, number, gallery) for number, name in enumerate(figure_names(entries), 1)]


def _section(entries: Sequence[Entry], name: str, number: int, gallery: Gallery) -> FigureSection:
    reading = FIGURES.get(name)
    rates = [figure.false_alarm for entry in entries if (figure := entry.figure(name))]
    return FigureSection(
        mark=f"figure-of-bench-{number}",
        title=title(entries, name),
        measures=reading.measures if reading else "This version of the page does not know this figure.",
        blind=reading.blind if reading else "",
        false_alarm=max(rates, default=0.0),
        table=by_part(entries, name),
        picture=drawing(entries, name, gallery),
    )
