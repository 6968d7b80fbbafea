"""Model reference control on the twin: identifications, drawn arms, exchanged payloads, changed arms and models.

Criteria, of 2026-11-24, before the runs below; the defaults of `model_following` were chosen on other seeds.

- `seeds`: of each of twenty seeds the ground arm and the flight arm are identified from four minutes each. Error: root
  mean square over the six joints of measured angle less reference, for the run's own requests. Three references: the
  identified model that the design follows; the true linear flight arm; in free space the simulated flight arm with its
  friction. At the worksite ticks count while the arm is free: not while the unit that it holds touches the worksite,
  nor for half a second after (since a pilot on seed 100: in contact the worksite decides where the arm is; those ticks
  stand apart). Passed where, with the first two, the error falls fivefold in every run and its mean over the seeds is
  at most 1.2 times that of the same design given the true linear ground arm. Payloads: passed where the true linear
  loop is stable for 0 to 3 times the mass of the replacement unit, every seed.
- `specimens`: one design meets 500 drawn arms. `following` passes where every run is stable and none has a larger error
  than without control, against the reference model; otherwise the arms that fail are listed with their deviations. Arms
  whose drives cannot hold them at the pose are counted apart. `adaptive` passes where every run that the drives can
  hold is bounded: error below 0.5 rad and not growing from quarter to quarter. The true linear loop of the fixed
  design, whose stability the argument for boundedness assumes, is computed for every arm as well.
- `payloads`: the payload is exchanged at 60 s while the operator moves. The steady error of a controller is that of its
  own run which has had the new payload from the start, at the same times of the same motion and noise: by then it has
  adapted for more than a minute. `adaptive` passes where, of every exchange and seed, the root mean square error over
  the six joints from 10 to 20 s after it is at most 1.5 times the steady one.
- `gains`: errors of the adaptive and of the fixed controller from 40 to 80 s; nothing is to be passed.

But in `seeds`, errors are those against the identified reference model. Runs are kept in a file as they end, so that an
interrupted bench resumes.
"""

import json
import sys
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np

import sysid
from hmtb_twin import PayloadChange, Plant, Specimen, Status, linearize, load_arm
from hmtb_twin.parameters.specimen_draw import Distribution, TwinDistributions, draw_specimen
from scenarios import load
from scenarios.control.campaign import CONTROLLED, identification_experiment, identify_pair
from scenarios.control.design import METHODS
from scenarios.control.runs import run_scenarios
from scenarios.control.score import answer_of, is_stable, request_of
from sysid import model_following
from tests.benchmarks.tables import heading, options, row

FACTORS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
"""Masses of the payload over that of the replacement unit."""

lognormal, uniform = partial(Distribution, "lognormal"), partial(Distribution, "uniform")
POPULATION = TwinDistributions(
    mass=lognormal(spread=0.05),
    stretch=Distribution("normal", spread=0.05),
    shift=Distribution("normal", spread=0.1),
    payload_mass=uniform(spread=1.49, centre=1.5),
    dry_friction=lognormal(spread=0.4),
    drag=lognormal(spread=0.3),
    kp=lognormal(spread=0.1),
    kd=lognormal(spread=0.1),
    bulk_modulus=lognormal(spread=0.3),
    leakage=lognormal(spread=0.5),
    resolver_noise=lognormal(spread=0.3),
    friction_level=lognormal(spread=0.7),
    oil_temperature=uniform(spread=15.0, centre=45.0),
)
"""Arms with any payload from nothing to three units, seals from new to worn, and servos that are off by a tenth."""

CHANGE = 60.0
"""Time of the exchange, s."""

EXCHANGES = {
    "none to three units": ("none", "rpcm", 3.0),
    "three units to none": ("rpcm", "none", 3.0),
    "one unit to the multiplexer": ("rpcm", "mdm", 1.0),
}
"""First and second payload, and the factor of their masses."""

