"""What a data set costs as it grows: memory and cost per twin, and cost against the bare physics.

    python tests/benchmarks/dataset_scale.py                  # 100 against 1,000 twins with short records, then physics
    python tests/benchmarks/dataset_scale.py --seconds 20     # the records as long as those of hmtb-fleet-v1
    python tests/benchmarks/dataset_scale.py --twins 20 60    # a quick look

Every build is a process of its own, its physics on one thread: peak memory and the ratio of costs are its own. Costs
are processor times of all that a build does, so that a busy machine tells the same; the physics are the steps of the
records alone.
"""

import json
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from time import process_time

from tests.benchmarks.tables import environment, heading, options, row

FLEET, PART = "hmtb-fleet-v1", 100
"""Twins of the fleet against physics; floors and baselines are of ten, as they are of its thousand."""

WHOLE = ("hmtb-siso-v1", "hmtb-mimo-v1", "hmtb-nonlinear-v1", "hmtb-thesis-v1")
STEPS = {"records": "Records, truth of arms", "best-linear": "Best linear", "attainable": "Floors"}
STEPS |= {"baselines": "Baselines", "finish": "Papers"}
"""Steps of a build, and their names in the table."""


def one(label, twins, seconds, rows, models):
    """Build a data set in this process, and return what it cost."""
    from hmtb_twin.run import batch_run
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
        logs = simulate(*arguments, **options)
        physics += logs.physics_seconds
        return logs

    def note(progress):
        # The time since the last report went to the step that began there.
        nonlocal since, step
        steps[step] = steps.get(step, 0.0) + process_time() - since
        since, step = process_time(), progress.step

    chunk.simulate = timed
    # What the physics count is their processor time, too.
    batch_run.perf_counter = process_time
    with tempfile.TemporaryDirectory() as out:
        begin = since = process_time()
        built = build(spec, Path(out), workers=1, rows=rows, progress=note)
        total = process_time() - begin
        size = sum(path.stat().st_size for path in built.folder.rglob("*") if path.is_file())
    if built.incomplete:
        raise RuntimeError(f"{len(built.incomplete)} failed: {next(iter(built.incomplete.items()))}")
    # Of this very program: what the one that started it had is not in it.
    peak = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    ratios = {name: seconds / physics for name, seconds in steps.items()}
    return {"ratio": total / physics, "peak": int(peak.split()[1]) / 1024, "size": size / 2**20, **ratios}


def measured(label, twins, seconds, rows, *more):
    """The same in a process of its own."""
    words = ["--one", label, "--twins", str(twins), "--seconds", str(seconds), "--rows", str(rows), *more]
    run = subprocess.run([sys.executable, __file__, *words], env=environment(), capture_output=True, text=True)
    if run.returncode:
        raise RuntimeError(run.stderr.strip().splitlines()[-1])
    return json.loads(run.stdout)


def main():
    """Print both tables; True where a limit is broken."""
    parser = options(__doc__)
    parser.add_argument("--twins", type=int, nargs="+", default=[100, 1000])
    parser.add_argument("--seconds", type=float, default=4.0, help="length of the fleet's records at most, s")
    parser.add_argument("--rows", type=int, default=256, help="experiments side by side at most")
    parser.add_argument("--one", help="build this one and print what it cost as JSON")
    parser.add_argument("--no-models", action="store_true", help="with --one: no baselines")
    parser.add_argument("--only", choices=("growth", "physics"), help="one table only")
    asked = parser.parse_args()
    if asked.one:
        print(json.dumps(one(asked.one, asked.twins[0], asked.seconds, asked.rows, not asked.no_models)))
        return False
    wrong = asked.only != "physics" and growth(asked.twins, asked.seconds, asked.rows)
    print()
    return (asked.only != "growth" and against_physics(asked.rows)) or wrong


def growth(twins, seconds, rows):
    """Memory and cost of a few twins and of many, without baselines."""
    heading(f"Twins, records of {seconds:g} s", "Peak memory, MiB", "Cost per twin / its physics", "On disk, MiB")
    costs = []
    for count in twins:
        costs.append(measured(FLEET, count, seconds, rows, "--no-models"))
        row(count, f"{costs[-1]['peak']:.0f}", f"{costs[-1]['ratio']:.2f}", f"{costs[-1]['size']:.0f}")
    memory, cost = (costs[-1][name] / costs[0][name] for name in ("peak", "ratio"))
    row("ratio", f"{memory:.2f} (limit 1.2)", f"{cost:.2f} (limit 1.1)", "")
    return memory > 1.2 or cost > 1.1


def against_physics(rows):
    """Cost of whole builds against the steps of their records' physics alone."""
    heading("Cost / physics alone", *STEPS.values(), "Together (limit 1.5)")
    wrong = False
    for label, twins, name in (*((label, 1, label) for label in WHOLE), (FLEET, PART, f"{FLEET}, {PART} twins")):
        cost = measured(label, twins, 0.0, rows)
        row(name, *(f"{cost.get(step, 0.0):.2f}" for step in STEPS), f"{cost['ratio']:.2f}")
        wrong |= cost["ratio"] > 1.5
    return wrong


if __name__ == "__main__":
    sys.exit(main())
