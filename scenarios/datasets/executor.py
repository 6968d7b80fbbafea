"""Who runs the chunks of a plan: by default this process, with threads for the physics."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from scenarios.datasets.chunk import Made, run_chunk
from scenarios.datasets.plan import DataSetPlan


class Executor(Protocol):
    """Runs chunks of a plan, here or elsewhere."""

    def __call__(
        self, plan: DataSetPlan, chunks: Iterator[Sequence[int]], ticked: Callable[[int], None], /
    ) -> Iterator[Made]:
        """Run chunks.

        Args:
            plan: The plan.
            chunks: Places in the plan, chunk by chunk; take the next only when it can be run: memory stays flat.
            ticked: To be told now and then how many ticks are run of chunks from which nothing has come yet.

        Yields:
            What came of each experiment, in the order in which they are done; nothing of it depends on the order.
        """


@dataclass(frozen=True)
class Threads:
    """Runs chunks in this process, one after the other.

    Attributes:
        workers: Threads for the physics; all processors by default.
    """

    workers: int | None = None

    def __call__(
        self, plan: DataSetPlan, chunks: Iterator[Sequence[int]], ticked: Callable[[int], None], /
    ) -> Iterator[Made]:
        """Run chunks; see `Executor`."""
        for chunk in chunks:
            yield from run_chunk(plan, chunk, threads=self.workers, progress=lambda done, _: ticked(done))
