"""Records of the twin, simulated side by side and kept."""

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from hmtb_twin import Arm, simulate
from hmtb_twin.bus.joint_log import software_versions
from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.datasets.arm_truth import model_sha256
from scenarios.experiments.logged_arm import experiment_arm
from scenarios.files.atomic_write import replacing
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import fingerprint
from scenarios.problems.trial import Trial
from scenarios.problems.twin_experiment import SETTLING, twin_experiment, twin_record
from scenarios.problems.twin_name import TwinName, twin_name
from sysid import IOData

MARK = "twin-"
"""By which names of the twin's problems begin."""

MOST = 20_000
"""Records that are kept in memory: some hundred megabytes."""


BATCH = 500
"""Records that are simulated side by side at most, for the sake of memory."""

FOLDER = "HMTB_TWIN_RECORDS"
"""Environment variable that names the folder of records, so that processes that this one starts have it, too."""


@dataclass
class TwinRecords:
    """Records that are there: in memory, and as files in the folder that the environment names, if it names one."""

    _kept: dict[str, IOData] = field(default_factory=dict)

    @property
    def folder(self) -> Path | None:
        """Where records are kept as files; None: nowhere."""
        named = os.environ.get(FOLDER)
        return Path(named) if named else None

    def find(self, name: TwinName, seed: int) -> IOData | None:
        """A record, if it is there."""
        key = record_key(name, seed)
        if key not in self._kept and self.folder is not None:
            found = _read(self.folder / f"{key}.npz", name)
            if found is not None:
                self._keep(key, found)
        return self._kept.get(key)

    def simulate(self, wanted: Sequence[tuple[TwinName, int]], *, threads: int | None = None) -> int:
        """Simulate those of which there is no record yet, side by side, and keep them.

        Args:
            wanted: Problems with the seeds of their draws.
            threads: Threads for the physics; the bits do not depend on it, nor on what else is simulated beside.

        Returns:
            How many were simulated.

        Raises:
            ScenarioError: The physics failed in one.
        """
        missing = [one for one in dict.fromkeys(wanted) if self.find(*one) is None]
        for begin in range(0, len(missing), BATCH):
            some = missing[begin : begin + BATCH]
            logs = simulate([twin_experiment(*one) for one in some], threads=threads)
            if logs.failed:
                raise ScenarioError("; ".join(f"{name}: {why}" for name, why in logs.failed.items()))
            for (name, seed), log in zip(some, logs, strict=True):
                self._add(name, seed, twin_record(name, log))
        return len(missing)

    def draw(self, name: TwinName, seed: int) -> IOData:
        """A record; simulated alone where it is not there."""
        if self.find(name, seed) is None:
            self.simulate([(name, seed)], threads=1)
        found = self.find(name, seed)
        assert found is not None  # noqa: S101 - it has just been kept
        return found

    def _add(self, name: TwinName, seed: int, record: IOData) -> None:
        key, folder = record_key(name, seed), self.folder
        self._keep(key, record)
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            _write(folder / f"{key}.npz", record)

    def _keep(self, key: str, record: IOData) -> None:
        while len(self._kept) >= MOST:
            self._kept.pop(next(iter(self._kept)))
        self._kept[key] = record


RECORDS = TwinRecords()
"""Those that problems of this process draw from."""


def use_folder(folder: Path | None) -> None:
    """Let the problems of this process, and of those that it starts from now on, draw from the files of a folder.

    Args:
        folder: The folder that `prepare` fills; None: none.
    """
    if folder is None:
        os.environ.pop(FOLDER, None)
    else:
        os.environ[FOLDER] = str(folder.resolve())


def prepare(trials: Sequence[Trial], run_seed: int, *, folder: Path | None = None, threads: int | None = None) -> int:
    """Simulate the records of all trials of the twin's problems side by side; call it once before a run.

    Side by side the records cost a fraction of what they cost one by one. Trials of other problems are passed over.
    Processes that are started afterwards find the folder by themselves; one on another machine calls
    `use_folder(folder)`. Without it, or without `prepare`, `Problem.draw` simulates the same records alone, bit for
    bit, only more slowly.

    Args:
        trials: Trials of the run, of whatever problems.
        run_seed: Seed of the run.
        folder: Where records are kept as files for other processes; those that are there already are not made again.
            None: in memory alone, unless `use_folder` was called. A file is named by a hash of all that it was made
            from, arm, experiment, seed, our source and the versions of what it rests on, so that none that is out of
            date is ever taken.
        threads: Threads for the physics; all processors by default.

    Returns:
        How many records were simulated.

    Raises:
        ScenarioError: A name that is none, an amplitude that cannot be played, or physics that failed.
    """
    if folder is not None:
        use_folder(folder)
    wanted = [(twin_name(trial.problem), trial.seed(run_seed)) for trial in trials if trial.problem.startswith(MARK)]
    return RECORDS.simulate(wanted, threads=threads)


@lru_cache(maxsize=MOST)
def record_key(name: TwinName, seed: int) -> str:
    """Name of the file of a record: hash of all that it is made from."""
    experiment = twin_experiment(name, seed)
    made_from = {
        "experiment": repr(experiment),
        "arm": arm_hash(experiment_arm(experiment)),
        "source": fingerprint(),
        **software_versions(),
    }
    return sha256(json.dumps(made_from, sort_keys=True).encode()).hexdigest()


@lru_cache(maxsize=64)
def arm_hash(arm: Arm) -> str:
    """Hash of a compiled arm; see `model_sha256`."""
    return model_sha256(arm)


def _write(path: Path, record: IOData) -> None:
    with replacing(path) as partial, partial.open("wb") as stream:
        np.savez(stream, u=record.u, y=record.y)


def _read(path: Path, name: TwinName) -> IOData | None:
    """A record from a file; None where there is none, or one that is damaged and is made anew."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            u, y = stored["u"], stored["y"]
    except (OSError, ValueError, KeyError, BadZipFile, EOFError):
        return None
    shape = (SETTLING + name.samples, 1)
    if u.shape != shape or y.shape != shape or u.dtype != float or y.dtype != float:
        return None
    if not (np.isfinite(u).all() and np.isfinite(y).all()):
        return None
    return IOData(
        u,
        y,
        SAMPLE_TIME,
        input_names=(f"{name.joint} commanded",),
        output_names=(f"{name.joint} measured",),
        input_units=("rad",),
        output_units=("rad",),
        window=SETTLING,
        name=str(name),
    )
