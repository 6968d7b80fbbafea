"""The twin against the independent equations of `tests/independent_arm.py` on drawn arms, payloads, poses and commands.

Every case draws, from its number alone:

- variant, payload, pose, excited joint: one of all, each as likely (a shoulder roll that a pin holds is not excited);
- servo `flow` or `torque` (electric drives: `torque`), friction `none`, `viscous`, `coulomb` or `lugre`;
- over the whole ranges that `Plant` accepts: `friction_level` from 0.01 to 100 and `presliding` from its least value at
  that level to 0.1 rad, uniform in the logarithm; `supply_pressure` from 0.75 to 100 MPa likewise; `oil_temperature`
  from 0 to 100 degrees Celsius, uniform; in cases from number 400 on `load_flow_slope` from 0.02 to 1, uniform in the
  logarithm, before them 1;
- in every other case a specimen: all factors from 0.5 to 2, uniform in the logarithm, entries of `stretch`, `shear` and
  `shift` uniform within 0.3 either way;
- the command: pseudo-random binary held for 1, 3 or 5 ticks, a multisine of 0.5, 1.5 and 3.5 Hz, or a step, of 0.5 to
  200 mrad, uniform in the logarithm, slewed at the velocity limit and kept within the joint's range; 1.5 s;
- in every fourth case process noise of 1e-4 to 0.1 of the rated torque, uniform in the logarithm.

Arms that the laboratory refuses, above all drives too weak for the weight, are drawn anew and counted. A case is "at a
limit" where flow or torque of any joint meets its limit. Relative error: root mean square of a joint's difference over
that of the excited joint's motion. Largest difference: of any angle at any tick. Servo valves have no independent
equations. Cases are kept in a file as they end, so that an interrupted run resumes.
"""

import json
import sys
from collections import Counter
from dataclasses import asdict
from pathlib import Path

import numpy as np

from hmtb_twin import JOINTS, PAYLOADS, VARIANTS, Plant, Specimen, TwinError, load_arm
from hmtb_twin.parameters.plant import FLATTEST, FRICTIONS, LEAST_PRESLIDING, STIFFEST
from hmtb_twin.parameters.specimen import DEVIATIONS, LENGTHS, OIL
from hmtb_twin.parameters.values import SAMPLE_TIME
from hmtb_twin.parameters.variants import MOTIONS, POSES
from tests.benchmarks.tables import heading, options, row
from tests.hmtb_twin.test_independent_arm import simulated
from tests.independent_arm import IndependentArm

SEED = 20261130
TICKS = 75
SLOPES_FROM = 400
"""First number of the cases whose load-flow line is flatter than the straight one."""

CLAIMED = 3e-6
"""Relative error that the pages name."""


def log_uniform(rng, lower, upper):
    """A number between two limits, its logarithm uniform."""
    return float(np.exp(rng.uniform(np.log(lower), np.log(upper))))


def drawn_plant(rng, variant, noise, number):
    """Plant over the ranges that it accepts; of an arm with electric drives without oil."""
    level = log_uniform(rng, 0.01, 100.0)
    presliding = log_uniform(rng, max(LEAST_PRESLIDING, STIFFEST * level), 0.1)
    oil = {
        "servo": str(rng.choice(["flow", "torque"])),
        "supply_pressure": log_uniform(rng, 0.75, 100.0),
        "oil_temperature": float(rng.uniform(0.0, 100.0)),
    }
    friction = str(rng.choice(FRICTIONS))
    if number >= SLOPES_FROM:
        oil["load_flow_slope"] = log_uniform(rng, FLATTEST, 1.0)
    if variant == "flight":
        oil = {}
    return Plant(friction=friction, friction_level=level, presliding=presliding, process_noise=noise, **oil)


def drawn_specimen(rng, variant):
    """Specimen whose factors lie from a half to two, its shapes within 0.3."""
    values = {}
    for name in Specimen.__dataclass_fields__:
        count = LENGTHS.get(name, 1)
        if name in DEVIATIONS:
            entries = rng.uniform(-0.3, 0.3, count)
        else:
            entries = np.exp(rng.uniform(np.log(0.5), np.log(2.0), count))
        values[name] = tuple(entries.tolist()) if name in LENGTHS else float(entries[0])
    if variant == "flight":
        values |= dict.fromkeys(OIL, 1.0)
    return Specimen(**values)


