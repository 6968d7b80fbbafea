"""Grade what students hand in: predictions, models and bandwidths, held against a truth that they never saw."""

import csv
import math
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from hmtb_twin.truth.truth import JointTruth
from scenarios.datasets.arm_truth import read_arm
from scenarios.datasets.baseline_table import read_table
from scenarios.datasets.challenge_key import Bound, Key, read_key, unpack
from scenarios.datasets.challenge_model import SubmittedModel, of_state_space
from scenarios.datasets.challenge_submission import (
    STATEMENT,
    Submission,
    check_origin,
    is_submission,
    open_submission,
    read_bandwidths,
    read_models,
)
from scenarios.datasets.data_set import DataSet, open_data_set
from scenarios.datasets.layout import ATTAINABLE, BASELINES, INDEX, SPEC, arm_file
from scenarios.datasets.score import Scores, score
from scenarios.files.errors import ScenarioError

UNSAID = f"it does not say which data set it is for: {STATEMENT} may, by data_set and commitment as in spec.toml"
"""Of a submission that may have been made for another version."""

BAND = (0.1, 2.0)
"""Frequency responses are compared from the first, Hz, to so many times the true bandwidth."""

LINES = 200
"""At so many frequencies, evenly apart on a logarithmic axis."""

NO_BANDWIDTH = 2.0
"""Upper end of the band for a joint that has no bandwidth, Hz."""

FAST = 0.05
"""What a pole of smaller modulus carries falls below a twentieth within a sample."""

LONGEST = 600
"""Characters of why a submission cannot be graded."""

NEEDED = (INDEX, SPEC, BASELINES, ATTAINABLE, "data/test/", "truth/arms/")
"""What is unpacked of a key."""


@dataclass(frozen=True)
class ModelGrade:
    """A model, or a bandwidth alone, of one joint beside the truth.

    Attributes:
        arm: The arm.
        joint: The joint.
        source: The file.
        values: What was handed in: `bandwidth_hz`, `dc_gain`.
        truth: The same of the true arm.
        errors: `bandwidth` and `dc_gain` in percent of the truth; `poles`: root mean square distance in the z plane to
            the true poles that fit best; `response` in percent: root mean square error over the band, of that of the
            true response.
        stable: Whether the model is.
    """

    arm: str
    joint: str
    source: str
    values: Mapping[str, float]
    truth: Mapping[str, float]
    errors: Mapping[str, float]
    stable: bool = True


@dataclass(frozen=True)
class Grade:
    """A submission beside the truth.

    Attributes:
        name: Of its folder.
        label: The data set.
        scores: Of its predictions, in the metric of the data set.
        floor: The mean of the best attainable scores of the same records; None where one was not searched.
        baselines: Scores of known methods, by name with orders.
        models: Its models and bandwidths.
        remarks: What its author should know.
    """

    name: str
    label: str
    scores: Scores
    floor: float | None
    baselines: Mapping[str, float]
    models: tuple[ModelGrade, ...]
    remarks: tuple[str, ...] = ()

    @property
    def best_baseline(self) -> tuple[str, float] | None:
        """The best of the baselines that were identified, as the submission was."""
        best = max if self.scores.scoring.metric == "fit" else min
        known = {name: value for name, value in self.baselines.items() if name != "truth"}
        return best(known.items(), key=lambda pair: pair[1]) if known else None


@dataclass(frozen=True)
class Solution:
    """What the key tells of one data set, unpacked.

    Attributes:
        data_set: Its test part and its truth.
        student: Whose it is; empty: everyone's.
        bound: Its commitment.
        others: Ids of the other students.
    """

    data_set: DataSet
    student: str
    bound: Bound
    others: tuple[str, ...]


@contextmanager
def solution(key: Key, label: str) -> Iterator[Solution]:
    """Unpack what grading needs, for as long as it is needed.

    Args:
        key: A complete key.
        label: The data set.

    Raises:
        ScenarioError: The key is not complete, of others, or damaged.
    """
    with tempfile.TemporaryDirectory(prefix="hmtb-key-") as place:
        data_set = open_data_set(unpack(key, label, Path(place), only=NEEDED))
        student = key.spec_of(label).student
        others = tuple(one for one in key.students if one != student)
        yield Solution(data_set, student, key.sets[label], others)


def grade(path: Path, key_path: Path, *, student: str | None = None) -> Grade:
    """Grade one submission; see `submission` for what it holds. Nothing of it is executed.

    Args:
        path: Its folder.
        key_path: The key.
        student: Whose it is; where it says so itself, or there is one data set for all, it need not be given.

    Raises:
        ScenarioError: It is incomplete, damaged, of wrong shape, has NaN, or was made for another data set.
    """
    key = read_key(key_path)
    key.complete()
    found = open_submission(path)
    with solution(key, _label(key, found, student)) as held:
        return graded(found, held)


def grade_all(
    path: Path, key_path: Path, *, progress: Callable[[int, int], None] | None = None
) -> dict[str, Grade | str]:
    """Grade every folder in a folder; where each student has a data set they are named after the students.

    Args:
        path: The folder.
        key_path: The key.
        progress: Told the submissions done and those there are.

    Returns:
        By folder the grade, or why there is none.

    Raises:
        ScenarioError: No folders, or no key.
    """
    key = read_key(key_path)
    key.complete()
    folders = sorted(one for one in path.iterdir() if one.is_dir())
    if not folders:
        raise ScenarioError(f"{path} holds no submissions: expected predictions, or a folder of them for each student")
    found: dict[str, Grade | str] = {}
    for number, folder in enumerate(folders):
        try:
            one = open_submission(folder)
            with solution(key, _label(key, one, folder.name if key.students else None)) as held:
                found[folder.name] = graded(one, held)
        except ScenarioError as error:
            found[folder.name] = str(error)
        # Whatever a submission brings about that nobody thought of: the others are graded all the same.
        except Exception as error:
            found[folder.name] = f"{folder} cannot be graded: {error!r}"[:LONGEST]
        if progress is not None:
            progress(number + 1, len(folders))
    return found


