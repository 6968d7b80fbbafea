"""Build data sets whose truth is kept apart: one for all, or one for every student, and one key file.

Each is built whole in a private folder beside the key, then published without what only the key holds. The key exists
before anything is simulated, so that a build that ends before its end is gone on with; the private folder goes when
the key holds everything.
"""

import json
import os
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hmtb_twin import Experiment
from hmtb_twin.parameters import SAMPLE_RATE
from scenarios.dataset_build.build import build
from scenarios.dataset_build.chunk import MOST_ROWS
from scenarios.dataset_build.executor import Executor
from scenarios.dataset_build.index import summary
from scenarios.dataset_build.lock import locked
from scenarios.dataset_build.progress import Told
from scenarios.datasets.hashes import file_hash
from scenarios.datasets.layout import BUILD, LOCK, SUMS, UNFINISHED
from scenarios.datasets.plan import Plan
from scenarios.datasets.spec import DataSetSpec
from scenarios.errors import ScenarioError
from scenarios.provenance import fingerprint, versions
from scenarios.teaching.key_file import Bound, Key, begin_key, complete_key, read_key, unpack
from scenarios.teaching.publish import publish
from scenarios.teaching.secret import commitment, public_spec, secret_spec, student_spec

PRIVATE = ".private"
"""Ending of the folder beside the key in which data sets are built whole."""


@dataclass(frozen=True)
class Published:
    """What came of a build.

    Attributes:
        paths: The published folders, in the order of the students.
        key: The key file.
        failed: Why experiments have no record, by label and name: for the owner of the key alone.
    """

    paths: tuple[Path, ...]
    key: Path
    failed: dict[str, str]


def build_hidden(
    spec: DataSetSpec,
    out: Path,
    key_path: Path,
    *,
    students: Sequence[str] = (),
    workers: int | None = None,
    rows: int = MOST_ROWS,
    executor: Executor | None = None,
    progress: Told | None = None,
) -> Published:
    """Build data sets and hide their truth, or go on with a build that was interrupted.

    Args:
        spec: The spec; its seed counts for nothing: a secret one is drawn, unless it has a secret one.
        out: Folder in which those of the data sets are made.
        key_path: The key file; that of an interrupted build of the same spec is gone on with.
        students: Ids, for a data set each; none: one data set for all.
        workers: Threads for the physics.
        rows: Experiments that run side by side at most.
        executor: Who runs the experiments instead of this process.
        progress: Told how far each build is.

    Raises:
        ScenarioError: The truth of such a spec cannot be hidden; the key is of something else, complete, in a folder
            that is published, or cannot be written; or what `build` raises.
    """
    hidden = secret_spec(spec)
    chosen = tuple(students)
    _check_scored(hidden)
    _check_place(key_path, out, [student_spec(hidden, one) for one in chosen] or [hidden])
    if os.path.lexists(key_path):
        key = read_key(key_path)
        asked = hidden if spec.secret_seed else replace(hidden, secret_seed=key.spec.secret_seed)
        if key.spec != asked or key.students != chosen:
            raise ScenarioError(f"{key_path} is the key of another spec or other students: a key is never overwritten")
        if key.sets:
            raise ScenarioError(
                f"{key_path} is complete: its data sets are built; hmtb dataset build --key builds them again"
            )
    else:
        for one in [student_spec(hidden, one) for one in chosen] or [hidden]:
            if (out / one.label).exists():
                raise ScenarioError(f"{out / one.label} is already there: a version is never overwritten")
        key = begin_key(key_path, hidden, chosen)
    return _built(key, out, workers, rows, executor, progress)


def build_again(
    key_path: Path,
    out: Path,
    *,
    workers: int | None = None,
    rows: int = MOST_ROWS,
    executor: Executor | None = None,
    progress: Told | None = None,
) -> Published:
    """Build the data sets of a key again, with the same bits, or go on with a build from the key alone.

    Args:
        key_path: The key file.
        out: Folder in which those of the data sets are made.
        workers: Threads for the physics.
        rows: Experiments that run side by side at most.
        executor: Who runs the experiments instead of this process.
        progress: Told how far each build is.

    Raises:
        ScenarioError: No key, or other software than it was made with; or what `build` raises.
    """
    key = read_key(key_path)
    _check_place(key_path, out, key.specs)
    if key.sets:
        _check_software(key)
    return _built(key, out, workers, rows, executor, progress)


