"""What a student hands in: predictions of the scored records, and models and bandwidths beside them."""

import csv
import json
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from scenarios.datasets.challenge_model import ENDINGS as MODELS
from scenarios.datasets.challenge_model import SubmittedModel, read_model
from scenarios.datasets.data_set import DataSet
from scenarios.datasets.predictions import ENDINGS as PREDICTIONS
from scenarios.datasets.predictions import number_of
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.netcdf import read_netcdf

STATEMENT = "submission.json"
"""Says which data set a submission is for: an object of `STATED`."""

STATED = ("data_set", "commitment", "student")
"""What it may say: the label, the commitment in spec.toml, the student's id."""

BANDWIDTHS = ("bandwidths.csv", "bandwidths.json")
"""Files of bandwidths: a table of joint and bandwidth_hz, with a column arm before them where there are several arms;
or an object of Hz by joint, or by arm and joint."""

MODEL = "model-"
"""Beginning of files of models: model-JOINT, or model-ARM-JOINT where there are several arms."""

MOST_BYTES = 2**28
"""No file of a submission is larger."""

HIGHEST = 1e6
"""No bandwidth is higher, Hz."""

Where = tuple[str, str]
"""Arm and joint."""


@dataclass(frozen=True, eq=False)
class Submission:
    """A submission as files.

    Attributes:
        folder: Where it is.
        stated: What it says of the data set that it is for.
        predictions: Files of predictions.
        others: Files of models and bandwidths.
    """

    folder: Path
    stated: Mapping[str, str]
    predictions: tuple[Path, ...]
    others: tuple[Path, ...]

    @property
    def says_origin(self) -> bool:
        """Whether it says which data set it is for, by label or commitment."""
        told = [self.stated, *(read_netcdf(path).attributes for path in self.predictions if path.suffix == ".nc")]
        return any({"data_set", "commitment"} & one.keys() for one in told)


def open_submission(folder: Path) -> Submission:
    """List the files of a submission; others than those that are known are left alone.

    Args:
        folder: The folder.

    Raises:
        ScenarioError: No folder, a link or a file of an absurd size in it, or a statement that is none.
    """
    if not folder.is_dir():
        raise ScenarioError(f"no folder {folder}: expected a submission")
    files: dict[str, list[Path]] = {"statement": [], "model": [], "prediction": []}
    for path in sorted(folder.iterdir()):
        kind = _kind(path)
        if not kind:
            continue
        if path.is_symlink() or not path.is_file():
            raise ScenarioError(f"{path} is a link or no file; expected files alone")
        if path.stat().st_size > MOST_BYTES:
            raise ScenarioError(f"{path} has {path.stat().st_size} bytes, expected at most {MOST_BYTES}")
        files[kind].append(path)
    stated = _statement(folder / STATEMENT) if files["statement"] else {}
    return Submission(folder, stated, tuple(files["prediction"]), tuple(files["model"]))


def is_submission(folder: Path) -> bool:
    """Whether a folder holds predictions, rather than folders that do."""
    return any(_kind(path) for path in folder.iterdir())


def check_origin(submission: Submission, label: str, commitment: str, student: str, others: Iterable[str]) -> None:
    """Refuse what was made for another data set, as far as the submission tells.

    Args:
        submission: The submission.
        label: Of the data set that it is held against.
        commitment: Its commitment.
        student: Whose it is; empty: everyone's.
        others: Ids of the other students.

    Raises:
        ScenarioError: It says another label, commitment or student, or its predictions are named after the experiments
            of another student.
    """
    expected = {"data_set": label, "commitment": commitment, "student": student}
    for key, value in submission.stated.items():
        _same(submission.folder / STATEMENT, key, value, expected[key])
    for path in submission.predictions:
        if student and not path.name.startswith(f"{student}-"):
            for other in others:
                if path.name.startswith(f"{other}-"):
                    raise ScenarioError(
                        f"{path} is of an experiment of {other}'s data set, expected predictions for {label}"
                    )
        if path.suffix == ".nc":
            attributes = read_netcdf(path).attributes
            for key in STATED:
                if key in attributes:
                    _same(path, key, str(attributes[key]), expected[key])


def read_models(submission: Submission, data_set: DataSet) -> dict[Where, tuple[str, SubmittedModel]]:
    """The models of a submission by arm and joint, with the names of their files.

    Args:
        submission: The submission.
        data_set: What it is held against.

    Raises:
        ScenarioError: A file that is damaged, of an unknown arm or joint, or of one that has a model already.
    """
    found: dict[Where, tuple[str, SubmittedModel]] = {}
    for path in submission.others:
        if not path.name.startswith(MODEL):
            continue
        arm, _, joint = path.stem.removeprefix(MODEL).rpartition("-")
        where = _where(path, data_set, arm, joint)
        if where in found:
            raise ScenarioError(f"{path} is a second model of {joint}, beside {found[where][0]}")
        found[where] = (path.name, read_model(path))
    return found


