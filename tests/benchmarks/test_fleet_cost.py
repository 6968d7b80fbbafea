"""What as many arms as experiments cost against one arm for all, and against their bare physics, in one process."""

from collections.abc import Sequence
from dataclasses import replace
from statistics import median
from time import perf_counter, process_time

import numpy as np

from hmtb_twin import Specimen, load_arm, simulate
from hmtb_twin.parameters.specimen import LINK_NAMES
from scenarios import Scenario, load
from tests.benchmarks.bare_steps import bare_seconds

ROWS = 64
SECONDS = 20.0
ROUNDS = 3


def test_a_fleet_costs_little_more_than_one_arm_and_than_bare_steps():
    simulate(_experiments([Specimen()] * ROWS, seconds=0.1))
    ratios = []
    for turn in range(ROUNDS):
        # Arms that were never loaded before: their compilation is part of the cost.
        rng = np.random.default_rng(turn)
        fleet = [Specimen(mass=tuple(rng.uniform(0.9, 1.1, len(LINK_NAMES)))) for _ in range(ROWS)]
        distinct, distinct_over_physics = _cost(_experiments(fleet), fleet)
        one, one_over_physics = _cost(_experiments([Specimen()] * ROWS), [Specimen()])
        ratios.append((distinct[0] / one[0], distinct[0] / distinct[1], one[0] / one[1]))
        print(
            f"\nround {turn}: wall of simulate / wall of its physics: {ROWS} arms {distinct_over_physics:.3f}, ", end=""
        )
        print(f"one arm {one_over_physics:.3f}", end="")
    against_one, over_bare, one_over_bare = (median(column) for column in zip(*ratios, strict=True))
    print(f"\n{ROWS} experiments of {SECONDS:g} s: {ROWS} arms / one arm {against_one:.3f}, ", end="")
    print(f"simulate / bare mj_step: {ROWS} arms {over_bare:.3f}, one arm {one_over_bare:.3f} (medians)", end="")
    assert against_one <= 1.15
    assert over_bare <= 1.35


def _experiments(specimens: Sequence[Specimen], seconds: float = SECONDS) -> list[Scenario]:
    plain = load("siso-5-shoulder_yaw")
    return [
        replace(plain, name=f"arm-{i}", seed=i, duration=seconds, specimen=specimen)
        for i, specimen in enumerate(specimens)
    ]


def _cost(experiments: Sequence[Scenario], specimens: Sequence[Specimen]) -> tuple[tuple[float, float], float]:
    """Return processor seconds of `simulate` and of its bare steps, and the wall of the first over its physics."""
    wall, started = perf_counter(), process_time()
    logs = simulate(experiments, threads=1)
    ours, wall = process_time() - started, perf_counter() - wall
    arms = [load_arm(specimen=specimen) for specimen in specimens]
    bare = sum(bare_seconds(arms[i % len(arms)], log) for i, log in enumerate(logs))
    return (ours, bare), wall / logs.physics_seconds
