"""Tables of docs/measured/thesis-claims.md: claims with the verdicts of the recorded seeds, criteria, undecided claims.

    python tests/benchmarks/claims.py verdicts
    python tests/benchmarks/claims.py criteria
    python tests/benchmarks/claims.py undecided

Nothing is computed: the record is that of tests/benchmarks/findings.py.
"""

import sys

from scenarios.thesis.finding import CLAIMS, UNDECIDED
from scenarios.thesis.frequencies import ORDER
from scenarios.thesis.monte_carlo import recorded
from tests.benchmarks.tables import heading, options, row

CHANGED = "●"
"""Mark of a change made after verdicts by the former criterion had been seen."""


def verdicts():
    """Print every claim with the verdict that most recorded seeds share, and how many seeds share it."""
    tally = recorded()
    heading("", "Claim", "Thesis", "Verdict of most seeds", "Seeds", "Criterion of")
    for claim in CLAIMS.values():
        frequency = tally.frequency(claim.key)
        others = [f"{frequency.counts[name]} {name}" for name in ORDER if name in frequency.counts]
        others.remove(f"{frequency.counts[frequency.usual]} {frequency.usual}")
        share = f"{frequency.counts[frequency.usual]} of {frequency.seeds}"
        seeds = "; ".join((share, *others))
        row(claim.key, claim.claim, claim.where, frequency.usual, seeds, day(claim))


def day(claim):
    """Day of the criterion, with the last change after verdicts had been seen."""
    changes = [change.date for change in claim.changes if change.after_results]
    return f"{claim.date}, {CHANGED} {changes[-1]}" if changes else str(claim.date)


def criteria():
    """Print every criterion with what holds by construction, what was known when it was written, and its changes."""
    heading("", "Criterion", "By construction", "Known by then", "Changes")
    for claim in CLAIMS.values():
        changes = []
        for change in claim.changes:
            mark = f"{CHANGED} " if change.after_results else ""
            changes.append(f"{mark}{change.date}: {change.what}, because {change.why}")
        parts = ", ".join(claim.constructed) or "all"
        construction = f"{parts}: {claim.by_construction}" if claim.by_construction else ""
        row(claim.key, claim.criterion, construction, claim.known, "; ".join(changes))


def undecided():
    """Print the claims that the twin cannot decide."""
    heading("Claim", "Thesis", "Reason")
    for entry in UNDECIDED:
        row(entry.claim, entry.where, entry.why)


TABLES = {"verdicts": verdicts, "criteria": criteria, "undecided": undecided}


def main():
    parser = options(__doc__)
    parser.add_argument("table", choices=TABLES)
    TABLES[parser.parse_args().table]()


if __name__ == "__main__":
    sys.exit(main())
