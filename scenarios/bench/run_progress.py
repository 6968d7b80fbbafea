"""Trials of a run counted as they are done: how far it is, how long it will take, and who is given up."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from time import monotonic

from scenarios.bench.cost import Pilot
from scenarios.bench.journal import GIVEN_UP, HANG, Journal
from scenarios.bench.measurement import Measurement
from scenarios.bench.work import Done, Piece
from scenarios.problems.trial import Trial

HANGS = 10
"""An estimator that has hung so often in a row is given up."""

SURE = 0.05
"""Part of the work after which its own pace tells more than that of the first trials."""

Progress = Callable[[int, int, float | None], None]
"""Told how many trials are done, of how many, and how long the others will take, s; None while that is not known."""


class Counted:
    """Takes down trials as they are done.

    One estimator after `HANGS` of whose trials in a row, over all workers, came to an end at the limit of time is asked
    no more: the trials that it has left count as hung, with a reason that says so. They stand in its journal, so that a
    run that goes on asks them as little; hangs at the end of a journal count.

    Args:
        wanted: Trials of each contestant.
        journals: Of each, in which trials are noted.
        progress: Told how far it is.
        said: Told in words who is given up.
    """

    def __init__(
        self,
        wanted: Sequence[Sequence[Trial]],
        journals: Sequence[Journal],
        progress: Progress,
        said: Callable[[str], None],
    ) -> None:
        self._wanted, self._journals, self._progress, self._said = wanted, journals, progress, said
        self._total = sum(map(len, wanted))
        pairs = zip(wanted, journals, strict=True)
        self._done = sum(trial.key in journal.done for trials, journal in pairs for trial in trials)
        self._given_up: set[int] = set()
        self._pilot: Pilot | None = None
        self._workers, self._begun, self._spent, self._work = 1, 0.0, 0.0, 0.0
        self._tell()

    def begin(self, pilot: Pilot, pieces: Iterable[Piece], workers: int) -> None:
        """From now on it is known what pieces cost."""
        self._pilot, self._workers, self._begun = pilot, workers, monotonic()
        self._work = sum(map(pilot.seconds, pieces))

    def still(self, pieces: Iterable[Piece]) -> Iterator[Piece]:
        """Pieces without those who have been given up when they are taken."""
        for piece in pieces:
            asked = tuple(one for one in piece.asked if one[1] not in self._given_up)
            if asked:
                yield replace(piece, asked=asked)

    def note(self, done: Done, names: Sequence[str]) -> None:
        """Take down a trial; one whose process died may come twice.

        Args:
            done: The trial.
            names: Of the contestants.
        """
        number, journal = done.contestant, self._journals[done.contestant]
        if not self._add(number, done.measured):
            return
        if journal.hangs >= HANGS:
            self._given_up.add(number)
            left = [trial for trial in self._wanted[number] if trial.key not in journal.done]
            if left:
                why = f"{GIVEN_UP} after {HANGS} hangs in a row: not asked any more"
                self._said(f"{names[number]}: {why}, which {len(left)} trials count as")
            for trial in left:
                self._add(number, Measurement(trial, HANG, why))
        self._tell()

    def _add(self, number: int, measured: Measurement) -> bool:
        """Whether it was new."""
        journal, trial = self._journals[number], measured.trial
        if trial.key in journal.done:
            return False
        journal.add(measured)
        self._done += 1
        if self._pilot is not None:
            self._spent += self._pilot.of_one(trial.problem, trial.ask, number)
        return True

    def _tell(self) -> None:
        self._progress(self._done, self._total, self._left())

    def _left(self) -> float | None:
        if self._pilot is None:
            return None
        rest = max(0.0, self._work - self._spent)
        if self._spent > SURE * self._work:
            return rest * (monotonic() - self._begun) / self._spent
        return rest / self._workers
