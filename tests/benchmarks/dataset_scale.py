"""What a data set costs as it grows: memory and cost per twin, and cost against the bare physics.

First 100 against 1,000 twins with short records, then whole data sets against their physics. Every build is a process
of its own, its physics on one thread: peak memory and the ratio of costs are its own. Costs are processor times of all
that a build does, so that a busy machine tells the same; the physics are the steps of the records alone.
"""

import os
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter, process_time

from tests.benchmarks.tables import environment, heading, options, row

FLEET, PART = "hmtb-fleet-v1", 100
"""Twins of the fleet against physics; floors and baselines are of ten, as they are of its thousand."""

WHOLE = ("hmtb-siso-v1", "hmtb-mimo-v1", "hmtb-nonlinear-v1", "hmtb-thesis-v1")
GROWTH, SECONDS = (100, 1000), 4.0
"""Twins of the fleets that are compared as they grow, and the most that their records last, s."""

STEPS = {"records": "Records, truth of arms", "best-linear": "Best linear", "attainable": "Floors"}
STEPS |= {"baselines": "Baselines", "finish": "Papers"}
"""Steps of a build, and their names in the table."""


def one(label, twins, seconds=0.0, *, models=True):
    """Build a data set in this process, and return what it cost."""
    from hmtb_twin import load_arm
    from scenarios.datasets import chunk
    from scenarios.datasets.build import build
    from scenarios.datasets.spec import load_spec

    spec = load_spec(label)
    if spec.twins is not None:
        spec = replace(spec, twins=replace(spec.twins, count=twins))
    if not models:
        spec = replace(spec, baselines=replace(spec.baselines, models=()))
    if seconds:
        # A test record is scored behind its window.
        records = tuple(replace(block, duration=min(seconds, block.duration or seconds)) for block in spec.records)
        spec = replace(spec, records=records)
    physics, step, steps = 0.0, "records", {}
    simulate = chunk.simulate

    def timed(*arguments, **options):
        nonlocal physics
        wall, processor = perf_counter(), process_time()
        logs = simulate(*arguments, **options)
        # A busy machine delays physics and the rest alike. A clock of processor time read in every tick would cost a
        # fifth of the physics.
        physics += logs.physics_seconds * (process_time() - processor) / (perf_counter() - wall)
        return logs

    def note(progress):
        # The time since the last report went to the step that began there.
        nonlocal since, step
        steps[step] = steps.get(step, 0.0) + process_time() - since
        since, step = process_time(), progress.step

    chunk.simulate = timed
    # The machine code of the physics is loaded once in a process.
    load_arm()
    with tempfile.TemporaryDirectory() as out:
        begin = since = process_time()
        built = build(spec, Path(out), workers=1, progress=note)
        total = process_time() - begin
        size = sum(path.stat().st_size for path in built.folder.rglob("*") if path.is_file())
    if built.incomplete:
        raise RuntimeError(f"{len(built.incomplete)} failed: {next(iter(built.incomplete.items()))}")
    # Of this very program: what the one that started it had is not in it.
    peak = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    ratios = {name: seconds / physics for name, seconds in steps.items()}
    return {"ratio": total / physics, "peak": int(peak.split()[1]) / 1024, "size": size / 2**20, **ratios}


def measured(*arguments, **options):
    """The same in a process of its own, which begins anew and computes on one thread."""
    os.environ.update(environment())
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
        return process.submit(one, *arguments, **options).result()


def main():
    """Print both tables; True where a limit is broken."""
    parser = options(__doc__)
    parser.add_argument("--only", choices=("growth", "physics"), help="one table only")
    asked = parser.parse_args()
    wrong = asked.only != "physics" and growth()
    print()
    return (asked.only != "growth" and against_physics()) or wrong


def growth():
    """Memory and cost of a few twins and of many, without baselines."""
    heading(f"Twins, records of {SECONDS:g} s", "Peak memory, MiB", "Cost per twin / its physics", "On disk, MiB")
    costs = []
    for count in GROWTH:
        costs.append(measured(FLEET, count, SECONDS, models=False))
        row(count, f"{costs[-1]['peak']:.0f}", f"{costs[-1]['ratio']:.2f}", f"{costs[-1]['size']:.0f}")
    memory, cost = (costs[-1][name] / costs[0][name] for name in ("peak", "ratio"))
    row("ratio", f"{memory:.2f} (limit 1.2)", f"{cost:.2f} (limit 1.1)", "")
    return memory > 1.2 or cost > 1.1


def against_physics():
    """Cost of whole builds against the steps of their records' physics alone."""
    heading("Cost / physics alone", *STEPS.values(), "Together (limit 1.5)")
    wrong = False
    for label, twins, name in (*((label, 1, label) for label in WHOLE), (FLEET, PART, f"{FLEET}, {PART} twins")):
        cost = measured(label, twins)
        row(name, *(f"{cost.get(step, 0.0):.2f}" for step in STEPS), f"{cost['ratio']:.2f}")
        wrong |= cost["ratio"] > 1.5
    return wrong


if __name__ == "__main__":
    sys.exit(main())