ARMS = {
    "as identified": {},
    "no payload": {"payload": "none"},
    "three units": {"specimen": Specimen(payload_mass=3.0)},
    "multiplexer": {"payload": "mdm"},
    "worn seals": {"specimen": Specimen(dry_friction=(3.0,) * 7, drag=(2.0,) * 7, leakage=2.0)},
}
MODELS = {"of the arm with one unit": 1.0, "of an arm with three units": 3.0}
"""Payload of the arm behind the model, over the unit's mass."""


def rms(values):
    return float(np.sqrt(np.mean(np.asarray(values) ** 2)))


def misses(log, reference):
    """Measured angles less the answer of a reference model to the run's own requests (N, 6), mrad."""
    return 1e3 * (answer_of(log) - np.asarray(sysid.simulate(reference, request_of(log))))


def linear_truth(variant="nominal", **arm):
    """The true linear arm on the controlled joints, with the noise of its resolvers."""
    truth = linearize(load_arm(variant, **arm), amplitudes=()).subset(CONTROLLED, CONTROLLED)
    noise = truth.innovation_covariance
    return replace(replace(truth, K=None, innovation_covariance=None).minimal(1e-6), innovation_covariance=noise)


def worst_pole(law, **arm):
    """Largest modulus of the true linear loop; None where the drives cannot hold the arm."""
    try:
        return float(abs(law.closed_loop(linear_truth(**arm)).poles()[0]))
    except ValueError:
        return None


@cache
def designs(seed=100, mass=1.0):
    """Fixed and adaptive law, from a record of an arm with units of a mass, and the reference: that of one unit."""
    pair = identify_pair(seed)
    if mass != 1.0:
        arm = replace(identification_experiment(seed=seed + 1), specimen=Specimen(payload_mass=mass))
        pair = replace(identify_pair(seed + 1, ground=arm), reference=pair.reference)
    return {method: METHODS[method](pair) for method in ("following", "adaptive")}, pair.reference


def reach_errors(duration, arms, laws, reference):
    """Run `reach` on several arms; errors (N, 6), mrad, by law, and why runs failed, of each arm."""
    scenarios = [replace(load("reach"), duration=duration, **arm) for arm in arms]
    runs = run_scenarios(scenarios, laws, reference=None)
    return [({law: misses(log, reference) for law, log in run.logs.items()}, dict(run.failed)) for run in runs]


def is_free(log):
    """Whether the worksite has not held the arm at each tick and half a second before."""
    if log.contact_force is None:
        return np.ones(len(log), dtype=bool)
    touching = ((log.status & Status.UNIT_HELD) != 0) & (log.contact_force > 0.0)
    return np.convolve(touching, np.ones(26))[: len(log)] < 0.5


def seed_results(seeds):
    """Errors of each seed's runs, by scenario and law, and the loop's worst pole for each payload."""
    for seed in seeds:
        known, reference = designs(seed)
        own = known["following"]
        truth = model_following(linear_truth(), reference, correction=own.correction).controller
        laws = {"identified": own, "truth": truth}
        wanted, errors = {"model": reference, "true": linear_truth("flight")}, {}
        for run in run_scenarios([replace(load(name), seed=seed) for name in ("reach", "rpcm")], laws):
            arm = run.logs.pop("reference", None)
            for law, log in run.logs.items():
                left, free = {kind: misses(log, one) for kind, one in wanted.items()}, is_free(log)
                if arm is not None:
                    left["arm"] = 1e3 * (answer_of(log) - answer_of(arm))
                    left["arm but wrist roll"] = left["arm"][:, :-1]
                entry = {name: rms(miss[free]) for name, miss in left.items()}
                if not free.all():
                    entry |= {"contact": rms(left["model"][~free]), "all": rms(left["model"])}
                entry["force"] = 0.0 if log.contact_force is None else float(log.contact_force.max())
                errors[f"{run.scenario.name} {law}"] = entry
        payloads = [{"specimen": Specimen(payload_mass=one)} if one else {"payload": "none"} for one in FACTORS]
        yield {"errors": errors, "poles": [worst_pole(laws["identified"], **arm) for arm in payloads]}


