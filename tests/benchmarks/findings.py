"""Make what the package records of twenty seeds anew: verdicts, numbers and bandwidths.

    python tests/benchmarks/findings.py
    python tests/benchmarks/findings.py --missing

Two minutes for each seed on two processors. Seeds that have come to an end are kept in build/findings, and the same
command takes up there. To be run whenever a change moves findings: tests/scenarios/thesis/test_recorded.py says when.
After a change that only adds claims, --missing runs the seeds whose record lacks a verdict and leaves the others.
"""

import sys

from scenarios.files.provenance import versions
from scenarios.thesis.finding import CLAIMS
from scenarios.thesis.frequencies import seeds_record
from scenarios.thesis.monte_carlo import FILE, Tally, recorded, tally, write_tally
from tests.benchmarks.tables import ROOT, options

SEEDS = range(1, 21)


def main():
    parser = options(__doc__)
    parser.add_argument("--missing", action="store_true", help="only the seeds whose record lacks a verdict")
    kept = complete_outcomes() if parser.parse_args().missing else {}
    anew = [seed for seed in SEEDS if seed not in kept]
    failed = {}
    if anew:
        made = tally(
            anew,
            ROOT / "build" / "findings",
            progress=lambda seed, before, step, done, whole: (
                done == whole and print(f"seed {seed}: {step}", flush=True)
            ),
        )
        kept |= {outcome.seed: outcome for outcome in made.outcomes}
        failed = made.failed
    outcomes = Tally(tuple(kept[seed] for seed in SEEDS if seed in kept), failed)
    write_tally(outcomes, ROOT / "scenarios" / "data" / FILE)
    show(outcomes)
    return 1 if outcomes.failed else 0


def complete_outcomes():
    """Recorded outcomes by seed that have a verdict on every claim and were made with these versions."""
    complete = {}
    for outcome in recorded().outcomes:
        if set(outcome.verdicts) == set(CLAIMS) and outcome.versions == versions():
            complete[outcome.seed] = outcome
    return complete


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
