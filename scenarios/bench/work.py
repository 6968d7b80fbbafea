"""Work of a run in pieces that any process can do: the trials on one record, for all contestants that need them."""

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from scenarios.bench.measurement import Measurement
from scenarios.estimators.contestant import Contestant, Limits
from scenarios.problems.trial import ASKS, Trial

FAMILY = re.compile("[-@]")
"""What ends the first word of a problem's name."""


@dataclass(frozen=True)
class Bench:
    """What all pieces share.

    Attributes:
        contestants: In the sequence by which pieces number them.
        limits: Of each answer.
        seed: Of the run.
        records: Folder of records that were simulated before; None: there is none.
    """

    contestants: tuple[Contestant, ...]
    limits: Limits
    seed: int
    records: Path | None = None


@dataclass(frozen=True)
class Piece:
    """The trials on one record; contestants are asked in turn, so that what disturbs one disturbs all.

    Attributes:
        problem: Name of the problem.
        draw: Number of the record.
        asked: What is asked of whom: (ask, number of the contestant).
    """

    problem: str
    draw: int
    asked: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class Done:
    """A trial that is done.

    Attributes:
        contestant: Number of the contestant.
        measured: What was measured.
        wall: Time that it took, its share of drawing the record included, s.
    """

    contestant: int
    measured: Measurement
    wall: float


def pieces(wanted: Sequence[Iterable[Trial]], done: Sequence[Collection[str]]) -> tuple[Piece, ...]:
    """Part what is left of a run into pieces, sorted by draw: the first draws of all problems come first.

    Args:
        wanted: Trials of each contestant.
        done: Keys of those that are done already, by contestant.
    """
    asked: dict[tuple[int, str], list[tuple[str, int]]] = {}
    for number, (trials, there) in enumerate(zip(wanted, done, strict=True)):
        for trial in trials:
            if trial.key not in there:
                asked.setdefault((trial.draw, trial.problem), []).append((trial.ask, number))
    return tuple(
        Piece(problem, draw, tuple(sorted(whom, key=lambda one: (ASKS.index(one[0]), one[1]))))
        for (draw, problem), whom in sorted(asked.items())
    )


def spread(some: Iterable[Piece]) -> tuple[Piece, ...]:
    """Pieces in a sequence in which those of each family of problems are evenly spread.

    A family is what names begin with. What goes wrong on one family alone is then never seen many times in a row.
    """
    families: dict[str, list[Piece]] = {}
    for piece in some:
        families.setdefault(FAMILY.split(piece.problem)[0], []).append(piece)
    places = [
        ((place + 0.5) / len(family), name, piece)
        for name, family in families.items()
        for place, piece in enumerate(family)
    ]
    return tuple(piece for _, _, piece in sorted(places, key=lambda one: one[:2]))