def read_bandwidths(submission: Submission, data_set: DataSet) -> dict[Where, float]:
    """The bandwidths of a submission by arm and joint, Hz.

    Args:
        submission: The submission.
        data_set: What it is held against.

    Raises:
        ScenarioError: Two files of them, a damaged one, an unknown arm or joint, or a number that is none.
    """
    paths = [path for path in submission.others if path.name in BANDWIDTHS]
    if len(paths) > 1:
        raise ScenarioError(f"{submission.folder} has both {' and '.join(BANDWIDTHS)}, expected one of them")
    found: dict[Where, float] = {}
    for path in paths:
        for arm, joint, value in _json_rows(path) if path.suffix == ".json" else _csv_rows(path):
            where = _where(path, data_set, arm, joint)
            if where in found:
                raise ScenarioError(f"{path}: {joint} of {where[0]} is there twice")
            if not 0.0 < value <= HIGHEST:
                raise ScenarioError(
                    f"{path}: {joint} has the bandwidth {value:g}, expected a number above 0 and up to {HIGHEST:g}, Hz"
                )
            found[where] = value
    return found


def _where(path: Path, data_set: DataSet, arm: str, joint: str) -> Where:
    arms = data_set.arms
    joints = tuple(dict.fromkeys(name for line in data_set.listings for name in line.joints))
    if joint not in joints:
        raise ScenarioError(f"{path}: {unknown('joint', joint, joints)}")
    if not arm and len(arms) == 1:
        return arms[0], joint
    if not arm:
        raise ScenarioError(f"{path}: expected one of {len(arms)} arms to be named: {', '.join(arms[:5])}")
    if arm not in arms:
        raise ScenarioError(f"{path}: {unknown('arm', arm, arms)}")
    return arm, joint


def _kind(path: Path) -> str:
    if path.name == STATEMENT:
        return "statement"
    if path.name in BANDWIDTHS or (path.name.startswith(MODEL) and path.suffix in MODELS):
        return "model"
    return "prediction" if path.suffix in PREDICTIONS else ""


def _same(path: Path, key: str, given: str, expected: str) -> None:
    if given != expected:
        raise ScenarioError(
            f"{path} says {key} = {given[:100]!r}, expected {expected!r}: the submission was made for another data set"
        )


def _statement(path: Path) -> Mapping[str, str]:
    table = _json(path)
    if not isinstance(table, dict) or not table or not all(isinstance(value, str) for value in table.values()):
        raise ScenarioError(f"{path}: expected an object of texts: {', '.join(STATED)}")
    for key in table:
        if key not in STATED:
            raise ScenarioError(f"{path}: {unknown('key', key, STATED)}")
    return table


def _json(path: Path) -> object:
    try:
        return json.loads(path.read_text(encoding="utf-8"), object_pairs_hook=_once)
    except (OSError, ValueError, RecursionError) as error:
        raise ScenarioError(f"cannot read {path}: {error}") from error


def _once(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """An object, refused where a key is there twice: one of its values would be lost."""
    table = dict(pairs)
    if len(table) < len(pairs):
        name = next(name for name, count in Counter(name for name, _ in pairs).items() if count > 1)
        raise ValueError(f"{name[:50]!r} is there twice")
    return table


def _json_rows(path: Path) -> Iterable[tuple[str, str, float]]:
    table = _json(path)
    if not isinstance(table, dict):
        raise ScenarioError(f"{path}: expected an object of bandwidths, Hz, by joint, or by arm and joint")
    for name, entry in table.items():
        for joint, value in entry.items() if isinstance(entry, dict) else ((name, entry),):
            if not isinstance(value, int | float) or isinstance(value, bool):
                raise ScenarioError(f"{path}: {joint} = {str(value)[:50]!r} given, expected a number, Hz")
            # A whole number of any length, which no float holds, is one that is too high.
            yield (name if isinstance(entry, dict) else ""), joint, float("inf") if value > HIGHEST else float(value)


def _csv_rows(path: Path) -> Iterable[tuple[str, str, float]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = [[word.strip() for word in row] for row in csv.reader(stream) if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ScenarioError(f"cannot read {path}: {error}") from error
    names = rows[0] if rows else []
    if names not in (["joint", "bandwidth_hz"], ["arm", "joint", "bandwidth_hz"]):
        raise ScenarioError(
            f"{path}: columns {', '.join(names)[:100] or 'none'} given, expected joint, bandwidth_hz, or arm before "
            "them"
        )
    for number, row in enumerate(rows[1:], start=2):
        try:
            *arm, joint, value = row
            if len(row) != len(names):
                raise ValueError(f"{len(row)} columns given, expected {len(names)}")
            yield (arm[0] if arm else ""), joint, number_of(value)
        except ValueError as error:
            raise ScenarioError(f"{path}, row {number}: {error}") from error
