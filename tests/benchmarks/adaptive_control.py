"""Adaptive model following on the twin: five hundred drawn arms, exchanged payloads, worn seals and wrong models.

Criteria, of 2026-11-24, before the runs below:

- `specimens`: one design meets 500 drawn arms, those of the bench of model following. Passed where every run that the
  drives can hold is bounded: error below 0.5 rad and not growing from quarter to quarter. The true linear loop of the
  fixed design, whose stability the argument for boundedness assumes, is computed for every arm as well (`poles`).
- `payloads`: the payload is exchanged at 60 s while the operator moves. The steady error of a controller is that of its
  own run which has had the new payload from the start, at the same times of the same motion and noise: by then it has
  adapted for more than a minute. Passed where, of every exchange and seed, the root mean square error over the six
  joints from 10 to 20 s after it is at most 1.5 times the steady one.
- `gains`: errors of the adaptive and of the fixed controller from 40 to 80 s; nothing is to be passed.

Errors are those against the identified reference model. Runs are kept in a file as they end, so that an interrupted
bench resumes. Without a part, all parts run: python -m tests.benchmarks.adaptive_control --specimens 500
"""

import sys
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np

import sysid
from hmtb_twin import PayloadChange, Plant, Specimen, simulate
from hmtb_twin.parameters.specimen_draw import draw_specimen
from scenarios import load
from scenarios.control.campaign import identification_experiment, identify_pair
from scenarios.control.runs import Controlled
from scenarios.control.score import answer_of, is_stable, request_of
from sysid import AdaptiveFollowing, model_following
from tests.benchmarks.model_following import POPULATION, keep, kept, linear_truth, rms
from tests.benchmarks.tables import heading, options, row

PAIR, OTHER_PAIR = 100, 101
"""Seeds of the identification; the other for a wrong model, identified with three times the payload."""

SEEDS = range(200, 220)
CHANGE = 60.0
"""Time of the exchange, s."""

EXCHANGES = {
    "none to three units": ("none", "rpcm", 3.0),
    "three units to none": ("rpcm", "none", 3.0),
    "one unit to the multiplexer": ("rpcm", "mdm", 1.0),
}
"""First and second payload, and the factor of their masses."""

WORN = Specimen(dry_friction=(3.0,) * 7, drag=(2.0,) * 7, leakage=2.0)
ARMS = {
    "as identified": {},
    "no payload": {"payload": "none"},
    "three units": {"specimen": Specimen(payload_mass=3.0)},
    "multiplexer": {"payload": "mdm"},
    "worn seals": {"specimen": WORN},
}
BATCH = 50
"""Arms that are simulated side by side."""


def laws(heavy=False):
    """Fixed and adaptive controller, from a record of the arm with one unit or with three, and the reference."""
    pair = identify_pair(PAIR)
    if heavy:
        arm = identification_experiment(seed=OTHER_PAIR, specimen=Specimen(payload_mass=3.0))
        pair = replace(identify_pair(OTHER_PAIR, ground=arm), reference=pair.reference)
    fixed = model_following(pair.ground, pair.reference).controller
    return {"fixed": fixed, "adaptive": AdaptiveFollowing(fixed, pair.ground, pair.reference)}, pair.reference


def run(scenarios, reference):
    """Simulate scenarios; return the tracking errors (N, m), rad, and the reasons of failures, both by scenario."""
    logs = simulate(list(scenarios.values()), keep_going=True)
    names = {one.name: key for key, one in scenarios.items()}
    errors = {names[log.name]: answer_of(log) - np.asarray(sysid.simulate(reference, request_of(log))) for log in logs}
    return errors, {names[name]: str(reason) for name, reason in logs.failed.items()}


def arm_of(number):
    """Specimen and plant of a drawn arm."""
    specimen, changes = draw_specimen(POPULATION, np.random.SeedSequence(20261124, spawn_key=(number,)))
    return {"specimen": specimen, "plant": Plant(**changes)}


def specimens_part(folder, count):
    path, (controllers, reference) = folder / "specimens.jsonl", laws()
    missing = [number for number in range(count) if number not in kept(path, "specimen")]
    for start in range(0, len(missing), BATCH):
        batch = missing[start : start + BATCH]
        scenarios = {
            number: Controlled(
                replace(load("reach"), duration=15.0, seed=number, **arm_of(number)),
                controllers["adaptive"],
                str(number),
            )
            for number in batch
        }
        errors, failed = run(scenarios, reference)
        entries = [{"specimen": number, "failed": reason} for number, reason in failed.items()]
        for number, error in errors.items():
            values = {"error": 1e3 * rms(error), "end": 1e3 * rms(error[-250:]), "largest": 1e3 * np.abs(error).max()}
            entries.append({"specimen": number, "failed": None, **values, "stable": is_stable(error)})
        keep(path, entries)
        print(f"{start + len(batch)} of {len(missing)} arms done", file=sys.stderr)
    entries = [entry for number, entry in kept(path, "specimen").items() if number < count]
    done = [entry for entry in entries if entry["failed"] is None]
    heading(
        "arms", "cannot run", "unbounded", "error, median", "error of the last 5 s, median", "largest", "at any time"
    )
    values = {name: np.array([entry[name] for entry in done]) for name in ("error", "end", "largest")}
    unbounded = [entry["specimen"] for entry in done if not entry["stable"]]
    medians = (f"{np.median(values[name]):.3f} mrad" for name in ("error", "end"))
    most = (f"{values[name].max():.3f} mrad" for name in ("end", "largest"))
    row(len(entries), len(entries) - len(done), f"{len(unbounded)} {unbounded or ''}", *medians, *most)


