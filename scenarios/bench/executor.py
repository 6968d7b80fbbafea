"""Who does the pieces of a run."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from typing import Protocol

from scenarios.bench.work import Bench, Done, Piece

Crew = Callable[[Iterable[Piece]], Iterator[Done]]
"""Does pieces and yields trials as they are done, in any sequence; it takes a piece when somebody is free to do it."""


class Executor(Protocol):
    """Does pieces of a run, here or elsewhere."""

    @property
    def workers(self) -> int:
        """How many pieces are done at a time, as far as it is known."""

    @property
    def here(self) -> bool:
        """Whether pieces are done on this machine, where they find what is in its folders."""

    def crew(self, bench: Bench) -> AbstractContextManager[Crew]:
        """Those who do pieces; they may be given pieces several times, one lot after the other.

        Args:
            bench: What all pieces share.
        """
