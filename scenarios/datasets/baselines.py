"""Baselines: what known estimators score on a data set, and the table of them."""

import json
import math
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache, partial
from itertools import chain
from pathlib import Path
from shlex import join
from typing import Any, NamedTuple

import numpy as np

from hmtb_twin import TwinError, load_arm
from hmtb_twin.files.hashes import file_hash
from scenarios.datasets.arm_truth import StoredArm, read_arm
from scenarios.datasets.data_set import DataRecord, DataSet, open_data_set
from scenarios.datasets.plan import BASELINES, INDEX, DataSetPlan, arm_file
from scenarios.datasets.record_block import PARTS
from scenarios.datasets.score import Scores, score_outputs
from scenarios.datasets.spec import TRUTH, BaselineSpec, Method
from scenarios.datasets.tables import table_text
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import versions
from scenarios.identification.methods import METHODS, Knowledge, estimate
from sysid import IOData, SysidError, SysidWarning
from sysid.polynomial.fit_with_offset import fit_with_offset
from sysid.validation.predictors import ModelPredictor, Predictor, StackedPredictor

RECORDS_ALONE = Knowledge()
"""Nothing is known besides the records."""


class Baseline(NamedTuple):
    """Scores of one method.

    Attributes:
        test: Scores on the test part.
        validation: Scores on the validation part; None where there is none.
        trained: Names of the training records, in order.
    """

    test: Scores
    validation: Scores | None
    trained: tuple[str, ...]


@dataclass(frozen=True)
class BaselineData:
    """A data set and the records of it that baselines are identified from and scored on.

    Attributes:
        data_set: The data set.
        limits: How many twins and training records are used.
    """

    data_set: DataSet
    limits: BaselineSpec

    @cached_property
    def twins(self) -> tuple[int, ...]:
        """The selected twins, evenly over all that have a record; empty where there are none."""
        recorded = [record for record in self.data_set.index if record.failed is None]
        twins = sorted({record.twin for record in recorded if record.twin is not None})
        count = len(twins) if self.limits.twins == 0 else min(self.limits.twins, len(twins))
        # The first and the last are among them; a single one is the first.
        last, intervals = len(twins) - 1, max(count - 1, 1)
        return tuple(twins[round(k * last / intervals)] for k in range(count))

    @cached_property
    def records(self) -> Mapping[str, tuple[DataRecord, ...]]:
        """Records on the selected twins by part, the same objects for all baselines: each file is read once."""
        records: dict[str, list[DataRecord]] = {name: [] for name in PARTS}
        for record in self.data_set.records():
            if record.twin is None or record.twin in self.twins:
                records[record.part].append(record)
        return {name: tuple(records_of_part) for name, records_of_part in records.items()}

    @cached_property
    def train(self) -> tuple[DataRecord, ...]:
        """Records to identify from: the first ones of each block, arm and set of joints."""
        selected = list[DataRecord]()
        counts = Counter[tuple[object, ...]]()
        for record in self.records["train"]:
            setting = (record.block, record.arm, frozenset(record.joints))
            counts[setting] += 1
            if not self.limits.records or counts[setting] <= self.limits.records:
                selected.append(record)
        return tuple(selected)

    def training(self, record: DataRecord) -> tuple[DataRecord, ...]:
        """Return the records that the model for a record is identified from.

        These are the training records with its joints of its own arm under its own conditions; where there are none,
        of its twin under any.

        Raises:
            ScenarioError: There are none with its joints.
        """
        of_twin = [candidate for candidate in self.train if candidate.twin == record.twin]
        with_its_joints = [candidate for candidate in of_twin if set(candidate.joints) == set(record.joints)]
        if not with_its_joints:
            raise ScenarioError(f"no training records of {', '.join(record.joints)} for {record.name}")
        of_its_arm = [candidate for candidate in with_its_joints if candidate.arm == record.arm]
        return tuple(of_its_arm or with_its_joints)


class _Identification:
    """Identifies the models of one method as records need them, each once."""

    def __init__(self, data: BaselineData, method: Method) -> None:
        self.data, self.method = data, method
        self.steps = data.data_set.spec.scoring.steps
        self.uses_truth = method.name != TRUTH and METHODS[method.name].needs_truth
        self.trained: dict[str, None] = {}  # names of training records, in order
        self._models: dict[tuple[str, ...], Predictor] = {}

    def predicted(self, record: DataRecord) -> np.ndarray:
        """Predict the outputs of a record with the model for it."""
        if self.method.name == TRUTH:
            training: tuple[DataRecord, ...] = ()
            arm = record.arm
        else:
            training = self.data.training(record)
            # Records of other arms share a model, unless it knows the truth of one arm.
            arm = record.arm if self.uses_truth else ""
        key = (arm, *record.joints, *(train_record.name for train_record in training))
        if key not in self._models:
            self._models[key] = self._model(record, training)
        return self._models[key].predicted(record.iodata(), self.steps)

    def _model(self, record: DataRecord, training: Sequence[DataRecord]) -> Predictor:
        data_set = self.data.data_set
        if self.method.name == TRUTH:
            return _true_predictor(data_set, record.arm, record.joints)
        knowledge = Knowledge(data_set.spec.seed)
        if self.uses_truth:
            zones = [dead_zone(data_set, train_record.arm, record.joints[0]) for train_record in training]
            own_zone = dead_zone(data_set, record.arm, record.joints[0])
            knowledge = Knowledge(data_set.spec.seed, tuple(zones), own_zone)
        train_data = [_with_channels(train_record, record.joints) for train_record in training]
        model = identified(self.method, train_data, knowledge)
        self.trained.update(dict.fromkeys(train_record.name for train_record in training))
        return model


