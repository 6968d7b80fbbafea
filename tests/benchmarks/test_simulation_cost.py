"""What the campaign costs against the bare physics of its own models, side by side in one process, one thread each."""

from dataclasses import replace
from statistics import median

import numpy as np
import pytest

from hmtb_twin import load_arm, simulate
from scenarios import load, names
from scenarios.experiments.registry import tests_of
from tests.benchmarks.tables import bare_seconds, timed


@pytest.mark.parametrize(
    ("campaign", "most"),
    [
        (names(tag="table1"), 1.25),
        (names(tag="table2"), 1.6),
        ((*names(tag="table1"), *names(tag="table2"), "rpcm"), 1.35),
    ],
    ids=["24 single-joint tests", "13 Cartesian tests", "the whole campaign with the RPCM task"],
)
def test_campaign_costs_little_more_than_bare_steps(campaign, most, request):
    _costs_at_most(most, [replace(load(name), duration=10.0) for name in campaign], request)


@pytest.mark.parametrize("arm", ["panda", "ur10", "xarm7", "kinova"])
def test_another_arm_costs_little_more_than_bare_steps(arm, request):
    _costs_at_most(1.25, [load(name, duration=5.0, arm=arm) for name in tests_of(arm)], request)


def _costs_at_most(most, experiments, request):
    """Simulate in turn with bare steps of the same models."""
    arms = [load_arm(entry.variant, entry.payload, worksite=entry.worksite) for entry in experiments]
    simulate(experiments[:1])
    ratios = []
    for _ in range(7):
        logs, ours = timed(simulate, experiments, threads=1)
        bare = sum(bare_seconds(arm, log) for arm, log in zip(arms, logs, strict=True))
        ratios.append(ours / bare)
    print(f"\n{request.node.callspec.id}, {logs.steps} steps: simulate / bare mj_step {median(ratios):.3f}", end="")
    print(f" (median of {np.round(ratios, 3)})")
    assert median(ratios) <= most
