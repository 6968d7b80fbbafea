"""Grades of a class: submitted predictions and models, scored against the complete data sets in a withheld folder."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hmtb_twin.files.errors import abridged
from scenarios.datasets.arm_truth import read_arm
from scenarios.datasets.data_set import DataRecord, DataSet, open_data_set
from scenarios.datasets.plan import ATTAINABLE, BASELINES, arm_file
from scenarios.datasets.score import ENDINGS, Scores, score, score_model
from scenarios.datasets.tables import read_table
from scenarios.datasets.withhold import read_persons
from scenarios.files.codec import from_json
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.printable import one_line
from sysid import Estimate, Polynomials, StateSpace, read_model
from sysid.records.reading_process import UnreadableError, read_apart

MOST_STATES = 1000
"""Of a submitted model: what more would need in memory and time keeps others from their grades."""

MODELS = "model-*.json"
"""Files of models, one for each joint."""

Matrix = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class SubmittedModel:
    """A file of a model: matrices of x(t+1) = A x + B u, y = C x + D u, from commanded to measured angle; dt, s."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    dt: float


class ModelGrade(NamedTuple):
    """The bandwidth of a submitted model beside the true one.

    Attributes:
        joint: The joint.
        bandwidth_hz: Of the model, Hz; NaN where its gain never falls to half power.
        true_hz: Of the true arm, Hz.
        stable: Whether all poles of the model lie within the unit circle.
    """

    joint: str
    bandwidth_hz: float
    true_hz: float
    stable: bool

    @property
    def error_percent(self) -> float:
        """Error of the bandwidth in percent of the true one."""
        return 100.0 * (self.bandwidth_hz - self.true_hz) / self.true_hz


class Grade(NamedTuple):
    """The grade of a submission.

    Attributes:
        data_set: Label of the data set that it was scored on.
        scores: Scores of its predictions, or of its models where it has no predictions.
        attainable: Mean of the best attainable scores of the same records; None where one was not searched.
        by_chance: Mean of what a model with a free number reaches by chance in one record of twenty; likewise.
        baselines: Scores of known methods, by name with orders.
        models: Bandwidths of its models.
    """

    data_set: str
    scores: Scores
    attainable: float | None
    by_chance: float | None
    baselines: Mapping[str, float]
    models: tuple[ModelGrade, ...]

    @property
    def too_good(self) -> bool:
        """Whether the score is better than the recorder's noise allows, as that of copied outputs is."""
        if self.by_chance is None:
            return False
        fit = self.scores.scoring.metric == "fit"
        # A fit is good where it is large, an error where it is small.
        return self.scores.mean > self.by_chance if fit else self.scores.mean < self.by_chance

    @property
    def best_baseline(self) -> tuple[str, float] | None:
        """The best identified baseline; the small-signal truth does not compete."""
        identified = {name: value for name, value in self.baselines.items() if name != "truth"}
        if not identified:
            return None
        best_of = max if self.scores.scoring.metric == "fit" else min
        return best_of(identified.items(), key=lambda name_and_score: name_and_score[1])

    def record(self) -> dict[str, object]:
        """Return what `hmtb dataset grade --json` prints of the submission."""
        best = self.best_baseline
        rule = self.scores.scoring
        return {
            "data_set": self.data_set,
            "metric": rule.metric,
            "unit": rule.unit,
            "score": self.scores.mean,
            "joints": self.scores.by_joint,
            "attainable": self.attainable,
            "too_good": self.too_good,
            "best_baseline": {"method": best[0], "score": best[1]} if best else None,
            "scores": [score._asdict() for score in self.scores.scores],
            "models": [{**model._asdict(), "error_percent": model.error_percent} for model in self.models],
        }


def grade_all(
    withheld: Path, submissions: Path, *, progress: Callable[[int, int], None] | None = None
) -> dict[str, Grade | str]:
    """Grade one submission, or every folder in a folder of them. Nothing of a submission is executed.

    Args:
        withheld: The withheld folder of the class.
        submissions: The folder. Where each person has a data set, folders of submissions are named after the persons.
        progress: Called with the submissions done and their total.

    Returns:
        By name of the folder the grade, or why there is none.

    Raises:
        ScenarioError: No submissions, or no withheld folder.
    """
    persons = read_persons(withheld)
    if not submissions.is_dir():
        raise ScenarioError(f"no folder {submissions}: expected a submission, or a folder of them")
    folders = _submission_folders(submissions)
    if not folders:
        raise ScenarioError(f"{submissions} holds no submissions: expected predictions, or a folder of them per person")
    grades: dict[str, Grade | str] = {}
    for done, folder in enumerate(folders, start=1):
        # One data set for all belongs to the person "".
        person = "" if "" in persons else folder.name
        try:
            if folder.is_symlink():
                raise ScenarioError(f"{folder} is a link; expected a folder with the work of {person}")
            if person not in persons:
                raise ScenarioError(f"{folder}: {unknown('person', person, persons)}")
            with np.errstate(all="ignore"):  # a model may hold any numbers
                grades[folder.name] = _grade(folder, open_data_set(withheld / persons[person][0]))
        except (ValueError, OSError, MemoryError) as error:
            # One broken submission does not keep the others from their grades.
            grades[folder.name] = one_line(abridged(str(error)))
        except LookupError as error:
            grades[folder.name] = f"a table in {withheld} is damaged: it lacks {error}"
        if progress is not None:
            progress(done, len(folders))
    return grades


