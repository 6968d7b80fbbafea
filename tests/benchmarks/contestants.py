"""Our estimators and other packages side by side: accuracy, failures and time on the same records, in one run.

Run by hand in an environment that has the peers (`pip install -e '.[peers]'`; Octave's come by `apt-get install
octave-control`); those that are not installed are told and left out:

    python tests/benchmarks/contestants.py 10                          all contestants, 10 records of each problem
    python tests/benchmarks/contestants.py 10 --problems p1 --only oe  those with oe in their names, one problem

Per problem and contestant: the median over the records of the mean square error of the frequency response over the
Cramér-Rao bound of the system's own structure (1 is as good as can be; on records without noise the relative error
itself), failures, and processor time as a multiple of that of our estimator of the same structure.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np

from scenarios.bench_contract.contestant import Contestant, Limits
from scenarios.bench_contract.outcome import MODEL, REFUSED
from scenarios.bench_problems.problem import Problem
from scenarios.bench_problems.registry import problem
from scenarios.bench_trials.measured import Measured
from scenarios.bench_trials.run_trials import PERFECT, Runner
from scenarios.bench_trials.work import Bench, Piece
from scenarios.contestants.entries_faulty import FAULTY
from scenarios.contestants.registry import available, contestant, names

PROBLEMS = ("p1", "p2", "p3", "p5", "quiet-3-2")
RULERS = {"arx": "our-arx", "armax": "our-armax", "oe": "our-oe", "bj": "our-bj", "ss": "our-n4sid"}
"""Contestants whose time is one, by structure."""


def contestants(only: str) -> tuple[Contestant, ...]:
    """All that are installed and whose names hold a text, and those whose time is one."""
    wrong = {entry.contestant.name for entry in FAULTY}
    found = []
    for name in names():
        can_run, why = available(name)
        if name in wrong or name == "referee":
            continue
        if not can_run:
            print(f"left out: {why}")
        elif only in name or name in RULERS.values():
            found.append(contestant(name))
    return tuple(found)


def error(measured: Measured, of: Problem) -> float:
    """Mean square error of the response over the bound; the relative error where there is none."""
    if measured.response is None:
        return float("nan")
    truth = of.truth.frequency_response(of.frequencies)
    squares = np.abs(measured.response - truth) ** 2
    bound = of.bound(None)
    if bound is None:
        return float(np.sqrt(squares.sum() / (np.abs(truth) ** 2).sum()))
    return float(np.mean(squares / (bound.response_directions**2).sum(axis=(0, -1))))


def table(name: str, everyone: Sequence[Contestant], draws: int, limits: Limits) -> None:
    """Ask everyone on the same records of a problem and print a table."""
    of = problem(name)
    kept: dict[int, list[Measured]] = {number: [] for number in range(len(everyone))}
    with Runner(Bench(tuple(everyone), limits, 0)) as runner:
        for draw in range(draws):
            for done in runner.run(Piece(name, draw, tuple(("fit", number) for number in kept))):
                kept[done.contestant].append(done.measured)
    seconds = {
        everyone[number].name: median(m.seconds for m in found if m.kind == MODEL)
        for number, found in kept.items()
        if any(m.kind == MODEL for m in found)
    }
    what = "relative error" if of.bound(None) is None else "error^2 / bound"
    print(
        f"\n{name}, {draws} records\n\n| contestant | version | {what} | failed | times ours |\n|---|---|---|---|---|"
    )
    for number, one in enumerate(everyone):
        found = [m for m in kept[number] if m.kind != REFUSED]
        if not found:
            continue
        good = [error(m, of) for m in found if m.kind == MODEL]
        failed = ", ".join(sorted({m.kind for m in found if m.kind != MODEL}))
        ours = seconds.get(RULERS.get(one.structure or "", ""))
        ratio = f"{seconds[one.name] / ours:.2g}" if ours and one.name in seconds and one.target != PERFECT else ""
        accuracy = f"{median(good):.3g}" if good else ""
        print(
            f"| {one.name} | {one.version} | {accuracy} | {len(found) - len(good)}/{len(found)} {failed} | {ratio} |",
            flush=True,
        )


def main() -> None:
    """Measure and write tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("draws", type=int, nargs="?", default=10)
    parser.add_argument("--problems", nargs="+", default=PROBLEMS)
    parser.add_argument("--only", default="")
    parser.add_argument("--seconds", type=float, default=60.0)
    given = parser.parse_args()
    everyone = contestants(given.only)
    for name in given.problems:
        table(name, everyone, given.draws, Limits(seconds=given.seconds))


if __name__ == "__main__":
    main()
