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
from scenarios.datasets.build import build, check_installed, check_work
from scenarios.datasets.build_progress import Told
from scenarios.datasets.challenge_key import Bound, Key, begin_key, complete_key, read_key, unpack
from scenarios.datasets.challenge_publish import publish
from scenarios.datasets.challenge_secret import commitment, public_spec, secret_spec, student_spec
from scenarios.datasets.chunk import MOST_ROWS
from scenarios.datasets.executor import Executor
from scenarios.datasets.index import summary
from scenarios.datasets.layout import BUILD, INDEX, LOCK, MANIFEST, SPEC, SUMS, UNFINISHED
from scenarios.datasets.lock import locked
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.errors import ScenarioError
from scenarios.files.hashes import file_hash
from scenarios.files.provenance import fingerprint, versions

PRIVATE = ".private"
"""Ending of the folder beside the key in which data sets are built whole."""

MOST_NAME = 200
"""Bytes of the name of a key file: those of what stands beside it are longer."""

DONE = ".done"
"""Ending of that folder while it is being removed."""


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
    check_work(workers, rows)
    hidden = secret_spec(spec)
    check_installed(hidden)
    chosen = tuple(students)
    _check_scored(hidden)
    _check_place(key_path, out, [student_spec(hidden, one) for one in chosen] or [hidden])
    _remove_left(key_path)
    private = private_folder(key_path)
    if os.path.lexists(key_path):
        key = read_key(key_path)
        asked = hidden if spec.secret_seed else replace(hidden, secret_seed=key.spec.secret_seed)
        if key.spec != asked or key.students != chosen:
            raise ScenarioError(f"{key_path} is the key of another spec or other students: a key is never overwritten")
        if key.sets:
            raise ScenarioError(
                f"{key_path} is complete: its data sets are built; hmtb dataset build --key builds them again"
                + (f", and removes {private}, which still tells the truth" if os.path.lexists(private) else "")
            )
    else:
        _check_no_other(private, key_path)
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
    check_work(workers, rows)
    key = read_key(key_path)
    check_installed(key.spec)
    _check_place(key_path, out, key.specs)
    _remove_left(key_path)
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
                if folder.is_dir():
                    _check_whole(folder, spec, private)
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
            # Under another name at once: half a folder is never taken for a build to go on with.
            private.rename(_left(key.path))
        _remove_left(key.path)
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else str(error)
        raise ScenarioError(
            f"cannot write or read {error.filename or private}: {why}; the same command goes on from what is done"
        ) from error
    return Published(tuple(paths.values()), key.path, failed)


def _left(key_path: Path) -> Path:
    return key_path.with_name(key_path.name + PRIVATE + DONE)


def _remove_left(key_path: Path) -> None:
    """Remove what tells the truth and is not needed any more; a kill may have left some of it."""
    left = _left(key_path)
    try:
        if os.path.isdir(left) and not os.path.islink(left):
            shutil.rmtree(left)
    except OSError as error:
        raise ScenarioError(
            f"{left}, which tells the truth and is not needed any more, cannot be removed: {error.strerror or error}"
        ) from error


def _check_no_other(private: Path, key_path: Path) -> None:
    """Refuse to begin a key beside what another one keeps apart."""
    if os.path.lexists(private) and not (private.is_dir() and not any(private.iterdir())):
        raise ScenarioError(
            f"{private} holds what was built for a key {key_path.name} that is not there any more: put that key back "
            "to go on, or remove the folder, or name another key"
        )


def _check_whole(folder: Path, spec: DataSetSpec, private: Path) -> None:
    """Refuse a finished folder of another spec, or one of which a part is missing."""
    missing = [name for name in (SPEC, BUILD, MANIFEST, INDEX, SUMS) if not (folder / name).is_file()]
    if missing:
        raise ScenarioError(f"{folder} is damaged: no {missing[0]} in it; remove {private} to build anew")
    if (folder / SPEC).read_bytes() != spec.to_toml().encode():
        raise ScenarioError(
            f"{folder} is of another key or another spec than {private.name.removesuffix(PRIVATE)}: remove {private} "
            "to build anew"
        )


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
    """Refuse scored records whose commands tell what is withheld."""
    plan = DataSetPlan(spec)
    for number in range(len(plan) // plan.twins):
        entry = plan[number]
        if entry.part == "test" and _answers(entry.experiment):
            raise ScenarioError(
                f"{entry.name}: its commands follow the arm, by an operator who sees it or an emergency shutdown, and "
                "would tell of the outputs that are withheld; expected a command that depends on the excitation alone"
            )


def _answers(experiment: Experiment) -> bool:
    """Whether commands depend on how the arm moved."""
    return experiment.operator() is not None or bool(experiment.shutdown)


def _check_place(key_path: Path, out: Path, specs: Sequence[DataSetSpec]) -> None:
    """Refuse a key where it would be published."""
    size = len(os.fsencode(key_path.name))
    if size > MOST_NAME:
        raise ScenarioError(
            f"cannot write the key {key_path}: a name of {size} bytes given, expected {MOST_NAME} at most"
        )
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
