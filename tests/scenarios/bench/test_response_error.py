"""The response error compares: every row over the same problems, none better by what it left out."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenarios.bench.leaderboard_drawings import work_precision
from scenarios.bench.leaderboard_notes import notes
from scenarios.bench.leaderboard_rows import LeaderboardRow, common_problems, ranked
from scenarios.bench.leaderboard_tables import standing
from scenarios.bench.result import Result

Save = Callable[[Path, Result], Path]
ERRORS = {"p2": 0.1, "p3": 8.0, "p4": 0.3, "p5": 0.9}


def errors(made: Result, found: dict[str, float], *, asked: Sequence[str] = ()) -> Result:
    """A result with these errors of the response, in percent; what was asked and not answered is a part of it."""
    figure = made.figures["frequency_response"]
    curve = figure.curves["p2"]
    curves = {name: {**curve, "relative_error_percent": value} for name, value in found.items()}
    parts = tuple(replace(figure.parts[0], label=name) for name in asked or found)
    return replace(made, figures={**made.figures, figure.name: replace(figure, curves=curves, parts=parts)})


@pytest.fixture
def board(written: list[Path], results: tuple[Result, ...], saved: Save) -> Callable[..., dict[str, LeaderboardRow]]:
    def make(armax: Result, oe: Result | None = None) -> dict[str, LeaderboardRow]:
        paths = [saved(written[1], armax), saved(written[2], oe or errors(results[2], ERRORS))]
        return {entry.name: entry for entry in ranked(paths)}

    return make


def cells(entries: dict[str, LeaderboardRow]) -> dict[str, str]:
    table = standing(list(entries.values()))
    column = table.columns.index("Response error / %")
    return {name: row[column].text for name, row in zip(entries, table.rows, strict=True)}


def test_what_was_not_answered_is_no_advantage(
    board: Callable[..., dict[str, LeaderboardRow]], results: tuple[Result, ...]
) -> None:
    easy = {name: value for name, value in ERRORS.items() if name != "p3"}
    entries = board(errors(results[1], easy, asked=tuple(ERRORS)))
    assert cells(entries) == {"armax": "– (3 of 4)", "oe": "0.6"}
    both = list(entries.values())
    drawn = work_precision(both)
    assert drawn is not None
    assert drawn[1].endswith("Not drawn, since a number of theirs is missing: armax.")
    assert "asked of all rows (p2, p3, p4, p5)" in drawn[1]
    assert len(drawn[0].axes[0].lines) == 2  # of one estimator
    (note,) = notes(both)
    assert note.startswith("armax answered too few records of p3 for a verdict: no response error")


def test_what_too_few_records_answer_is_not_answered(
    board: Callable[..., dict[str, LeaderboardRow]], results: tuple[Result, ...]
) -> None:
    whole = errors(results[1], ERRORS)
    figure = whole.figures["efficiency"]
    parts = tuple(replace(p, passed=None, draws=9) if p.label == "p5" else p for p in figure.parts)
    figures = {**whole.figures, figure.name: replace(figure, parts=parts)}
    assert cells(board(replace(whole, figures=figures)))["armax"] == "– (3 of 4)"
    assert cells(board(whole))["armax"] == "0.6"


def test_what_was_not_asked_of_all_does_not_count(
    board: Callable[..., dict[str, LeaderboardRow]], results: tuple[Result, ...]
) -> None:
    """Another effort, or a structure that cannot hold a system, asks other problems."""
    entries = board(errors(results[1], {**ERRORS, "mimo": 70.0, "random-easy-1": 50.0}))
    both = list(entries.values())
    assert common_problems(both) == tuple(ERRORS)
    assert cells(entries) == {"armax": "0.6", "oe": "0.6"}
    assert notes(both) == []
    assert entries["armax"].median_error(("p2", "mimo", "p3")) == 8.0
    assert np.isnan(entries["oe"].median_error(("p2", "mimo", "p3")))


def test_rows_that_were_asked_nothing_in_common_have_none(
    board: Callable[..., dict[str, LeaderboardRow]], results: tuple[Result, ...]
) -> None:
    entries = board(errors(results[1], {"p2": 0.1}), errors(results[2], {"p3": 0.1}))
    assert cells(entries) == {"armax": "–", "oe": "–"}
    assert work_precision(list(entries.values())) is None
    assert "no problem was asked of all rows" in standing(list(entries.values())).caption
