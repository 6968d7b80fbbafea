"""Progress of a study by the measured cost of its steps: equal shares take about equal time."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import accumulate, pairwise
from time import perf_counter
from types import MappingProxyType
from typing import TypeVar

T = TypeVar("T")

Report = Callable[[str, int, int], None]
"""Called with the name of the step, the work that is done and that in all, both in hundredths of a second as measured
when `COSTS` was written."""

HUNDREDTHS = 100

TICK = 1.7e-4
"""Processor time of a simulated sample of 0.02 s of one experiment, s."""


COSTS: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {
        "identify": (6.5, 0.2, 1.0),
        "causes": (0.3, 0.1, 1.0),
        "orders": (0.5, 0.2, 1.0),
        "spectra": (0.1, 0.3, 0.7),
        "data sets": (6.0, 5.0, 0.35),
        "observers": (0.1, 0.1, 1.0),
        "three joints": (0.5, 0.2, 1.0),
        "robustness": (24.0, 0.0, 0.03),
        "other arms": (1.0, 0.4, 1.0),
        "every joint": (11.0, 0.0, 1.0),
        "answer": (8.0, 0.0, 1.0),
        "findings": (0.6, 0.8, 1.0),
        "report": (10.0, 0.5, 1.0),
    }
)
"""Processor time of the steps after the simulation: whatever the length of the records, s; for each minute of every
record, s; share of both in a study that is not thorough."""


@dataclass(frozen=True)
class Part:
    """Part of the work of a step.

    Attributes:
        report: Called with the share of the step that is done.
        start: Share of the step at which the part begins.
        end: Share at which it ends.
    """

    report: Callable[[float], None] = lambda share: None
    start: float = 0.0
    end: float = 1.0

    def __call__(self, done: float, total: float = 1.0) -> None:
        """Report how much of this part is done, of a total."""
        self.report(self.start + (self.end - self.start) * min(done / total, 1.0))

    def shares(self, *shares: float) -> tuple["Part", ...]:
        """Divide the work into consecutive parts of these shares, whose sum is one."""
        ends = (0.0, *accumulate(shares))
        width = self.end - self.start
        consecutive = []
        for begin, end in pairwise(ends):
            consecutive.append(Part(self.report, self.start + width * begin, self.start + width * end))
        return tuple(consecutive)

    def split(self, items: Sequence[T]) -> Iterator[tuple[T, "Part"]]:
        """Go through items of about equal cost, each with its part, done when the next begins."""
        if not items:
            return
        equal_shares = self.shares(*[1.0 / len(items)] * len(items))
        for item, share in zip(items, equal_shares, strict=True):
            yield item, share
            share(1.0)


NO_REPORT = Part()
"""Work that nobody watches."""


class Steps:
    """Steps of known cost, one after the other; all of the work is done only when the last has ended."""

    def __init__(self, costs: Mapping[str, float], report: Report | None = None) -> None:
        """Plan steps by their costs, s, in the sequence of the work."""
        # Whole hundredths add up exactly, so that the last step ends at the total.
        # At least one, since the last hundredth of a step is kept for its end.
        self.costs = {name: max(round(HUNDREDTHS * cost), 1) for name, cost in costs.items()}
        self._report = report or (lambda step, done, total: None)
        self._done = 0
        self.seconds: dict[str, float] = {}
        self.total = sum(self.costs.values())

    @contextmanager
    def step(self, name: str) -> Iterator[Part]:
        """Report start, progress and end of a planned step; `seconds` keeps its wall time."""
        before = latest = self._done
        cost = self.costs[name]
        began = perf_counter()
        self._report(name, before, self.total)

        def advance(share: float) -> None:
            nonlocal latest
            # Never backwards, whatever a part reports. One hundredth is left for the end, so that no step is shown as
            # finished while it runs.
            latest = max(latest, before + min(int(share * cost), cost - 1))
            self._report(name, latest, self.total)

        yield Part(advance)
        self.seconds[name] = perf_counter() - began
        self._done = before + cost
        self._report(name, self._done, self.total)
