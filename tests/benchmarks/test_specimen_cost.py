"""Costs of a specimen to load, rest and linearise, of a thousand in memory, and of a fleet against one arm."""

import gc
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np
import pytest

from hmtb_twin import Plant, Specimen, linearize, load_arm, simulate
from hmtb_twin.arm import controller_model as controllers
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.parameters.specimen import LINK_NAMES
from hmtb_twin.parameters.specimen_draw import Distribution, TwinDistributions, draw_specimen
from hmtb_twin.parameters.variants import OPERATING_POSE
from scenarios import load
from tests.benchmarks.tables import bare_seconds, timed

POPULATION = TwinDistributions(
    mass=Distribution("normal", 0.05),
    stretch=Distribution("normal", 0.05),
    shear=Distribution("normal", 0.05),
    shift=Distribution("normal", 0.1),
    kp=Distribution("normal", 0.05),
    dry_friction=Distribution("lognormal", 0.3),
)
ROUNDS = 60
ARMS, FLEET_SECONDS = 64, 20.0


def _milliseconds(step):
    return 1e3 * median(timed(step, i)[1] for i in range(ROUNDS))


def test_a_specimen_costs_what_its_compilation_costs():
    specimens = [draw_specimen(POPULATION, np.random.SeedSequence(1, spawn_key=(i,)))[0] for i in range(3 * ROUNDS)]
    builds = controllers.controller_model.cache_info().misses
    # A plant of its own makes the nominal arm be loaded anew too.
    plain = _milliseconds(lambda i: load_arm(plant=Plant(friction_level=1.0 + 1e-6 * (i + 1))))
    own = _milliseconds(lambda i: load_arm(specimen=specimens[i]))
    assert controllers.controller_model.cache_info().misses <= builds + 1
    arms = [load_arm(specimen=one) for one in specimens[:ROUNDS]]
    rest = _milliseconds(lambda i: arms[i].rest(arms[i].pose(OPERATING_POSE)))
    truth = _milliseconds(lambda i: linearize(load_arm(specimen=specimens[ROUNDS + i]), amplitudes=()))
    controllers.controller_model.cache_clear()
    build = _milliseconds(lambda _: controllers.controller_model.__wrapped__("rpcm", arm_named("nominal").name))
    print(f"\nload a specimen {own:.2f} ms, {own / plain:.2f} times a nominal arm under another plant; ", end="")
    print(
        f"rest {rest:.2f} ms; load and linearize {truth:.2f} ms; the shared controller's model {build:.2f} ms", end=""
    )
    assert own < 1.5 * plain
    assert truth < 10.0 * own


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="no /proc")
def test_a_thousand_specimens_leave_no_more_than_the_cache_holds():
    def resident():
        gc.collect()
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 2**20

    sizes = []
    for i in range(1000):
        arm = load_arm(specimen=draw_specimen(POPULATION, np.random.SeedSequence(2, spawn_key=(i,)))[0])
        arm.rest(arm.pose(OPERATING_POSE))
        if i % 100 == 99:
            sizes.append(resident())
    print("\nresident after 100, 200, ... loads: " + ", ".join(f"{size:.1f}" for size in sizes) + " MiB", end="")
    # The cache is full after 64 arms.
    assert sizes[-1] - sizes[0] < 5.0


def test_a_fleet_costs_little_more_than_one_arm_and_than_bare_steps():
    simulate(_experiments([Specimen()] * ARMS, seconds=0.1))
    ratios = []
    for turn in range(3):
        # Arms that were never loaded before: their compilation is part of the cost.
        rng = np.random.default_rng(turn)
        fleet = [Specimen(mass=tuple(rng.uniform(0.9, 1.1, len(LINK_NAMES)))) for _ in range(ARMS)]
        many, bare = _cost(_experiments(fleet), fleet)
        one, one_bare = _cost(_experiments([Specimen()] * ARMS), [Specimen()])
        ratios.append((many / one, many / bare, one / one_bare))
    against_one, over_bare, one_over_bare = (median(column) for column in zip(*ratios, strict=True))
    print(f"\n{ARMS} experiments of {FLEET_SECONDS:g} s: {ARMS} arms / one arm {against_one:.3f}, ", end="")
    print(f"simulate / bare mj_step: {ARMS} arms {over_bare:.3f}, one arm {one_over_bare:.3f} (medians)", end="")
    assert against_one <= 1.15
    assert over_bare <= 1.35


def _experiments(specimens, seconds=FLEET_SECONDS):
    plain = replace(load("siso-5-shoulder_yaw"), duration=seconds)
    return [replace(plain, name=f"arm-{i}", seed=i, specimen=specimen) for i, specimen in enumerate(specimens)]


def _cost(experiments, specimens):
    """Return processor seconds of `simulate` and of its bare steps."""
    logs, ours = timed(simulate, experiments, threads=1)
    arms = [load_arm(specimen=specimen) for specimen in specimens]
    return ours, sum(bare_seconds(arms[i % len(arms)], log) for i, log in enumerate(logs))