def _with_channels(record: DataRecord, joints: Sequence[str]) -> IOData:
    """A training record with its channels in the order of the joints of the record to predict."""
    order = [record.joints.index(joint) for joint in joints]
    return record.iodata().select(inputs=order, outputs=order)


def baseline(data: BaselineData, method: Method) -> Baseline:
    """Identify the models of a method from the training part, and score them on test and validation part.

    Raises:
        ScenarioError: No training records for a test record, or the method needs the truth and it is missing.
        SysidError: The estimator refuses the records.
    """
    scoring = data.data_set.spec.scoring
    identification = _Identification(data, method)
    test = score_outputs(scoring, data.records["test"], identification.predicted)
    # A joint may have validation records and no training record; only the truth has a model for it.
    trained_joints = {frozenset(record.joints) for record in data.train}
    with_model = data.records["validation"]
    if method.name != TRUTH:
        with_model = tuple(record for record in with_model if frozenset(record.joints) in trained_joints)
    validation = score_outputs(scoring, with_model, identification.predicted) if with_model else None
    return Baseline(test, validation, tuple(identification.trained))


def identified(method: Method, parts: Sequence[IOData], knowledge: Knowledge = RECORDS_ALONE) -> Predictor:
    """Identify a predictor from records, its operating point with it.

    Args:
        method: The method; not the truth.
        parts: Training records with the same channels.
        knowledge: What a method may know besides them.

    Raises:
        ScenarioError: Orders or records that a nonlinear method cannot use.
        SysidError: The estimator refuses the records.
    """
    entry = METHODS[method.name]
    if parts[0].ny > 1 and not entry.outputs:
        # A method of one output has a model of every output, from all inputs.
        models = []
        for output in range(parts[0].ny):
            parts_of_output = [part.select(outputs=[output]) for part in parts]
            models.append(identified(method, parts_of_output, knowledge))
        return StackedPredictor(tuple(models))
    with warnings.catch_warnings():
        # A poor model shows in its score.
        warnings.simplefilter("ignore", SysidWarning)
        if entry.returns == "predictor":
            return entry.predictor(parts, method.orders, knowledge)
        model = fit_with_offset(partial(estimate, method=method.name, orders=method.orders), parts).estimate
    return ModelPredictor(model.model, *(model.operating_point or ()))


def _true_predictor(data_set: DataSet, arm: str, joints: Sequence[str]) -> ModelPredictor:
    """The small-signal truth of joints of an arm, with its noise model and its operating point."""
    stored = _stored_arm(data_set, arm, "a baseline of the truth needs the truth")
    if len(joints) == 1 and joints[0] in stored.joints:
        # The model of a joint alone has fewer states and the same behaviour.
        model = stored.joints[joints[0]].model
    else:
        model = stored.truth.subset(joints, joints)
    input_names = list(stored.truth.model.input_names or ())
    columns = [input_names.index(f"{joint} commanded") for joint in joints]
    return ModelPredictor(model, stored.truth.angles[columns], stored.rest[columns])


def dead_zone(data_set: DataSet, arm: str, joint: str) -> float:
    """Return the half width of the dead zone that friction makes in a joint's position loop, rad, from the truth.

    It is Coulomb's torque over the proportional gain: the angle error whose torque a sliding joint loses to friction.

    Raises:
        ScenarioError: The truth of the arm is missing, or of an arm that this version does not know.
    """
    truth = _stored_arm(data_set, arm, "the known dead zone is taken from the truth").truth
    try:
        twin = load_arm(truth.variant, truth.payload, plant=truth.plant, specimen=truth.specimen)
    except TwinError as error:
        raise ScenarioError(f"{data_set.folder / arm_file(arm)}: {error}") from error
    return twin.drives[joint].coulomb_torque / twin.gains[joint].kp


def _stored_arm(data_set: DataSet, arm: str, reason: str) -> StoredArm:
    """The truth of an arm; where it is missing, the error gives the reason for which it is needed."""
    path = data_set.folder / arm_file(arm)
    if not path.is_file():
        raise ScenarioError(f"{data_set.label}: no {arm_file(arm)}; {reason}")
    return read_arm(path)


def baseline_pieces(plan: DataSetPlan) -> tuple[str, ...]:
    """Return the methods as they are written in the spec, then the table; nothing where there are none."""
    methods = tuple(map(str, plan.spec.baselines.methods))
    return (*methods, "table") if methods else ()


