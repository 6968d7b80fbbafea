"""Which nonlinearity keeps the intervals from the truth: coverage over 20 seeds with one thing after another off."""

from dataclasses import replace

import sysid
from hmtb_twin import STUDIED_JOINTS, linearize, load_arm, simulate
from scenarios import load
from scenarios.experiments.campaign import Condition
from scenarios.experiments.log_review import prepared
from scenarios.experiments.model_structures import SUFFICIENT
from scenarios.thesis.attribution import CONDITIONS, scaled
from tests.benchmarks.tables import heading, row

SEEDS = range(1, 21)


def test_coverage_by_condition():
    truth = linearize(load_arm())
    planned = {joint: load(f"siso-5-{joint}") for joint in STUDIED_JOINTS}
    smooth = {joint: Condition(friction=False).applied(test) for joint, test in planned.items()}
    print()
    heading("condition", *(joint.replace("_", " ") for joint in STUDIED_JOINTS))
    for number, condition in enumerate(CONDITIONS):
        runs = {joint: (test, smooth[joint], scaled(smooth[joint]))[number] for joint, test in planned.items()}
        covered = dict.fromkeys(STUDIED_JOINTS, 0)
        bandwidths: dict[str, list[float]] = {joint: [] for joint in STUDIED_JOINTS}
        for log in simulate([replace(test, seed=seed) for test in runs.values() for seed in SEEDS]):
            (joint,) = log.axes
            band = sysid.oe(prepared(log, joint), *SUFFICIENT[joint]).bandwidth()
            covered[joint] += int(band.covers(truth.joint(joint).bandwidth_hz)[0, 0])
            bandwidths[joint].append(float(band.hz[0, 0]))
        cells = [f"{covered[j]} of {len(SEEDS)}, mean {sum(bandwidths[j]) / len(SEEDS):.4f} Hz" for j in STUDIED_JOINTS]
        row(condition, *cells)
    row("true bandwidth", *(f"{truth.joint(j).bandwidth_hz:.4f} Hz" for j in STUDIED_JOINTS))
    assert min(covered.values()) >= 17
