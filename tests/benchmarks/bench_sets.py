"""Runs of the whole bench, and the exact sets of figures that fail in them beside those that should."""

import sys
import tempfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from scenarios.bench.leaderboard_verdict import Verdict, verdict
from scenarios.bench.metric import Metric
from scenarios.bench.metrics import metrics_named
from scenarios.bench.result import Result
from scenarios.bench.verify import BenchPlan, verify
from scenarios.estimators.estimator import Limits
from scenarios.estimators.known_estimators import estimator as contestant
from scenarios.jobs.executor import LocalProcesses
from tests.benchmarks.faulty_estimators import FAULTY


@dataclass(frozen=True)
class Asked:
    """A run of an estimator.

    Attributes:
        name: Of the estimator.
        seconds: An answer may take this long, s.
        figures: Only these; all when empty.
    """

    name: str
    seconds: float = 30.0
    figures: tuple[str, ...] = ()


def results(asked: Sequence[Asked], out: Path | None, workers: int | None) -> dict[str, Result]:
    """Run the quick bench, those that are alike in one run, and return the results by name.

    Args:
        asked: Estimators.
        out: Folder for what is done, from which the same command goes on; a temporary one by default.
        workers: Processes; all processors by default.
    """
    with tempfile.TemporaryDirectory() as scratch:
        folder = out or Path(scratch)
        runs: dict[tuple[float, tuple[str, ...]], list[str]] = {}
        for one in asked:
            runs.setdefault((one.seconds, one.figures), []).append(one.name)
        found: dict[str, Result] = {}
        for (seconds, figures), names in runs.items():
            plan = BenchPlan(
                tuple(FAULTY[name] if name in FAULTY else contestant(name) for name in names),
                "quick",
                0,
                Limits(seconds),
                metrics_named(figures),
                contestant("referee"),
            )
            done = verify(
                plan,
                folder / f"{seconds:g}-{'-'.join(figures) or 'all'}",
                LocalProcesses(workers),
                notify=lambda line: print(line, file=sys.stderr, flush=True),
            )
            found |= {result.contestant.name: result for result in done}
    return {one.name: found[one.name] for one in asked}


def of_verdict(result: Result, wanted: Verdict) -> dict[str, Metric]:
    """Figures with a verdict, by name."""
    return {name: metric for name, metric in result.figures.items() if verdict(metric) is wanted}


def row(name: str, found: Collection[str], reasons: Mapping[str, str]) -> tuple[str, bool]:
    """A row of a table: the estimator, what it fails, and how that differs from what it should; whether it does."""
    missing, more = sorted(set(reasons) - set(found)), sorted(set(found) - set(reasons))
    wrong = [f"not {one}" for one in missing] + [f"also {one}" for one in more]
    told = ", ".join(one.replace("_", " ") for one in found) or "none"
    return f"| {name} | {told} | {', '.join(wrong) or 'as it should'} |", bool(wrong)
