"""The key of data sets with hidden truth: one file with all that is kept apart.

A zip archive whose members are stored as they are. `key.json` holds the salt, the secret seed, the spec and, by data
set, what binds it to the published folder; below the label of each data set stand its truth, its scored records and its
papers. It is written before anything is simulated, with the secrets alone, and replaced once, when all is published, by
a file with the same secrets and the rest.
"""

import json
import os
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from scenarios.datasets.challenge_secret import commitment, drawn_secret, student_spec
from scenarios.datasets.layout import DATA, SPEC, SUMS
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.atomic_write import PARTIAL, sync_folder
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.hashes import bytes_hash

FORMAT = "hmtb key 1"
"""Marks the files of this version."""

HEAD = "key.json"
"""The member with the secrets."""

MOST_HEAD = 2**26
"""No such member is larger, in bytes."""

MOST_BYTES = 2**36
"""No other member is larger, in bytes."""

REGENERATED = (f"{DATA}/train/", f"{DATA}/validation/")
"""What is not kept: it is published, but for attributes that follow from the spec."""


@dataclass(frozen=True)
class Bound:
    """What binds a published folder to the key.

    Attributes:
        commitment: What the folder says of the key.
        sums: SHA-256 of the checksums of the whole data set.
        published: SHA-256 of the checksums of the published folder.
    """

    commitment: str
    sums: str
    published: str


@dataclass(frozen=True)
class Key:
    """What is kept apart.

    Attributes:
        path: The file.
        salt: 32 hexadecimal digits.
        spec: The spec with the secret seed.
        students: Ids, in order; none where there is one data set for all.
        sets: By label; empty as long as the data sets are being built.
    """

    path: Path
    salt: str
    spec: DataSetSpec
    students: tuple[str, ...] = ()
    sets: Mapping[str, Bound] = field(default_factory=dict)

    @property
    def specs(self) -> tuple[DataSetSpec, ...]:
        """The specs of all data sets, each with its own secret seed."""
        return tuple(student_spec(self.spec, one) for one in self.students) or (self.spec,)

    def spec_of(self, label: str) -> DataSetSpec:
        """The spec of a data set, by its label.

        Raises:
            ScenarioError: The key is of others.
        """
        known = {spec.label: spec for spec in self.specs}
        if label not in known:
            raise ScenarioError(f"{self.path} is no key of {label!r}: {unknown('data set', label, known)}")
        return known[label]

    def label_of(self, student: str | None) -> str:
        """The label of a student's data set, or of the one for all.

        Raises:
            ScenarioError: No such student, or none said where there are several.
        """
        if not self.students:
            if student is not None:
                raise ScenarioError(f"student {student!r} given; {self.path} is of one data set for all")
            return self.spec.label
        if student is None:
            if len(self.students) == 1:
                return self.specs[0].label
            raise ScenarioError(f"{self.path} is of {len(self.students)} students: say which, --student ID")
        if student not in self.students:
            raise ScenarioError(f"{self.path}: {unknown('student', student, self.students)}")
        return student_spec(self.spec, student).label

    def complete(self) -> None:
        """Refuse a key of which the data sets are not built to their end.

        Raises:
            ScenarioError: They are not.
        """
        if not self.sets:
            raise ScenarioError(
                f"{self.path} is of data sets that are not built to their end; go on with: hmtb dataset build "
                f"SPEC --hide-truth {self.path}"
            )


def begin_key(path: Path, spec: DataSetSpec, students: tuple[str, ...]) -> Key:
    """Write a new key with secrets alone; nobody but its owner can read it.

    Args:
        path: The file, which must not be there.
        spec: With the secret seed.
        students: Ids.

    Raises:
        ScenarioError: It is there, or cannot be written.
    """
    key = Key(path, drawn_secret(), spec, students)
    try:
        with _writing(path, replace=False) as archive:
            _add(archive, HEAD, _head(key))
    except FileExistsError:
        raise ScenarioError(f"{path} is already there: a key is never overwritten") from None
    except OSError as error:
        raise ScenarioError(
            f"cannot write the key {path}: {error.strerror or error}; expected a place that can be written"
        ) from error
    return key


def complete_key(key: Key, sets: Mapping[str, Bound], folders: Mapping[str, Path]) -> Key:
    """Replace a key by one with the same secrets and all that is kept apart.

    Args:
        key: As it was begun.
        sets: What binds each data set to its published folder, by label.
        folders: Folders of the whole data sets, by label.

    Raises:
        OSError: It cannot be written; the one that was begun stays.
    """
    done = Key(key.path, key.salt, key.spec, key.students, dict(sets))
    with _writing(key.path, replace=True) as archive:
        _add(archive, HEAD, _head(done))
        for label, folder in folders.items():
            for path in sorted(path for path in folder.rglob("*") if path.is_file()):
                place = path.relative_to(folder).as_posix()
                if not place.startswith(REGENERATED):
                    _add(archive, f"{label}/{place}", path.read_bytes())
    return done


