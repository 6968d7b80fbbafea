"""What a data set costs as it grows: memory and cost per twin, and cost against the bare physics.

    python tests/benchmarks/dataset_scale.py                  # 100 against 1,000 twins with short records, then physics
    python tests/benchmarks/dataset_scale.py --seconds 20     # the records as long as those of hmtb-fleet-v1
    python tests/benchmarks/dataset_scale.py --twins 20 60    # a quick look

Every build is a process of its own, its physics on one thread: peak memory and the ratio of costs are its own. Costs
are processor times of all that a build does, so that a busy machine tells the same; the physics are the steps of the
records alone.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from time import perf_counter, process_time

ROOT = Path(__file__).parents[2]
FLEET = "hmtb-fleet-v1"
WHOLE = ("hmtb-siso-v1", "hmtb-mimo-v1", "hmtb-nonlinear-v1", "hmtb-thesis-v1")
"""Data sets that are built whole."""

PART = 100
"""Twins of the fleet that are built here; floors and baselines are of ten, as they are of its thousand."""

STEPS = {"records": "Records, truth of arms", "best-linear": "Best linear", "attainable": "Floors"}
STEPS |= {"baselines": "Baselines", "finish": "Papers"}
"""Steps of a build, and what they are called in the table."""


def one(label: str, twins: int, seconds: float, rows: int, *, models: bool = True) -> dict[str, float | str]:
    """Build a data set in this process, and return what it cost."""
    from hmtb_twin.run import batch_run
    from scenarios.datasets import chunk
    from scenarios.datasets.build import build
    from scenarios.datasets.spec import load_spec
    from scenarios.jobs.progress import Progress

    spec = load_spec(label)
    if spec.twins is not None:
        spec = replace(spec, twins=replace(spec.twins, count=twins))
    if not models:
        spec = replace(spec, baselines=replace(spec.baselines, models=()))
    if seconds:
        # A test record is scored behind its window.
        records = tuple(replace(block, duration=min(seconds, block.duration or seconds)) for block in spec.records)
        spec = replace(spec, records=records)
    physics, step, steps = 0.0, "records", dict[str, float]()
    simulate = chunk.simulate

    def timed(*given, **options):
        nonlocal physics
        logs = simulate(*given, **options)
        physics += logs.physics_seconds
        return logs

    def told(progress: Progress) -> None:
        # What took the time since is what was said to begin.
        nonlocal since, step
        steps[step] = steps.get(step, 0.0) + process_time() - since
        since, step = process_time(), progress.step

    chunk.simulate = timed
    # What the physics count is their processor time, too.
    batch_run.perf_counter = process_time
    with tempfile.TemporaryDirectory() as out:
        since, begun = process_time(), perf_counter()
        whole = since
        built = build(spec, Path(out), workers=1, rows=rows, progress=told)
        total, wall = process_time() - whole, perf_counter() - begun
        size = sum(path.stat().st_size for path in built.path.rglob("*") if path.is_file())
    if built.failed:
        raise RuntimeError(f"{len(built.failed)} failed: {next(iter(built.failed.items()))}")
    # Of this very program: what the one that started it had is not in it.
    peak = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return {
        "total": total,
        "physics": physics,
        "peak": int(peak.split()[1]) / 1024,
        "size": size / 2**20,
        "wall": wall,
        **steps,
    }


def measured(label: str, twins: int, seconds: float, rows: int, *, models: bool = True) -> dict[str, float]:
    """The same in a process of its own."""
    words = [sys.executable, __file__, "--one", label, "--twins", str(twins), "--seconds", str(seconds)]
    words += [] if models else ["--no-models"]
    run = subprocess.run([*words, "--rows", str(rows)], cwd=ROOT, capture_output=True, text=True, check=False)
    if run.returncode:
        raise RuntimeError(run.stderr.strip().splitlines()[-1])
    return json.loads(run.stdout)


def main() -> int:
    """Print both tables; 1 where a limit is broken."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--twins", type=int, nargs="+", default=[100, 1000])
    parser.add_argument("--seconds", type=float, default=4.0, help="length of the fleet's records at most, s")
    parser.add_argument("--rows", type=int, default=256, help="experiments side by side at most")
    parser.add_argument("--one", help="build this one and print what it cost as JSON")
    parser.add_argument("--no-models", action="store_true", help="with --one: no baselines")
    parser.add_argument("--only", choices=("growth", "physics"), help="one table only")
    asked = parser.parse_args()
    if asked.one:
        print(json.dumps(one(asked.one, asked.twins[0], asked.seconds, asked.rows, models=not asked.no_models)))
        return 0
    fine = True
    if asked.only != "physics":
        fine &= growth(asked.twins, asked.seconds, asked.rows)
        print()
    if asked.only != "growth":
        fine &= against_physics(asked.rows)
    return 0 if fine else 1


def growth(twins: list[int], seconds: float, rows: int) -> bool:
    """Memory and cost of a few twins and of many, without baselines."""
    print(f"| Twins, records of {seconds:g} s | Peak memory, MiB | Cost per twin / its physics | On disk, MiB |")
    print("|---|---|---|---|")
    found = []
    for count in twins:
        cost = measured(FLEET, count, seconds, rows, models=False)
        ratio = cost["total"] / cost["physics"]
        print(f"| {count} | {cost['peak']:.0f} | {ratio:.2f} | {cost['size']:.0f} |", flush=True)
        print(f"{count}: {cost}", file=sys.stderr)
        found.append((cost["peak"], ratio))
    memory, cost = (last / first for first, last in zip(found[0], found[-1], strict=True))
    print(f"| ratio | {memory:.2f} (limit 1.2) | {cost:.2f} (limit 1.1) | |")
    return memory <= 1.2 and cost <= 1.1


def against_physics(rows: int) -> bool:
    """Cost of whole builds against the steps of their records' physics alone."""
    print(f"| Cost / physics alone | {' | '.join(STEPS.values())} | Together (limit 1.5) |")
    print("|---|" + "---|" * (len(STEPS) + 1))
    fine = True
    for label, twins, name in (*((label, 1, label) for label in WHOLE), (FLEET, PART, f"{FLEET}, {PART} twins")):
        cost = measured(label, twins, 0.0, rows)
        print(f"{name}: {cost}", file=sys.stderr)
        whole = cost["total"] / cost["physics"]
        columns = " | ".join(f"{cost.get(step, 0.0) / cost['physics']:.2f}" for step in STEPS)
        print(f"| {name} | {columns} | {whole:.2f} |", flush=True)
        fine &= whole <= 1.5
    return fine


if __name__ == "__main__":
    sys.exit(main())
