"""Do our estimators pass what theory says they pass, and fail what it says they fail?

    python tests/benchmarks/bench_theory.py [NAME ...] [--out FOLDER] [--workers N]

Each goes through the quick bench. It must fail no metric that theory expects it to pass; the figures that it fails as
theory says are compared with the table below, the exact set, and their reasons are printed. Theory speaks of the limit
of long records: the table has what shows on those of the quick bench. What is done is kept in FOLDER, and the same
command goes on from there.
"""

import argparse
import sys
from pathlib import Path

from bench_sets import Asked, of_verdict, results, row

from scenarios.bench.leaderboard_verdict import Verdict

CLAIMS = ("coverage", "normalised_error", "frequency_response")

AS_THEORY_SAYS: dict[str, tuple[str, ...]] = {
    "our-oe": ("efficiency", *CLAIMS, "bias", "tests_and_orders", "agreement"),
    "our-armax": (),
    "our-okid": ("efficiency", *CLAIMS, "bias", "tests_and_orders", "agreement"),
    "our-n4sid": ("efficiency", "bias", "tests_and_orders", "reliability"),
    "our-pem-ss": (),
    "our-arx": ("consistency", "efficiency", *CLAIMS, "bias", "tests_and_orders", "agreement"),
    "our-bj": (),
    "our-iv4": ("efficiency", "normalised_error", "frequency_response", "reliability"),
    "our-pem": (),
}
"""Figures that each fails, as theory says."""


def main() -> int:
    """Run and print; 1 where an estimator fails other figures than theory says."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", help="of the estimators; all by default")
    parser.add_argument("--out", type=Path, help="folder for what is done; a temporary one by default")
    parser.add_argument("--workers", type=int, help="processes; all processors by default")
    told = parser.parse_args()
    found = results([Asked(name) for name in told.names or AS_THEORY_SAYS], told.out, told.workers)
    print("| estimator | fails as theory says | | fails |\n|---|---|---|---|")
    wrong = 0
    for name, result in found.items():
        surprises = ", ".join(of_verdict(result, Verdict.FAILS)) or "none"
        text, differs = row(
            name, of_verdict(result, Verdict.FAILS_AS_THEORY_SAYS), dict.fromkeys(AS_THEORY_SAYS[name], "")
        )
        wrong += differs or surprises != "none"
        print(f"{text} {surprises} |")
    print()
    for name, result in found.items():
        parts = [part for metric in result.figures.values() for part in metric.parts]
        for why in dict.fromkeys(part.why for part in parts if part.passed is False and not part.theory):
            print(f"- {name}: {why}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