def holds_submissions(path: Path) -> bool:
    """Whether a folder holds submissions rather than being one.

    Raises:
        ScenarioError: There is no such folder.
    """
    if not path.is_dir():
        raise ScenarioError(f"no folder {path}: expected a submission, or a folder of them")
    return not is_submission(path)


def graded(submission: Submission, held: Solution) -> Grade:
    """Hold a submission against the truth.

    Args:
        submission: The submission.
        held: The truth.

    Raises:
        ScenarioError: See `grade`.
    """
    data_set = held.data_set
    check_origin(submission, data_set.label, held.bound.commitment, held.student, held.others)
    if not submission.predictions:
        raise ScenarioError(f"{submission.folder} holds no predictions: expected one for each record of the test part")
    scores = score(submission.predictions, data_set)
    models = [*_models(submission, data_set), *_bandwidths(submission, data_set)]
    return Grade(
        submission.folder.name,
        data_set.label,
        scores,
        _floor(data_set.folder / ATTAINABLE),
        _baselines(data_set.folder / BASELINES),
        tuple(models),
        () if submission.says_origin else (UNSAID,),
    )


def compared(model: SubmittedModel, truth: JointTruth) -> tuple[dict[str, float], dict[str, float], dict[str, float]]:
    """A model beside the true one: what it says, what is true, and the errors; see `ModelGrade`.

    Args:
        model: The model.
        truth: The joint.
    """
    exact = of_state_space(truth.model)
    f = band(truth)
    hat, true = model.response(f), exact.response(f)
    values = {"bandwidth_hz": model.bandwidth_hz, "dc_gain": model.dc_gain}
    known = {"bandwidth_hz": truth.bandwidth_hz, "dc_gain": truth.dc_gain}
    errors = {
        "bandwidth": _percent(values["bandwidth_hz"], truth.bandwidth_hz),
        "dc_gain": _percent(values["dc_gain"], truth.dc_gain),
        "poles": pole_distance(model.poles, np.asarray(truth.poles, dtype=complex)),
        "response": 100.0 * float(np.sqrt(np.mean(np.abs(hat - true) ** 2) / np.mean(np.abs(true) ** 2))),
    }
    return values, known, errors


def band(truth: JointTruth) -> np.ndarray:
    """Frequencies at which responses are compared, Hz."""
    top = BAND[1] * truth.bandwidth_hz if math.isfinite(truth.bandwidth_hz) else NO_BANDWIDTH
    return np.geomspace(BAND[0], top, LINES)


def pole_distance(poles: np.ndarray, true: np.ndarray) -> float:
    """Root mean square distance in the z plane, each pole matched to one of the other set so that the sum is smallest.

    Poles below `FAST` are left out: no record shows where they are.

    Args:
        poles: Those of a model; NaN comes out where all are fast.
        true: The true ones; of the larger set some find no match, and count for nothing.
    """
    poles, true = (roots[np.abs(roots) > FAST] for roots in (poles, true))
    if not len(poles) or not len(true):
        return float("nan")
    squares = np.abs(poles[:, None] - true[None, :]) ** 2
    rows, columns = linear_sum_assignment(squares)
    return float(np.sqrt(squares[rows, columns].mean()))


def _models(submission: Submission, data_set: DataSet) -> Iterator[ModelGrade]:
    for (arm, joint), (source, model) in read_models(submission, data_set).items():
        values, known, errors = compared(model, _truth(data_set, arm, joint))
        yield ModelGrade(arm, joint, source, values, known, errors, model.stable)


def _bandwidths(submission: Submission, data_set: DataSet) -> Iterator[ModelGrade]:
    for (arm, joint), value in read_bandwidths(submission, data_set).items():
        true = _truth(data_set, arm, joint).bandwidth_hz
        errors = {"bandwidth": _percent(value, true)}
        yield ModelGrade(arm, joint, "bandwidths", {"bandwidth_hz": value}, {"bandwidth_hz": true}, errors)


def _truth(data_set: DataSet, arm: str, joint: str) -> JointTruth:
    stored = read_arm(data_set.folder / arm_file(arm))
    if joint not in stored.joints:
        raise ScenarioError(f"{data_set.label}: the truth of {arm} tells nothing of {joint} alone: it is unstable")
    return stored.joints[joint]


def _percent(value: float, true: float) -> float:
    return 100.0 * (value - true) / true


def _floor(path: Path) -> float | None:
    if not path.is_file():
        return None
    with path.open(newline="", encoding="utf-8") as stream:
        cells = [row["attainable"] for row in csv.DictReader(stream)]
    return float(np.mean([float(cell) for cell in cells])) if cells and all(cells) else None


def _baselines(path: Path) -> dict[str, float]:
    if not path.is_file():
        return {}
    rows = [row for row in read_table(path) if row["test"]]
    return {f"{row['method']} {row['orders']}".strip(): float(row["test"]) for row in rows}


def _label(key: Key, submission: Submission, student: str | None) -> str:
    """The data set that a submission is held against: the student's, as given, else as it says itself."""
    if student is None and key.students:
        student = submission.stated.get("student")
        if student is None and "data_set" in submission.stated:
            return key.spec_of(submission.stated["data_set"]).label
    return key.label_of(student)