def show_seeds(results):
    columns = ("run", "reference", "without, mrad", "with, mrad", "factor", "least factor")
    heading(*columns, "given the truth, mrad", "over truth")
    kinds = {
        "model": "its model",
        "true": "true linear flight",
        "arm": "simulated flight",
        "arm but wrist roll": "the same, but for the wrist roll, which sticks",
        "contact": "its model, in contact",
        "all": "its model, all ticks",
    }
    laws = ("without", "identified", "truth")
    for name in ("reach", "rpcm"):
        for kind, words in kinds.items():
            none, own, truth = (
                np.array([entry["errors"][f"{name} {law}"].get(kind) or np.nan for entry in results]) for law in laws
            )
            if np.isfinite(none).all():
                means = [f"{one.mean():.3g}" for one in (none, own, truth)]
                factors = f"{none.mean() / own.mean():.2g}", f"{(none / own).min():.3g}"
                row(name, words, *means[:2], *factors, means[2], f"{own.mean() / truth.mean():.3g}")
    for law in laws:
        forces = [entry["errors"][f"rpcm {law}"]["force"] for entry in results]
        print(f"largest contact force, median, {law}: {np.median(forces):.0f} N.")
    heading("payload over the unit's mass", "largest modulus of a pole of the true linear loop")
    for factor, pole in zip(FACTORS, np.max([entry["poles"] for entry in results], axis=0), strict=True):
        row(factor, f"{pole:.4f}")


def specimen_results(numbers):
    """Errors of some drawn arms with and without control, and the worst pole of their loops."""
    (laws, reference), arms = designs(), []
    for number in numbers:
        specimen, changes = draw_specimen(POPULATION, np.random.SeedSequence(20261124, spawn_key=(number,)))
        arms.append({"seed": number, "specimen": specimen, "plant": Plant(**changes)})
    for arm, (errors, failed) in zip(arms, reach_errors(20.0, arms, laws, reference), strict=True):
        # A controlled run that ends early is no arm that cannot be held.
        entry = {law: {"error": np.inf, "end": np.inf, "largest": np.inf, "stable": False} for law in laws}
        for law, error in errors.items():
            entry[law] = {"error": rms(error), "end": rms(error[-250:]), "largest": float(np.abs(error).max())}
            entry[law]["stable"] = is_stable(1e-3 * error)
        pole = worst_pole(laws["following"], specimen=arm["specimen"], plant=arm["plant"])
        deviations = {"payload": arm["specimen"].payload_mass, "friction": arm["plant"].friction_level}
        yield {**entry, "failed": failed, "pole": pole, **deviations}


def show_specimens(entries):
    held = [entry for entry in entries if "without" not in entry["failed"]]
    columns = (
        "law",
        "arms",
        "cannot be held",
        "unstable",
        "worse than without",
        "median error over without",
        "largest",
    )
    heading(*columns, "error of the last 5 s, largest, mrad", "at any time")
    ratios = {law: np.array([one[law]["error"] / one["without"]["error"] for one in held]) for law in designs()[0]}
    for law, ratio in ratios.items():
        unstable = sum(not entry[law]["stable"] for entry in held)
        worse, median, largest = int((ratio >= 1.0).sum()), f"{np.median(ratio):.3f}", f"{ratio.max():.3f}"
        most = (f"{max(entry[law][name] for entry in held):.3f}" for name in ("end", "largest"))
        row(law, len(entries), len(entries) - len(held), unstable, worse, median, largest, *most)
    worst = np.max(list(ratios.values()), axis=0)
    for place in np.argsort(-worst)[:10]:
        print(held[place])
    poles = np.array([entry["pole"] for entry in entries if entry["pole"] is not None])
    heading("arms", "without equilibrium", "unstable linear loops", "largest modulus of a pole")
    row(len(entries), len(entries) - len(poles), int((poles >= 1.0).sum()), f"{poles.max():.4f}")


