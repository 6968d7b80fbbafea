"""Settings that hold for every test."""

import os
import random
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING

# Before numpy loads its BLAS: waiting threads make small problems many times slower, and timings meaningless.
for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"
# No test may open a window.
os.environ["MPLBACKEND"] = "Agg"
# Children buffer what they print, as they do for most users: a full disk shows when they end.
os.environ.pop("PYTHONUNBUFFERED", None)

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

if TYPE_CHECKING:
    from hmtb_twin.bus.record import BusRecord

# The same examples on every run, and no verdict that depends on how busy the machine is.
settings.register_profile("house", deadline=None, derandomize=True, database=None)
settings.load_profile("house")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that shuffles the tests."""
    parser.addoption("--shuffle", metavar="SEED", help="run the tests in a random order drawn from this seed")


# What is expensive to set up is set up once, not once in each process: tests of one file, and all that look at the
# study, stay together. Thorough tests take longer than any set-up, minutes each, and are shared out one by one. What
# takes long begins first, so that no process ends alone with it.
@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark tests of a study as slow, and say which tests stay together when they run in several processes."""
    groups = {item: _group_of(item) for item in items}
    for item, group in groups.items():
        if group == "study":
            item.add_marker(pytest.mark.slow)
    seed = config.getoption("--shuffle")
    if seed is not None:
        # Every process draws the same order, or the tests could not be shared out.
        random.Random(seed).shuffle(items)
    if not hasattr(config, "workerinput"):
        return
    slow = Counter(group for item, group in groups.items() if item.get_closest_marker("slow"))
    for item, group in groups.items():
        item.add_marker(pytest.mark.xdist_group(group))
    if seed is None:
        items.sort(key=lambda item: (groups[item] != "study", not _is_thorough(item), -slow[groups[item]]))


def _is_thorough(item: pytest.Item) -> bool:
    return item.get_closest_marker("thorough") is not None


def _group_of(item: pytest.Item) -> str:
    """Name of the tests that run in one process with this one."""
    if "study_run" in getattr(item, "fixturenames", ()):
        return "study"
    return item.nodeid if _is_thorough(item) else item.nodeid.partition("::")[0]


@pytest.fixture(scope="session")
def small_signal_findings() -> tuple[str, ...]:
    """Sentences of the maps of the nominal arm at the default density, without those over amplitude and friction."""
    from tests.shared import shared

    def make() -> tuple[str, ...]:
        from hmtb_twin import load_arm
        from hmtb_twin.parameters.variants import OPERATING_POSE
        from scenarios.truth.map_findings import findings
        from scenarios.truth.maps import Density, maps

        return findings(maps(load_arm(), OPERATING_POSE, Density(amplitudes=())))

    return shared("small-signal-findings", make)


@pytest.fixture(scope="session")
def bus_record() -> "Callable[..., BusRecord]":
    """Make a record of the bus: measured angles in whole quanta, everything else any number."""
    import numpy as np

    from hmtb_twin.bus.record import BusRecord
    from hmtb_twin.bus.words import BAM

    def make(name: str, length: int, seed: int = 0, axes: tuple[str, ...] = ("elbow_pitch",)) -> BusRecord:
        rng = np.random.default_rng(seed)
        return BusRecord(
            name=name,
            dt=0.02,
            axes=axes,
            commanded=rng.uniform(-3.0, 3.0, (length, 7)),
            measured=BAM * rng.integers(-(2**15), 2**15, (length, 7)),
            wrench=rng.normal(0.0, 60.0, (length, 6)),
            status=rng.integers(0, 64, length),
            saturated=np.zeros(length),
        )

    return make
