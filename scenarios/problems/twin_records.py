"""Records of the arm's problems, simulated side by side and kept in memory and in files."""

import json
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from hmtb_twin import simulate
from hmtb_twin.bus.joint_log import software_versions
from hmtb_twin.files.atomic_write import replacing
from hmtb_twin.parameters.values import SAMPLE_TIME
from hmtb_twin.run.experiment_row import experiment_arm
from scenarios.datasets.arm_truth import model_sha256
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import fingerprint
from scenarios.problems.trial import TWIN, Trial
from scenarios.problems.twin_name import SETTLING, TwinName, twin_name
from sysid import IOData

MOST = 20_000
"""Records that are kept in memory: some hundred megabytes."""

BATCH = 500
"""Records that are simulated side by side at most: their states and logs stay below a gigabyte."""

FOLDER = "HMTB_TWIN_RECORDS"
"""Environment variable that names the folder of records, so that processes that this one starts know it too."""

_KEPT: dict[str, IOData] = {}


def records_folder() -> Path | None:
    """Folder in which records are kept as files; None: in memory alone."""
    name = os.environ.get(FOLDER)
    return Path(name) if name else None


def use_folder(folder: Path) -> None:
    """Let this process, and those that it starts from now on, draw records from the files of a folder."""
    os.environ[FOLDER] = str(folder.resolve())


def prepare(
    trials: Sequence[Trial],
    run_seed: int,
    *,
    folder: Path | None = None,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> int:
    """Simulate the records of all trials of the arm's problems side by side, at a tenth of the cost of one by one.

    Call it once before a run. Without it `draw_record` simulates the same records alone, bit for bit.

    Args:
        trials: Trials of the run; those of other problems are skipped.
        run_seed: Seed of the run.
        folder: For files of the records, for other processes; existing ones are used. A file is named by a hash of all
            that it was made from (arm, experiment, seed, our source, versions), so that no outdated one is ever used.
            None: in memory alone, unless `use_folder` was called.
        threads: Threads for the physics; all processors by default.
        progress: Called with the ticks done and all ticks of the records that are simulated together.

    Returns:
        Number of simulated records.

    Raises:
        ScenarioError: A name that is none, an amplitude that cannot be played, or physics that failed.
    """
    if folder is not None:
        use_folder(folder)
    of_arm = [trial for trial in trials if trial.problem.startswith(TWIN)]
    draws = [(twin_name(trial.problem), trial.seed(run_seed)) for trial in of_arm]
    return _simulate(draws, threads, progress)


def draw_record(name: TwinName, seed: int) -> IOData:
    """Record of a problem and a seed: from memory, from a file, or else simulated now."""
    record = _find(name, seed)
    if record is None:
        _simulate([(name, seed)], threads=1)
        record = _KEPT[record_key(name, seed)]
    return record


@lru_cache(maxsize=MOST)
def record_key(name: TwinName, seed: int) -> str:
    """Name of the file of a record: hash of all that it is made from."""
    experiment = name.experiment(seed)
    made_from = {
        "experiment": repr(experiment),
        "arm": arm_hash(experiment_arm(experiment)),
        "source": fingerprint(),
        **software_versions(),
    }
    return sha256(json.dumps(made_from, sort_keys=True).encode()).hexdigest()


arm_hash = lru_cache(maxsize=64)(model_sha256)
"""Hash of a compiled arm."""


def _simulate(
    draws: Sequence[tuple[TwinName, int]],
    threads: int | None,
    progress: Callable[[int, int], None] | None = None,
) -> int:
    """Simulate the draws that do not exist yet; the bits depend neither on the threads nor on the other draws."""
    missing = [draw for draw in dict.fromkeys(draws) if _find(*draw) is None]
    folder = records_folder()
    if missing and folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    for begin in range(0, len(missing), BATCH):
        batch = missing[begin : begin + BATCH]
        logs = simulate([name.experiment(seed) for name, seed in batch], threads=threads, progress=progress)
        if logs.failed:
            raise ScenarioError("; ".join(f"{name}: {why}" for name, why in logs.failed.items()))
        for (name, seed), log in zip(batch, logs, strict=True):
            record, key = name.record(log), record_key(name, seed)
            _keep(key, record)
            # Whole or not at all: other processes read the folder at the same time.
            if folder is not None:
                with replacing(folder / f"{key}.npz") as partial, partial.open("wb") as stream:
                    np.savez(stream, u=record.u, y=record.y)
    return len(missing)


def _find(name: TwinName, seed: int) -> IOData | None:
    """A record from memory or from a file; None where there is none, or a damaged one, which is simulated again."""
    key, folder = record_key(name, seed), records_folder()
    if key not in _KEPT and folder is not None:
        with (
            suppress(OSError, ValueError, KeyError, BadZipFile, EOFError),
            np.load(folder / f"{key}.npz", allow_pickle=False) as arrays,
        ):
            record = IOData(arrays["u"], arrays["y"], SAMPLE_TIME, window=SETTLING)
            # A file that was cut short may still be read.
            if record.u.shape == record.y.shape == (SETTLING + name.samples, 1):
                _keep(key, record)
    return _KEPT.get(key)


def _keep(key: str, record: IOData) -> None:
    # A dictionary keeps the order of insertion: the oldest goes first.
    while len(_KEPT) >= MOST:
        _KEPT.pop(next(iter(_KEPT)))
    _KEPT[key] = record