def payload_results(seeds):
    """Errors of each ten seconds after the exchange, with it and with the new payload from the start."""
    laws, reference = designs()
    for seed in seeds:
        arms = {}
        for name, (before, after, mass) in EXCHANGES.items():
            arm = {"seed": seed, "specimen": Specimen(payload_mass=mass)}
            change = (PayloadChange(CHANGE, after),)
            arms[f"{name}, changed"] = {**arm, "payload": before, "payload_changes": change}
            arms[f"{name}, steady"] = {**arm, "payload": after}
        runs = reach_errors(CHANGE + 30.0, arms.values(), {"adaptive": laws["adaptive"]}, reference)
        yield {
            name: [rms(part) for part in np.split(errors["adaptive"][3000:], 3)]
            for name, (errors, _) in zip(arms, runs, strict=True)
        }


def show_payloads(results):
    heading("exchange", "0-10 s", "10-20 s", "20-30 s", "steady 10-20 s", "ratio, pooled", "ratio, largest")
    for change in EXCHANGES:
        values, steady = (np.array([one[f"{change}, {kind}"] for one in results]) for kind in ("changed", "steady"))
        pooled = [rms(values[:, k]) for k in range(3)]
        ratios = f"{pooled[1] / rms(steady[:, 1]):.2f}", f"{(values[:, 1] / steady[:, 1]).max():.2f}"
        row(change, *(f"{one:.3f} mrad" for one in (*pooled, rms(steady[:, 1]))), *ratios)


def gain_results(seeds):
    """Errors of both laws with each arm and model."""
    for seed in seeds:
        arms, entry = [{"seed": seed, **changes} for changes in ARMS.values()], {}
        for model, mass in MODELS.items():
            runs = reach_errors(80.0, arms, *designs(mass=mass))
            entry[model] = [{law: rms(error[2000:]) for law, error in errors.items()} for errors, _ in runs]
        yield entry


def show_gains(results):
    heading("arm", "model", "following, mrad", "adaptive, mrad", "adaptive over following")
    for model in MODELS:
        for k, arm in enumerate(ARMS):
            fixed, adaptive = (rms([one[model][k][law] for one in results]) for law in ("following", "adaptive"))
            row(arm, model, f"{fixed:.3f}", f"{adaptive:.3f}", f"{adaptive / fixed:.2f}")


PARTS = {
    "seeds": (seed_results, show_seeds, range(100, 120), 1),
    "specimens": (specimen_results, show_specimens, range(500), 25),
    "payloads": (payload_results, show_payloads, range(200, 205), 1),
    "gains": (gain_results, show_gains, range(200, 205), 1),
}
"""Results by number, table, numbers, and how many run side by side."""


def main():
    parser = options(__doc__)
    parser.add_argument("part", choices=PARTS, help="what is measured")
    parser.add_argument("--count", type=int, help="of seeds or arms, the first ones")
    parser.add_argument("--out", type=Path, default=Path("build/model_reference"), help="folder of the results")
    asked = parser.parse_args()
    results, show, numbers, batch = PARTS[asked.part]
    numbers, path = numbers[: asked.count], asked.out / f"{asked.part}.jsonl"
    asked.out.mkdir(parents=True, exist_ok=True)
    path.touch()
    kept = {number: entry for number, entry in map(json.loads, path.read_text().splitlines())}
    missing = [number for number in numbers if number not in kept]
    for start in range(0, len(missing), batch):
        some = missing[start : start + batch]
        for number, entry in zip(some, results(some), strict=True):
            text = json.dumps([number, entry])
            with path.open("a") as file:
                file.write(text + "\n")
            kept[number] = json.loads(text)[1]
        print(f"{min(start + batch, len(missing))} of {len(missing)} done", file=sys.stderr)
    show([kept[number] for number in numbers])


if __name__ == "__main__":
    main()
