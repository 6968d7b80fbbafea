"""Are planted faults caught, each by the figures that should catch it and by no other?

    python tests/benchmarks/bench_planted_faults.py [NAME ...] [--out FOLDER] [--workers N] [--whole]

Every estimator that is wrong on purpose goes through the quick bench, in its sandbox, and the figures that it fails
are compared with `planted_faults`: the exact set. The slow one is asked for the systems without
noise alone, since its answers are those of `our-pem` and each takes 1800 rulers; `--whole` asks it for everything, some
twenty minutes of one core. The hanging one is given ten seconds. What is done is kept in FOLDER, and the same command
goes on from there.
"""

import argparse
import sys
from pathlib import Path

from bench_sets import Asked, of_verdict, results, row
from planted_faults import PLANTED_FAULTS

from scenarios.bench.leaderboard_verdict import Verdict

CHEAP = ("noise_free_recovery", "reliability", "speed")
HANG = 10.0


def main() -> int:
    """Run and print; 1 where a fault fails other figures than it should."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", help="of the estimators; all by default")
    parser.add_argument("--out", type=Path, help="folder for what is done; a temporary one by default")
    parser.add_argument("--workers", type=int, help="processes; all processors by default")
    parser.add_argument("--whole", action="store_true", help="all figures of the slow one")
    told = parser.parse_args()
    asked = [
        Asked(name, HANG if name == "hanging" else 30.0, CHEAP if name == "slow" and not told.whole else ())
        for name in told.names or PLANTED_FAULTS
    ]
    found = results(asked, told.out, told.workers)
    print("| fault | figures that it fails | |\n|---|---|---|")
    wrong = 0
    for name, result in found.items():
        text, differs = row(name, of_verdict(result, Verdict.FAILS), PLANTED_FAULTS[name])
        wrong += differs
        print(text)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
