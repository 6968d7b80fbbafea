"""Who does the pieces of a run."""

from collections.abc import Iterable, Iterator
from typing import Protocol

from scenarios.bench_trials.work import Bench, Done, Piece


class Executor(Protocol):
    """Does pieces of a run, here or elsewhere."""

    @property
    def workers(self) -> int:
        """How many pieces are done at a time, as far as it is known."""

    @property
    def here(self) -> bool:
        """Whether pieces are done on this machine, where they find what is in its folders."""

    def __call__(self, bench: Bench, pieces: Iterable[Piece], /) -> Iterator[Done]:
        """Do pieces.

        Args:
            bench: What they share.
            pieces: The pieces; taken when they can be done.

        Yields:
            Trials as they are done, in any sequence; nothing that is judged depends on it.
        """
