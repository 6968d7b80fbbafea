"""What a specimen of the arm costs to load, to bring to rest and to linearise, and what a thousand leave in memory."""

import gc
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import process_time

import numpy as np
import pytest

from hmtb_twin import Plant, linearize, load_arm
from hmtb_twin.arm import controller_model as controllers
from hmtb_twin.parameters.specimen_draw import Distribution, TwinDistributions, draw_specimen
from hmtb_twin.parameters.values import OPERATING_POSE
from hmtb_twin.parameters.variants import variant_named

POPULATION = TwinDistributions(
    mass=Distribution("normal", 0.05),
    stretch=Distribution("normal", 0.05),
    shear=Distribution("normal", 0.05),
    shift=Distribution("normal", 0.1),
    kp=Distribution("normal", 0.05),
    dry_friction=Distribution("lognormal", 0.3),
)
ROUNDS = 60
PAGE = 4096


def _milliseconds(step: Callable[[int], object]) -> float:
    taken = []
    for i in range(ROUNDS):
        started = process_time()
        step(i)
        taken.append(process_time() - started)
    return 1e3 * median(taken)


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
    build = _milliseconds(lambda _: controllers.controller_model.__wrapped__("rpcm", variant_named("nominal").name))
    print(f"\nload a specimen {own:.2f} ms, {own / plain:.2f} times a nominal arm under another plant; ", end="")
    print(
        f"rest {rest:.2f} ms; load and linearize {truth:.2f} ms; the shared controller's model {build:.2f} ms", end=""
    )
    assert own < 1.5 * plain
    assert truth < 10.0 * own


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="no /proc")
def test_a_thousand_specimens_leave_no_more_than_the_cache_holds():
    def resident() -> float:
        gc.collect()
        return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE / 2**20

    sizes = []
    for i in range(1000):
        arm = load_arm(specimen=draw_specimen(POPULATION, np.random.SeedSequence(2, spawn_key=(i,)))[0])
        arm.rest(arm.pose(OPERATING_POSE))
        if i % 100 == 99:
            sizes.append(resident())
    print("\nresident after 100, 200, ... loads: " + ", ".join(f"{size:.1f}" for size in sizes) + " MiB", end="")
    # The cache is full after 64 arms.
    assert sizes[-1] - sizes[0] < 5.0
