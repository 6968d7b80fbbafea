"""What truth, floors and baselines of a data set cost, in parts of its bare physics.

Run by hand: `PYTHONPATH=. python tests/benchmarks/dataset_stages.py hmtb-siso-v1` (a minute or so). The data set is
built into a temporary folder; then each piece of every stage, the truth of the arms and the bare physics are run again
one by one, all in processor time of one thread. `--twins N` builds fewer of the randomised twins. Best linear
approximations are simulations of their own: where a spec asks for some, their cost is told apart.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from hmtb_twin import simulate
from scenarios.datasets.arm_truth import arm_files
from scenarios.datasets.build import build
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.spec import load_spec
from scenarios.datasets.stages import STAGES


def seconds(work: Callable[[], object]) -> float:
    """Processor time of some work, s."""
    before = time.process_time()
    work()
    return time.process_time() - before


def main() -> int:
    """Measure."""
    parser = argparse.ArgumentParser()
    parser.add_argument("spec")
    parser.add_argument("--twins", type=int)
    arguments = parser.parse_args()
    spec = load_spec(arguments.spec)
    if arguments.twins and spec.twins:
        spec = replace(spec, name=f"{spec.name}-part", twins=replace(spec.twins, count=arguments.twins))
    plan = DataSetPlan(spec)
    with tempfile.TemporaryDirectory() as place:
        whole = seconds(lambda: build(spec, Path(place), workers=1))
        folder = Path(place) / spec.label
        physics = sum(seconds(lambda e=entry: simulate([e.experiment], threads=1)) for entry in plan)
        arms = sum(seconds(lambda e=plan[k]: arm_files(plan, e)) for k in range(len(plan)) if plan.brings_arm(k))
        sys.stdout.write(f"{spec.label}: bare physics {physics:.1f} s\n  {'arms':48s} {arms / physics:6.3f}\n")
        total = arms
        for stage in STAGES:
            for piece in stage.pieces(plan):
                cost = seconds(lambda s=stage, p=piece: s.make(plan, folder, p))
                total += 0.0 if stage.name == "best-linear" else cost
                sys.stdout.write(f"  {stage.name + ' ' + piece:48s} {cost / physics:6.3f}\n")
    sys.stdout.write(f"truth, floors and baselines over bare physics: {total / physics:.2f}\n")
    sys.stdout.write(f"whole build over bare physics: {whole / physics:.2f}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