def private_folder(key_path: Path) -> Path:
    """Where the data sets of a key are built whole."""
    return key_path.with_name(key_path.name + PRIVATE)


def _built(
    key: Key, out: Path, workers: int | None, rows: int, executor: Executor | None, progress: Told | None
) -> Published:
    private = private_folder(key.path)
    try:
        private.mkdir(mode=0o700, exist_ok=True)
        paths: dict[str, Path] = {}
        whole: dict[str, Path] = {}
        sets: dict[str, Bound] = {}
        failed: dict[str, str] = {}
        with locked(private):
            for spec in key.specs:
                folder = private / spec.label
                if not folder.is_dir() or (folder / LOCK).exists():
                    build(spec, private, workers=workers, rows=rows, executor=executor, progress=progress)
                failed |= {f"{spec.label}: {name}": why for name, why in summary(folder).failed.items()}
                whole[spec.label] = folder
                sums = file_hash(folder / SUMS)
                if key.sets and key.sets[spec.label].sums != sums:
                    raise ScenarioError(
                        f"{spec.label} comes out with other bits than in {key.path}; they are in {folder}"
                    )
                committed = commitment(key.salt, spec, sums)
                paths[spec.label] = publish(folder, public_spec(spec, committed), out)
                sets[spec.label] = Bound(committed, sums, file_hash(paths[spec.label] / SUMS))
            if not key.sets:
                complete_key(key, sets, whole)
            shutil.rmtree(private)
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else str(error)
        raise ScenarioError(
            f"cannot write or read {error.filename or private}: {why}; the same command goes on from what is done"
        ) from error
    return Published(tuple(paths.values()), key.path, failed)


def _check_software(key: Key) -> None:
    """Refuse to build again with other software than a key was made with: the bits would be others."""
    with tempfile.TemporaryDirectory(prefix="hmtb-key-") as place:
        for label in key.sets:
            record = json.loads((unpack(key, label, Path(place), only=(BUILD,)) / BUILD).read_text(encoding="utf-8"))
            now = {"data_set": label, "source": fingerprint(), "versions": versions()}
            if record != now:
                then = {**record["versions"], "source of this software": record["source"][:12]}
                given = {**versions(), "source of this software": fingerprint()[:12]}
                differ = [f"{k} {then.get(k)} then, {given.get(k)} now" for k in given if then.get(k) != given[k]]
                raise ScenarioError(
                    f"{key.path} was made with other software: {'; '.join(differ)}; expected the same, which gives the "
                    "same bits"
                )


def _check_scored(spec: DataSetSpec) -> None:
    """Refuse scored records of which nothing would be withheld, or whose commands tell what is withheld."""
    plan = Plan(spec)
    for number in range(len(plan) // plan.twins):
        entry = plan[number]
        if entry.part == "test" and _answers(entry.experiment):
            raise ScenarioError(
                f"{entry.name}: its commands follow the arm, by an operator who sees it or an emergency shutdown, and "
                "would tell of the outputs that are withheld; expected a command that depends on the excitation alone"
            )
        if entry.part == "test" and entry.experiment.duration * SAMPLE_RATE <= spec.window:
            raise ScenarioError(
                f"{entry.name} has {entry.experiment.duration * SAMPLE_RATE:g} samples, its window {spec.window}: "
                "nothing of it would be withheld"
            )


def _answers(experiment: Experiment) -> bool:
    """Whether commands depend on how the arm moved."""
    return experiment.operator() is not None or bool(experiment.shutdown)


def _check_place(key_path: Path, out: Path, specs: Sequence[DataSetSpec]) -> None:
    """Refuse a key where it would be published."""
    place = key_path.resolve()
    for spec in specs:
        for folder in (out / spec.label, out / (spec.label + UNFINISHED)):
            if folder.resolve() in (place, *place.parents):
                raise ScenarioError(
                    f"{key_path} given as key, inside of {folder}, which is published; put it elsewhere"
                )
    if os.path.isdir(key_path):
        raise ScenarioError(f"{key_path} is a folder; expected the name of a file for the key")
    if not place.parent.is_dir():
        raise ScenarioError(f"no folder {place.parent} for the key {key_path.name}: expected one that is there")
