"""Speed: processor time of an estimate, as a multiple of what a fixed computation on the same record takes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.bench.measured import Measured
from scenarios.bench.metric import Figure, FigureMaker, Part, trials_of
from scenarios.estimators.contestant import Contestant
from scenarios.estimators.outcome import MODEL
from scenarios.problems.trial import Trial

SLOW = 1200.0
"""Median multiple beyond which an estimator is called slow.

A search takes about one such problem for each of its steps, some tens of them; this leaves a factor of twenty or more
for several starts and for interpreted code.
"""

MIB = 2.0**20


@dataclass(frozen=True)
class Speed:
    """Processor time of estimates that ended with a model, in rulers.

    A ruler is the processor time of a fixed least-squares problem on the same record in the same run, so that neither
    the machine nor the length of the records matters much. The verdict is on the median; chance hardly turns it.

    Attributes:
        others: The figures whose trials are timed.
    """

    others: tuple[FigureMaker, ...] = ()
    name: str = "speed"
    title: str = "Time of an estimate"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Those of all other figures, each once."""
        return trials_of(self.others, effort)

    def verdicts(self) -> int:
        """None that chance can turn."""
        return 0

    def figure(
        self, measured: Sequence[Measured], contestant: Contestant, false_alarm: float, referee: Sequence[Measured]
    ) -> Figure:
        """Median and 95th percentile of the multiples, memory beside them."""
        del contestant, false_alarm, referee
        answered = [m for m in measured if m.kind == MODEL]
        timed = [m for m in answered if m.seconds >= 0.0 and m.ruler_seconds > 0.0]
        multiples = np.array([m.seconds / m.ruler_seconds for m in timed])
        enough = len(timed) > 0 and 2 * len(timed) >= len(answered)
        median = float(np.median(multiples)) if enough else float("nan")
        interval = _interval_of_median(multiples) if enough else (float("nan"), float("nan"))
        memory = max((m.peak_bytes for m in answered), default=0)
        if enough:
            seconds = np.array([m.seconds for m in timed])
            why = (
                f"{1000.0 * float(np.median(seconds)):.3g} ms in the median here; called slow beyond {SLOW:g} rulers; "
                f"the most memory {memory / MIB:.0f} MiB"
            )
        else:
            why = f"the time of {len(timed)} of {len(answered)} answers is known: no verdict"
        problems = sorted({m.trial.problem for m in timed})
        parts = tuple(
            _part(problem, np.array([m.seconds / m.ruler_seconds for m in timed if m.trial.problem == problem]))
            for problem in problems
        )
        return Figure(
            name=self.name,
            title=self.title,
            unit="rulers",
            value=median,
            expected=float("nan"),
            interval=interval,
            passed=median <= SLOW if enough else None,
            false_alarm=0.0,
            why=why,
            parts=parts if enough else (),
            curves={
                "percentile_95": float(np.percentile(multiples, 95.0)) if enough else float("nan"),
                "ruler_seconds": float(np.median([m.ruler_seconds for m in timed])) if enough else float("nan"),
                "peak_bytes": memory,
            },
        )


def _part(problem: str, multiples: np.ndarray) -> Part:
    return Part(
        label=problem,
        value=float(np.median(multiples)),
        expected=float("nan"),
        interval=_interval_of_median(multiples),
        limits=(-np.inf, np.inf),
        passed=None,
        why="told, not judged: the verdict is on the median of all",
        draws=len(multiples),
    )


def _interval_of_median(values: np.ndarray) -> tuple[float, float]:
    """Order statistics about the median by the normal approximation of their ranks."""
    ordered = np.sort(values)
    half = 0.98 * np.sqrt(len(ordered))
    low = max(0, int(np.floor(len(ordered) / 2 - half)))
    high = min(len(ordered) - 1, int(np.ceil(len(ordered) / 2 + half)))
    return (float(ordered[low]), float(ordered[high]))