def drawn_command(rng, arm, pose):
    """Commands (TICKS, 7), rad, of one drawn joint, the joint, and how it was drawn."""
    joint = str(rng.choice([name for name in JOINTS if name not in arm.indexed]))
    size = log_uniform(rng, 5e-4, 0.2)
    kind = str(rng.choice(["binary", "multisine", "step"]))
    time = SAMPLE_TIME * np.arange(TICKS)
    if kind == "binary":
        held = int(rng.choice([1, 3, 5]))
        wanted = size * np.repeat(rng.choice([-1.0, 1.0], TICKS // held), held)
        kind = f"binary, {held}"
    elif kind == "multisine":
        phases = np.outer([np.pi, 3.0 * np.pi, 7.0 * np.pi], time) + rng.uniform(0, 6, (3, 1))
        wanted = size * np.sin(phases).sum(axis=0)
    else:
        wanted = size * (time > 0.1)
    j, motion = JOINTS.index(joint), MOTIONS[joint]
    most = arm.velocity_limits[j] * SAMPLE_TIME
    start = arm.pose(pose)
    command = np.tile(start, (TICKS, 1))
    angle = start[j]
    # The first command is the pose, at which the arm rests.
    for k in range(1, TICKS):
        step = np.clip(start[j] + wanted[k] - angle, -most, most)
        angle = np.clip(angle + step, motion.lower, motion.upper)
        command[k, j] = angle
    return command, joint, kind, size


def drawn_case(number):
    """Draw a case until the laboratory accepts it: its arm, command, noise, description and the number of refusals."""
    rng = np.random.default_rng([SEED, number])
    refusals = 0
    while True:
        variant, payload, pose = (str(rng.choice(list(names))) for names in (VARIANTS, PAYLOADS, POSES))
        level = log_uniform(rng, 1e-4, 0.1) if number % 4 == 3 else 0.0
        plant = drawn_plant(rng, variant, level, number)
        specimen = drawn_specimen(rng, variant) if number % 2 else Specimen()
        try:
            arm = load_arm(variant, payload, plant=plant, specimen=specimen)
            command, joint, kind, size = drawn_command(rng, arm, pose)
            arm.rest(command[0])
        except TwinError:
            refusals += 1
            continue
        noise = arm.process_noise * rng.normal(size=command.shape) if level else None
        description = {"variant": variant, "payload": payload, "pose": pose, "joint": joint, "kind": kind, "size": size}
        description |= {"noise": level, "specimen": bool(number % 2), "refusals": refusals, **asdict(plant)}
        return arm, command, noise, description


def compared(number, rtol=1e-10):
    """Errors of one case: relative ones by joint, and the largest difference, rad."""
    arm, command, noise, description = drawn_case(number)
    independent = IndependentArm(arm)
    expected = independent.simulate(command, noise, rtol=rtol)
    angles = simulated(arm, command, noise)
    moved = expected[:, JOINTS.index(description["joint"])] - expected[0, JOINTS.index(description["joint"])]
    difference = (angles - expected)[:, independent.moving]
    relative = np.sqrt((difference**2).mean(axis=0)) / np.sqrt((moved**2).mean())
    names = [JOINTS[j] for j in independent.moving]
    return {
        **description,
        "relative": dict(zip(names, relative.tolist(), strict=True)),
        "largest": dict(zip(names, np.abs(difference).max(axis=0).tolist(), strict=True)),
        "motion": float(np.sqrt((moved**2).mean())),
        "at_limit": bool(independent.met_limit),
    }


def show(cases):
    """Tables: errors of groups of cases, and the worst of them."""
    free = [case for case in cases if not case["at_limit"] and not case["noise"]]
    groups = {
        "within all limits, without noise": free,
        "of these, dry friction up to the variant's": [case for case in free if dry_friction(case) <= 1.0],
        "of these, dry friction above it": [case for case in free if dry_friction(case) > 1.0],
        "of these, wrist roll excited": [case for case in free if case["joint"] == "wrist_roll"],
        "of these, another joint excited": [case for case in free if case["joint"] != "wrist_roll"],
        "of these, flatter load-flow line": [case for case in free if case["load_flow_slope"] < 1.0],
        "at a limit, without noise": [case for case in cases if case["at_limit"] and not case["noise"]],
        "with process noise": [case for case in cases if case["noise"]],
    }
    heading("cases", "number", f"above {CLAIMED:g}", "relative error, median", "largest", "largest difference / urad")
    for name, group in groups.items():
        if not group:
            continue
        relative = [max(case["relative"].values()) for case in group]
        difference = max(max(case["largest"].values()) for case in group)
        above = sum(value > CLAIMED for value in relative)
        row(name, len(group), above, f"{np.median(relative):.1e}", f"{max(relative):.1e}", f"{1e6 * difference:.2g}")
    counts = []
    for key in ("variant", "joint", "kind"):
        numbers = Counter(case[key] for case in cases)
        counts.append(", ".join(f"{name} {number}" for name, number in sorted(numbers.items())))
    refused = sum(case["refusals"] for case in cases)
    print(f"\nRefused and drawn anew: {refused}. Drawn: {'; '.join(counts)}.\n")
    heading("worst cases", "relative error", "motion / mrad", "largest difference / urad")
    for group in (free, groups["at a limit, without noise"], groups["with process noise"]):
        for case in sorted(group, key=lambda case: -max(case["relative"].values()))[:2]:
            motion, largest = 1e3 * case["motion"], 1e6 * max(case["largest"].values())
            row(in_words(case), f"{max(case['relative'].values()):.1e}", f"{motion:.2g}", f"{largest:.2g}")


def dry_friction(case):
    """Dry friction of a case in multiples of the variant's."""
    return case["friction_level"] if case["friction"] in ("coulomb", "lugre") else 0.0


def in_words(case):
    """Arm, command and conditions of a case."""
    servo = "electric" if case["variant"] == "flight" else case["servo"]
    words = f"{case['variant']}, {servo}, payload {case['payload']}, {case['joint']}, {case['kind']}"
    words += f", {case['friction']}"
    if dry_friction(case):
        words += f" {case['friction_level']:.3g} times, presliding {1e3 * case['presliding']:.2g} mrad"
    if case["variant"] != "flight":
        words += f", {case['supply_pressure']:.3g} MPa, {case['oil_temperature']:.0f} degC"
    return words + (f", noise {case['noise']:.1g}" if case["noise"] else "")


def main():
    parser = options(__doc__)
    parser.add_argument("--count", type=int, default=500, help="of cases, the first ones")
    parser.add_argument("--out", type=Path, default=Path("build/random_arms.jsonl"), help="file of the results")
    asked = parser.parse_args()
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    asked.out.touch()
    kept = {number: case for number, case in map(json.loads, asked.out.read_text().splitlines())}
    for number in range(asked.count):
        if number in kept:
            continue
        case = compared(number)
        with asked.out.open("a") as file:
            file.write(json.dumps([number, case]) + "\n")
        kept[number] = case
        print(f"{number + 1} of {asked.count} done", file=sys.stderr)
    show([kept[number] for number in range(asked.count)])


if __name__ == "__main__":
    main()
