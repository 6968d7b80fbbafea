"""How often the whole test bench fails a perfect estimator: real records, real verdicts, seed after seed.

    python tests/benchmarks/bench_perfect.py [RUNS] [--first SEED] [--out FOLDER]

Each run is `hmtb verify perfect --quick` with its own seed: records, the arm's too, are drawn anew. It prints a line
per run that fails anything, how many runs failed with the exact 95 % interval of their share, and per metric how near
to their limits the values came. More than one run in a hundred that fails is a fault. What is done is kept in FOLDER,
and the same command goes on from there.
"""

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

from scipy.stats import binomtest

from scenarios.bench.metric import Part
from scenarios.bench.verify import RECORDS, BenchPlan, verify
from scenarios.commands.verify_output import limits, number
from scenarios.estimators.known_estimators import estimator as contestant
from scenarios.jobs.executor import LocalProcesses

MOST = 0.01
"""Share of runs that may fail."""


def used(part: Part) -> float:
    """How much of the way from what is expected to the limit a value has gone; 1 is the limit."""
    low, high = part.limits
    limit = high if part.value > part.expected else low
    room = abs(limit - part.expected)
    return abs(part.value - part.expected) / room if 0.0 < room < float("inf") else 0.0


def main() -> int:
    """Run and print; 1 where more runs fail than may."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("runs", nargs="?", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="seed of the first run")
    parser.add_argument("--out", type=Path, help="folder for what is done; a temporary one by default")
    parser.add_argument("--workers", type=int, help="processes; all processors by default")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        return _measure(asked.runs, asked.first, asked.out or Path(scratch), asked.workers)


def _measure(runs: int, first: int, out: Path, workers: int | None) -> int:
    perfect, referee = contestant("perfect"), contestant("referee")
    failed = 0
    nearest: dict[str, float] = {}
    for seed in range(first, first + runs):
        folder = out / f"seed-{seed}"
        plan = BenchPlan((perfect,), effort="quick", seed=seed, referee=referee)
        (result,) = verify(plan, folder, LocalProcesses(workers))
        shutil.rmtree(folder / RECORDS, ignore_errors=True)  # 105 records of the arm
        for name, metric in result.figures.items():
            for part in metric.parts:
                nearest[name] = max(nearest.get(name, 0.0), used(part) if part.passed is not None else 0.0)
                if part.passed is False:
                    print(f"seed {seed}: {name}, {part.label}: {number(part.value)} (passes: {limits(part.limits)})")
        failed += not result.passed
        sys.stdout.flush()
    interval = binomtest(failed, runs).proportion_ci(0.95)
    print(f"failed: {failed} of {runs} runs, 95 % interval of the share {interval.low:.3g} to {interval.high:.3g}\n")
    print("| metric | nearest to a limit, share of the way |\n|---|---:|")
    for name, share in nearest.items():
        print(f"| {name} | {share:.2f} |")
    return 1 if failed > MOST * runs else 0


if __name__ == "__main__":
    sys.exit(main())
