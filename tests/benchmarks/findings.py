"""Make what the package records of twenty seeds anew: verdicts, numbers and bandwidths.

    python tests/benchmarks/findings.py

Two minutes for each seed on two processors. Seeds that have come to an end are kept in build/findings, and the same
command takes up there. To be run whenever a change moves findings: tests/scenarios/thesis/test_recorded.py says when.
"""

import sys

from scenarios.thesis.finding import CLAIMS
from scenarios.thesis.frequencies import seeds_record
from scenarios.thesis.monte_carlo import FILE, tally, write_tally
from tests.benchmarks.tables import ROOT, options


def main():
    options(__doc__).parse_args()
    outcomes = tally(
        range(1, 21),
        ROOT / "build" / "findings",
        progress=lambda seed, before, step, done, whole: done == whole and print(f"seed {seed}: {step}", flush=True),
    )
    write_tally(outcomes, ROOT / "scenarios" / "data" / FILE)
    show(outcomes)
    return 1 if outcomes.failed else 0


def show(found):
    for key in CLAIMS:
        frequency = found.frequency(key)
        note = "   depends on the seed" if frequency.depends_on_seed(frequency.usual) else ""
        print(f"{key:4} {', '.join(f'{count} {name}' for name, count in frequency.counts.items())}{note}")
    print("cost", seeds_record(found)["cost"])
    for seed, why in found.failed.items():
        print(f"failed: seed {seed}: {why}")


if __name__ == "__main__":
    sys.exit(main())
