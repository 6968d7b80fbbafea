"""What a run costs, told before it begins: from a few trials of each kind of problem that are done first."""

import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.bench.work import Done, Piece

WAVEFORM = re.compile(r"-w\d+")
"""What tells apart problems that cost the same."""


@dataclass(frozen=True)
class Cost:
    """What is still to do.

    Attributes:
        calls: Requests to estimators.
        core_seconds: Time of one core, s.
        wall: Time with all workers, s.
        disk: Size of what is written, bytes.
    """

    calls: int
    core_seconds: float
    wall: float
    disk: float

    def __str__(self) -> str:
        return (
            f"{self.calls} requests, {told_time(self.core_seconds)} of one core, about {told_time(self.wall)} with all "
            f"workers, {self.disk / 2**20:.0f} MiB of journals"
        )


class Pilot:
    """Learns from trials that are done what others will cost."""

    def __init__(self) -> None:
        self._walls: dict[tuple[str, str, int], list[float]] = defaultdict(list)
        self._bytes: list[int] = []

    def learn(self, done: Done) -> None:
        """Take note of a trial."""
        trial = done.measured.trial
        self._walls[kind(trial.problem), trial.ask, done.contestant].append(done.wall)
        self._bytes.append(len(done.measured.to_json()) + 1)

    def of_one(self, problem: str, ask: str, contestant: int) -> float:
        """What a trial will take, s; 0 of what nothing is known."""
        walls = self._walls.get((kind(problem), ask, contestant))
        return float(np.mean(walls)) if walls else 0.0

    def seconds(self, piece: Piece) -> float:
        """What a piece will take, s."""
        return sum(self.of_one(piece.problem, *one) for one in piece.asked)

    def cost(self, pieces: Sequence[Piece], workers: int) -> Cost:
        """What pieces will cost.

        Args:
            pieces: What is to do.
            workers: How many pieces are done at a time.
        """
        calls = sum(len(piece.asked) for piece in pieces)
        seconds = sum(self.seconds(piece) for piece in pieces)
        size = float(np.mean(self._bytes)) if self._bytes else 0.0
        return Cost(calls, seconds, seconds / workers, calls * size)


def pilot_of(pieces: Iterable[Piece]) -> tuple[tuple[Piece, ...], tuple[Piece, ...]]:
    """Part pieces into the first of each kind of problem, from which the cost is learnt, and the others."""
    first: dict[str, Piece] = {}
    others = []
    for piece in pieces:
        known = first.setdefault(kind(piece.problem), piece)
        if known is not piece:
            others.append(piece)
    return tuple(first.values()), tuple(others)


def kind(problem: str) -> str:
    """A problem's name without what makes no difference to its cost."""
    return WAVEFORM.sub("", problem)


def told_time(seconds: float) -> str:
    """A time in words."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
