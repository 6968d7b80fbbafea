"""How often the whole test bench fails a perfect estimator: real records, real verdicts, seed after seed.

Each run is `hmtb verify perfect --quick` with its own seed: records, the arm's too, are drawn anew. It prints a line
per run that fails anything, how many runs failed with the exact 95 % interval of their share, and per metric how near
to their limits the values came. More than one run in a hundred that fails is a fault. Progress is kept in the folder
`--out`: run the command again to resume.
"""

import shutil
import sys
import tempfile
from pathlib import Path

from scipy.stats import binomtest

from scenarios.bench.verify import RECORDS, BenchPlan, verify
from scenarios.commands.verify_output import limits, number
from scenarios.estimators.known_estimators import estimator
from scenarios.jobs.executor import LocalProcesses
from tests.benchmarks.tables import heading, options, row


def used(part):
    """How much of the way from what is expected to the limit a value has gone; 1 is the limit."""
    low, high = part.limits
    limit = high if part.value > part.expected else low
    room = abs(limit - part.expected)
    return abs(part.value - part.expected) / room if 0.0 < room < float("inf") else 0.0


def main():
    """Run and print; True where more runs fail than may."""
    parser = options(__doc__)
    parser.add_argument("runs", nargs="?", type=int, default=100)
    parser.add_argument("--out", type=Path, help="folder for the progress; a temporary one by default")
    parser.add_argument("--workers", type=int, help="processes; all processors by default")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        return measure(asked.runs, asked.out or Path(scratch), asked.workers)


def measure(runs, out, workers):
    failed, nearest = 0, {}
    for seed in range(runs):
        folder = out / f"seed-{seed}"
        plan = BenchPlan((estimator("perfect"),), effort="quick", seed=seed, referee=estimator("referee"))
        (result,) = verify(plan, folder, LocalProcesses(workers))
        shutil.rmtree(folder / RECORDS, ignore_errors=True)  # 105 records of the arm
        for name, metric in result.metrics.items():
            for part in metric.parts:
                nearest[name] = max(nearest.get(name, 0.0), used(part) if part.passed is not None else 0.0)
                if part.passed is False:
                    print(f"seed {seed}: {name}, {part.label}: {number(part.value)} (passes: {limits(part.limits)})")
        failed += not result.passed
        sys.stdout.flush()
    interval = binomtest(failed, runs).proportion_ci(0.95)
    print(f"failed: {failed} of {runs} runs, 95 % interval of the share {interval.low:.3g} to {interval.high:.3g}\n")
    heading("metric", "nearest to a limit, share of the way")
    for name, share in nearest.items():
        row(name, f"{share:.2f}")
    return failed > 0.01 * runs


if __name__ == "__main__":
    sys.exit(main())