def poles_part(folder, count):
    """Stability of the true linear loop of the fixed design with every drawn arm."""
    path, (controllers, _) = folder / "poles.jsonl", laws()
    for number in [number for number in range(count) if number not in kept(path, "specimen")]:
        keep(path, [{"specimen": number, "pole": worst_pole(controllers["fixed"], arm_of(number))}])
    poles = [entry["pole"] for number, entry in kept(path, "specimen").items() if number < count]
    known = np.array([pole for pole in poles if pole is not None])
    heading("arms", "without equilibrium", "unstable linear loops", "largest modulus of a pole")
    row(len(poles), len(poles) - len(known), int((known >= 1.0).sum()), f"{known.max():.4f}")


def worst_pole(law, arm):
    """Largest modulus of the true linear loop; None where the drives cannot hold the arm."""
    try:
        truth = linear_truth(**arm)
    except ValueError:
        return None
    return float(abs(law.closed_loop(replace(truth, innovation_covariance=None)).poles()[0]))


def payloads_part(folder, count):
    path, (controllers, reference) = folder / "payloads.jsonl", laws()
    for seed in [seed for seed in SEEDS[:count] if seed not in kept(path, "seed")]:
        scenarios = {}
        for change, (before, after, factor) in EXCHANGES.items():
            one = replace(load("reach"), duration=CHANGE + 30.0, seed=seed, specimen=Specimen(payload_mass=factor))
            changed = replace(one, payload=before, payload_changes=(PayloadChange(CHANGE, after),))
            for kind, scenario in (("changed", changed), ("steady", replace(one, payload=after))):
                key = f"{change}, {kind}"
                name = key.replace(" ", "-").replace(",", "")
                scenarios[key] = Controlled(scenario, controllers["adaptive"], name)
        errors, failed = run(scenarios, reference)
        # Of each ten seconds after the exchange.
        windows = {key: [1e3 * rms(error[k : k + 500]) for k in (3000, 3500, 4000)] for key, error in errors.items()}
        keep(path, [{"seed": seed, "windows": windows, "failed": failed}])
        print(f"seed {seed} done", file=sys.stderr)
    results = [entry["windows"] for seed, entry in kept(path, "seed").items() if seed in SEEDS[:count]]
    heading("exchange", "0-10 s", "10-20 s", "20-30 s", "steady 10-20 s", "ratio, pooled", "ratio, largest")
    for change in EXCHANGES:
        values, steady = (np.array([one[f"{change}, {kind}"] for one in results]) for kind in ("changed", "steady"))
        pooled = [rms(values[:, k]) for k in range(3)]
        ratios = f"{pooled[1] / rms(steady[:, 1]):.2f}", f"{(values[:, 1] / steady[:, 1]).max():.2f}"
        row(change, *(f"{one:.3f} mrad" for one in (*pooled, rms(steady[:, 1]))), *ratios)


def gains_part(folder, count):
    path = folder / "gains.jsonl"
    for heavy in (False, True):
        designed = None
        for seed in [seed for seed in SEEDS[:count] if f"{seed} {heavy}" not in kept(path, "run")]:
            controllers, reference = designed = designed or laws(heavy)
            scenarios = {}
            for arm, changes in ARMS.items():
                for name, law in controllers.items():
                    one = replace(load("reach"), duration=80.0, seed=seed, **changes)
                    scenarios[f"{arm}, {name}"] = Controlled(one, law, f"{arm}-{name}".replace(" ", "-"))
            errors, failed = run(scenarios, reference)
            values = {key: 1e3 * rms(error[2000:]) for key, error in errors.items()}
            keep(path, [{"run": f"{seed} {heavy}", "heavy": heavy, "errors": values, "failed": failed}])
            print(f"gains, seed {seed} done", file=sys.stderr)
    results = list(kept(path, "run").values())
    heading("arm", "model", "fixed, mrad", "adaptive, mrad", "adaptive over fixed")
    for heavy in (False, True):
        own = [entry["errors"] for entry in results if entry["heavy"] == heavy]
        for arm in ARMS if own else ():
            fixed, adaptive = (rms([one[f"{arm}, {name}"] for one in own]) for name in ("fixed", "adaptive"))
            words = "of an arm with three units" if heavy else "of the arm with one unit"
            row(arm, words, f"{fixed:.3f}", f"{adaptive:.3f}", f"{adaptive / fixed:.2f}")


def cost_part():
    """Time of one tick."""
    controllers, _ = laws()
    signals = 0.1 * np.random.default_rng(1).standard_normal((3000, 6)).cumsum(axis=0) / 50
    heading("law", "processor time of one tick of one arm, us")
    for name, law in controllers.items():
        times = []
        for _ in range(5):
            loop, start = law.start(), process_time()
            for sample in signals:
                loop.applied(loop.command(sample, sample))
            times.append(1e6 * (process_time() - start) / len(signals))
        row(name, f"{min(times):.0f}")


def main():
    parser = options(__doc__)
    parser.add_argument("--part", choices=("payloads", "specimens", "gains", "poles", "cost"), help="all by default")
    parser.add_argument("--specimens", type=int, default=500, help="number of drawn arms")
    parser.add_argument(
        "--seeds", type=int, default=5, help="number of motions with exchanged payloads and changed arms"
    )
    parser.add_argument("--out", type=Path, default=Path("build/adaptive_control"), help="folder of the results")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    if asked.part in (None, "payloads"):
        payloads_part(asked.out, asked.seeds)
    if asked.part in (None, "specimens"):
        specimens_part(asked.out, asked.specimens)
    if asked.part in (None, "gains"):
        gains_part(asked.out, asked.seeds)
    if asked.part in (None, "poles"):
        poles_part(asked.out, asked.specimens)
    if asked.part in (None, "cost"):
        cost_part()


if __name__ == "__main__":
    main()