def baseline_files(plan: DataSetPlan, folder: Path, piece: str) -> Mapping[str, bytes]:
    """Score one method, or gather the table; a piece of a stage of the build."""
    if piece != "table":
        data = _baseline_data(folder, file_hash(folder / INDEX), plan.spec.baselines)
        scores = report(data, Method.parsed(piece))
        return {_file(piece): f"{json.dumps(scores, indent=1, allow_nan=False)}\n".encode()}
    _baseline_data.cache_clear()  # the table is the last piece: the records are needed no longer
    paths = [folder / _file(str(method)) for method in plan.spec.baselines.methods]
    rows = [json.loads(path.read_bytes())["row"] for path in paths]
    return {BASELINES: table_text(rows[0], rows).encode()}


def _file(method: str) -> str:
    """File of the scores of a baseline, written as in a spec, ``"oe:2/2/1"``, on every record."""
    return f"baselines/{method.replace(':', '-').replace('/', '-')}.json"


@lru_cache(maxsize=1)
def _baseline_data(folder: Path, index_hash: str, limits: BaselineSpec) -> BaselineData:
    """Read the records of a data set once for all baselines; the hash distinguishes a folder that was rebuilt."""
    return BaselineData(open_data_set(folder), limits)


def report(data: BaselineData, method: Method) -> dict[str, Any]:
    """Make a baseline as it is published: its row with the scores of every record, or with the reason of failure."""
    row = _empty_row(data, method)
    try:
        result = baseline(data, method)
    except (ScenarioError, SysidError) as error:
        return {"row": {**row, "failed": str(error)}, "test": [], "validation": []}
    return {
        "row": row | _row_of_scores(data, result),
        "test": _scores_as_json(result.test),
        "validation": _scores_as_json(result.validation),
        "trained_on": list(result.trained),
    }


def _empty_row(data: BaselineData, method: Method) -> dict[str, str]:
    """The row of a method without its scores, in the order of the columns, with the command that repeats it."""
    spec = data.data_set.spec
    orders = [str(order) for order in method.orders]
    options = ["--method", method.name]
    if orders:
        options += ["--orders", *orders]
    for name in ("twins", "records"):
        limit = getattr(data.limits, name)
        if limit != getattr(spec.baselines, name):
            options += [f"--{name}", str(limit)]
    test_records = [record for record in data.data_set.index if record.part == "test"]
    test_joints = dict.fromkeys(chain.from_iterable(record.joints for record in test_records))
    to_fill = ("test", *(f"test_{joint}" for joint in test_joints), "validation", "records_scored")
    return {
        "method": method.name,
        "orders": " ".join(orders),
        "metric": spec.scoring.metric,
        "unit": spec.scoring.unit,
        "steps": str(spec.scoring.steps),
        # There from the start: the first row names the columns of the table, and it may be one that failed.
        **dict.fromkeys((*to_fill, "trained_on", "twins", "failed"), ""),
        "software": software(),
        "command": join(["hmtb", "dataset", "baselines", spec.label, *options]),
    }


def _row_of_scores(data: BaselineData, result: Baseline) -> dict[str, str]:
    """Cells of a row of baselines.csv that come from a result: scores, training records, twins."""
    trained = set(result.trained)
    blocks = dict.fromkeys(record.block for record in data.train if record.name in trained)
    trained_on = f"{' and '.join(blocks)} ({len(trained)})" if trained else ""
    validation = "" if result.validation is None else _digits(result.validation.mean)
    return {
        "trained_on": trained_on,
        "twins": " ".join(map(str, data.twins)),
        "validation": validation,
        "test": _digits(result.test.mean),
        **{f"test_{joint}": _digits(value) for joint, value in result.test.by_joint.items()},
        "records_scored": str(len({score.experiment for score in result.test.scores})),
    }


def _scores_as_json(scores: Scores | None) -> list[list[str]]:
    """The scores of every record and output; none where nothing was scored."""
    if scores is None:
        return []
    return [[score.experiment, score.joint, _digits(score.value)] for score in scores.scores]


@cache
def software() -> str:
    """Return the versions of the packages that baselines depend on."""
    installed = versions()
    return ", ".join(f"{name} {installed[name]}" for name in ("hmtb-twin", "numpy", "scipy"))


def differences(made: Mapping[str, str], published: Mapping[str, str]) -> tuple[str, ...]:
    """List the scores of a row that differ from those of the published row, in words."""
    lines = []
    for name, score in made.items():
        if name not in ("test", "validation") and not name.startswith("test_"):
            continue
        published_score = published.get(name, "")
        if score != published_score and not _are_close(score, published_score):
            lines.append(f"{name} = {score or 'none'}, published {published_score or 'none'}")
    return tuple(lines)


def _are_close(score: str, published_score: str) -> bool:
    """Whether both are numbers, and equal but for the rounding of other machines."""
    return bool(score and published_score) and math.isclose(float(score), float(published_score), rel_tol=1e-9)


def _digits(value: float) -> str:
    """A score as text; eleven digits, so that rounding is no difference."""
    return f"{value:.11g}"