def _submission_folders(submissions: Path) -> list[Path]:
    """The folder itself if it holds work, else the folders in it."""
    if any(path.is_file() and path.suffix in (*ENDINGS, ".json") for path in submissions.iterdir()):
        return [submissions.resolve()]
    return sorted(path for path in submissions.iterdir() if path.is_dir() and not path.name.startswith("."))


def _grade(submission: Path, data_set: DataSet) -> Grade:
    """Score the predictions or the models of a submission on a complete data set."""
    for path in submission.iterdir():
        # A link could lead to the withheld answer, reading a pipe never ends, a larger file is a mistake.
        if path.is_symlink() or not (path.is_file() or path.is_dir()) or path.stat().st_size > _most_bytes(path):
            raise ScenarioError(f"{path} is a link, a pipe or has too many bytes; expected ordinary files")
    joints = set(chain.from_iterable(record.joints for record in data_set.index))
    models = _models(submission, joints)
    # Predictions come before models, which a submission may bring for their bandwidths alone.
    if any(path.suffix in ENDINGS for path in submission.iterdir()) or not models:
        scores = score(submission, data_set)
    else:
        scores = _score_models(submission, models, data_set)
    baselines: dict[str, float] = {}
    for row in read_table(data_set.folder / BASELINES):
        if row["test"]:
            baselines[f"{row['method']} {row['orders']}".strip()] = float(row["test"])
    # Empty where a floor was not searched: then the best attainable mean is not known.
    floors = read_table(data_set.folder / ATTAINABLE)
    return Grade(
        data_set.label,
        scores,
        _mean([row["attainable"] for row in floors]),
        _mean([row.get("attainable_by_chance", "") for row in floors]),
        baselines,
        tuple(_compare(model, joint, data_set) for joint, model in models.items()),
    )


def _score_models(submission: Path, models: Mapping[str, StateSpace], data_set: DataSet) -> Scores:
    """Score the models of a submission, each on the records of its joint."""

    def model_of(record: DataRecord) -> StateSpace:
        if len(record.joints) > 1 or record.joints[0] not in models:
            raise ScenarioError(f"{submission}: no predictions, and no model-JOINT.json for {record.name}")
        return models[record.joints[0]]

    return score_model(model_of, data_set)


def _most_bytes(path: Path) -> int:
    """Largest size of a submitted file: 4 MiB of a model, 256 MiB of predictions."""
    return 2**22 if path.suffix == ".json" else 2**28


def _mean(cells: list[str]) -> float | None:
    """Mean of numbers in a column of a table; None where there are none, or a cell is empty."""
    if not cells or not all(cells):
        return None
    return float(np.mean(list(map(float, cells))))


def _models(submission: Path, joints: Collection[str]) -> dict[str, StateSpace]:
    """Models of a submission by joint; another process reads them, because a model may hold any numbers."""
    if not any(submission.glob(MODELS)):
        return {}
    try:
        matrices = read_apart(read_matrices, submission, sorted(joints))
    except UnreadableError as error:
        raise ScenarioError(f"{submission}: {error}") from error
    return {joint: StateSpace(A, B, C, D, None, dt) for joint, (A, B, C, D, dt) in matrices.items()}


def read_matrices(submission: str, joints: Collection[str]) -> dict[str, tuple[Any, ...]]:
    """Read the matrices A, B, C, D and the sampling interval of each model of a submission, by joint."""
    models: dict[str, tuple[Any, ...]] = {}
    for path in sorted(Path(submission).glob(MODELS)):
        joint = path.stem.removeprefix("model-")
        if joint not in joints:
            raise ScenarioError(f"{path}: {unknown('joint', joint, sorted(joints))}")
        content = path.read_bytes()
        try:
            model = _state_space(path, content)
        except ScenarioError:
            raise
        except (ValueError, MemoryError) as error:
            raise ScenarioError(f"{path}: {error}") from error
        if (model.nu, model.ny) != (1, 1):
            raise ScenarioError(f"{path}: {model.nu} inputs and {model.ny} outputs given, expected one of each")
        if model.order > MOST_STATES:
            raise ScenarioError(f"{path}: {model.order} states given, expected at most {MOST_STATES}")
        models[joint] = (model.A, model.B, model.C, model.D, model.dt)
    return models


def _state_space(path: Path, content: bytes) -> StateSpace:
    """The model in a file of `sysid`, or of matrices alone.

    Its noise model is dropped: the data sets of classes are scored in simulation, see `check_withholdable`.
    """
    file: Any
    if b'"sysid-model"' in content:
        file = read_model(path)
        if isinstance(file, Estimate):
            file = file.model
    else:
        file = from_json(SubmittedModel, content, str(path))
    if isinstance(file, Polynomials):
        raise ScenarioError(f"{path}: polynomials without a sampling interval given, expected a model")
    A, B, C, D = (np.array(matrix) for matrix in (file.A, file.B, file.C, file.D))
    return StateSpace(A, B, C, D, None, file.dt)


def _compare(model: StateSpace, joint: str, data_set: DataSet) -> ModelGrade:
    """The bandwidth of a model beside that of its joint."""
    if len(data_set.arms) > 1:
        raise ScenarioError(f"{data_set.label} has {len(data_set.arms)} arms: models can be graded on one arm alone")
    truth = read_arm(data_set.folder / arm_file(data_set.arms[0])).joints
    if joint not in truth:
        raise ScenarioError(f"{data_set.label}: no truth of {joint} alone, because its arm is unstable")
    stable = bool((np.abs(model.poles()) < 1.0).all())
    return ModelGrade(joint, float(model.bandwidth()[0, 0]), truth[joint].bandwidth_hz, stable)
