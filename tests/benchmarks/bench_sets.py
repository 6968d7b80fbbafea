"""The exact sets of figures that estimators fail in the quick bench, beside those that they should fail.

    python tests/benchmarks/bench_sets.py faults|theory [NAME ...] [--out FOLDER] [--workers N]

`faults`: every estimator that is wrong on purpose, in its sandbox, beside `planted_faults`. The slow one is asked for
the systems without noise alone, since its answers are those of `our-pem` and each takes 1800 rulers; the hanging one
has ten seconds.

`theory`: our estimators. They must fail no metric that theory expects them to pass; the figures that they fail as
theory says are compared with the table below, and their reasons are printed. Theory speaks of the limit of long
records: the table has what shows on those of the quick bench.

Progress is kept in FOLDER: run the command again to resume.
"""

import sys
import tempfile
from pathlib import Path

from scenarios.bench.metric import Verdict
from scenarios.bench.metrics import metrics_named
from scenarios.bench.verify import BenchPlan, verify
from scenarios.estimators.estimator import Limits
from scenarios.estimators.known_estimators import estimator
from scenarios.jobs.executor import LocalProcesses
from tests.benchmarks.faulty_estimators import FAULTY
from tests.benchmarks.planted_faults import PLANTED_FAULTS
from tests.benchmarks.tables import heading, options, row

CLAIMS = ("coverage", "normalised_error", "frequency_response")

AS_THEORY_SAYS = {
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

SPECIAL = {"slow": (30.0, ("noise_free_recovery", "reliability", "speed")), "hanging": (10.0, ())}
"""Seconds that an answer may take and the figures asked for, where not 30 and all."""


def results(names, out, workers):
    """Results by name; estimators with the same limits share a run."""
    runs, finished = {}, {}
    for name in names:
        runs.setdefault(SPECIAL.get(name, (30.0, ())), []).append(name)
    for (seconds, figures), members in runs.items():
        contestants = tuple(FAULTY.get(name) or estimator(name) for name in members)
        plan = BenchPlan(contestants, "quick", 0, Limits(seconds), metrics_named(figures), estimator("referee"))
        folder = out / f"{seconds:g}-{'-'.join(figures) or 'all'}"
        done = verify(plan, folder, LocalProcesses(workers), notify=lambda line: print(line, file=sys.stderr))
        finished |= {result.estimator.name: result for result in done}
    return {name: finished[name] for name in names}


def figures_with(result, wanted):
    return [name for name, metric in result.metrics.items() if metric.verdict is wanted]


def listed(names):
    return ", ".join(name.replace("_", " ") for name in names) or "none"


def main():
    """Run and print; True where an estimator fails other figures than it should."""
    parser = options(__doc__)
    parser.add_argument("of", choices=("faults", "theory"))
    parser.add_argument("names", nargs="*", help="of the estimators; all by default")
    parser.add_argument("--out", type=Path, help="folder for the progress; a temporary one by default")
    parser.add_argument("--workers", type=int, help="processes; all processors by default")
    asked = parser.parse_args()
    theory = asked.of == "theory"
    expected = AS_THEORY_SAYS if theory else PLANTED_FAULTS
    with tempfile.TemporaryDirectory() as scratch:
        messages = results(asked.names or list(expected), asked.out or Path(scratch), asked.workers)
    heading(*(("estimator", "fails as theory says", "", "fails") if theory else ("fault", "figures that it fails", "")))
    wrong = False
    for name, result in messages.items():
        failed = figures_with(result, Verdict.FAILS)
        judged = figures_with(result, Verdict.FAILS_AS_THEORY_SAYS) if theory else failed
        differences = [f"not {one}" for one in expected[name] if one not in judged]
        differences += [f"also {one}" for one in judged if one not in expected[name]]
        wrong |= bool(differences or (theory and failed))
        row(name, listed(judged), ", ".join(differences) or "as it should", *([listed(failed)] if theory else []))
    print()
    for name, result in messages.items() if theory else ():
        parts = [part for metric in result.metrics.values() for part in metric.parts]
        for why in dict.fromkeys(part.why for part in parts if part.passed is False and not part.theory):
            print(f"- {name}: {why}")
    return wrong


if __name__ == "__main__":
    sys.exit(main())