def read_key(path: Path) -> Key:
    """Read a key; of what is kept apart only the secrets.

    Raises:
        ScenarioError: No such file, or none of a key, or a damaged one.
    """
    try:
        with _reading(path) as archive:
            head = json.loads(_member(archive, HEAD, MOST_HEAD))
        if head["format"] != FORMAT:
            raise ValueError(f"format {head['format']!r} found, expected {FORMAT!r}")
        if len(bytes.fromhex(head["salt"])) != 16:
            raise ValueError("a salt of another length than 128 bits")
        spec = DataSetSpec.from_toml(head["spec"], source=str(path))
        sets = {str(label): Bound(**bound) for label, bound in head["sets"].items()}
        key = Key(path, head["salt"], spec, tuple(map(str, head["students"])), sets)
        if not spec.secret_seed or (sets and set(sets) != {one.label for one in key.specs}):
            raise ValueError("its data sets are not those of its spec and students")
        for one in key.specs if sets else ():
            if commitment(key.salt, one, sets[one.label].sums) != sets[one.label].commitment:
                raise ValueError(f"its secrets are not those that {one.label} is bound to")
        return key
    except ScenarioError:
        raise
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise ScenarioError(f"{path} is no key, or a damaged one: {error}") from error


def unpack(key: Key, label: str, target: Path, *, only: tuple[str, ...] = ("",)) -> Path:
    """Write what is kept apart of a data set into a folder, each file held against its checksum.

    Args:
        key: A complete key.
        label: The data set.
        target: An empty folder that only its owner can read.
        only: Beginnings of the places of files that are wanted.

    Returns:
        The folder; to a reader a data set without training records.

    Raises:
        ScenarioError: The key is not complete, not of this data set, or damaged.
    """
    key.complete()
    key.spec_of(label)
    with _reading(key.path) as archive:
        listed = _member(archive, f"{label}/{SUMS}", MOST_BYTES)
        if bytes_hash(listed) != key.sets[label].sums:
            raise ScenarioError(f"{key.path} is damaged: the checksums of {label} are not those that it is bound to")
        lines = (line.split("  ", 1) for line in listed.decode().splitlines())
        sums = {place: digest for digest, place in lines}
        _check_spec(key, label, _member(archive, f"{label}/{SPEC}", MOST_HEAD))
        for place in (place for place in sums if place.startswith(only) and not place.startswith(REGENERATED)):
            if PurePosixPath(place).is_absolute() or ".." in PurePosixPath(place).parts:
                raise ScenarioError(f"{key.path}: {place!r} leads out of the folder")
            content = _member(archive, f"{label}/{place}", MOST_BYTES)
            if bytes_hash(content) != sums[place]:
                raise ScenarioError(f"{key.path} is damaged: {label}/{place} is not what its checksum says")
            (target / place).parent.mkdir(parents=True, exist_ok=True)
            (target / place).write_bytes(content)
    return target


def _check_spec(key: Key, label: str, text: bytes) -> None:
    """Refuse a data set that another spec, or another secret, gives."""
    try:
        same = DataSetSpec.from_toml(text.decode(), source=f"{label}/{SPEC}") == key.spec_of(label)
    except UnicodeDecodeError:
        same = False
    if not same:
        raise ScenarioError(f"{key.path}: what it keeps of {label} is not what its own spec and secret give")


def _head(key: Key) -> bytes:
    head: dict[str, Any] = {
        "format": FORMAT,
        "salt": key.salt,
        "spec": key.spec.to_toml(),
        "students": list(key.students),
        "sets": {label: asdict(bound) for label, bound in key.sets.items()},
    }
    return (json.dumps(head, indent=1) + "\n").encode()


def _add(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    about = zipfile.ZipInfo(name)  # its time is a constant: equal contents make equal files
    about.external_attr = 0o600 << 16
    archive.writestr(about, content, zipfile.ZIP_STORED)


@contextmanager
def _writing(path: Path, *, replace: bool) -> Iterator[zipfile.ZipFile]:
    """An archive that is on the disk whole before it bears its name; only its owner can read it."""
    partial = path.with_name(path.name + PARTIAL)
    partial.unlink(missing_ok=True)
    descriptor = os.open(partial, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with os.fdopen(descriptor, "w+b") as stream:
            with zipfile.ZipFile(stream, "w") as archive:
                yield archive
            stream.flush()
            os.fsync(stream.fileno())
        if replace:
            partial.replace(path)
        else:
            os.link(partial, path)  # unlike a renaming it fails where the name is taken
    finally:
        partial.unlink(missing_ok=True)
    sync_folder(path.absolute().parent)


@contextmanager
def _reading(path: Path) -> Iterator[zipfile.ZipFile]:
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except FileNotFoundError:
        raise ScenarioError(f"no key {path}: expected the file that hmtb dataset build --hide-truth wrote") from None
    except OSError as error:
        raise ScenarioError(f"cannot read the key {path}: {error.strerror or error}") from error
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        raise ScenarioError(f"{path} is no key, or a damaged one: {error}") from error


def _member(archive: zipfile.ZipFile, name: str, most: int) -> bytes:
    try:
        about = archive.getinfo(name)
    except KeyError:
        raise ScenarioError(f"{archive.filename} is no key, or a damaged one: {name} is not in it") from None
    if about.compress_type != zipfile.ZIP_STORED or about.file_size > most:
        raise ScenarioError(f"{archive.filename}: {name} is packed, or larger than expected")
    return archive.read(about)
