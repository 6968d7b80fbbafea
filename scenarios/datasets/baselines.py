"""Baselines: what known estimators score on a data set, and the table of them."""

import csv
import io
import json
import math
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property, lru_cache
from pathlib import Path
from shlex import join
from typing import Any

import numpy as np

from scenarios.datasets.arm_truth import read_arm
from scenarios.datasets.data_set import DataRecord, DataSet, open_data_set
from scenarios.datasets.plan import BASELINES, INDEX, DataSetPlan, arm_file, baseline_file
from scenarios.datasets.score import Scores, score_outputs
from scenarios.datasets.spec_tables import BaselineSpec, Method
from scenarios.files.errors import ScenarioError
from scenarios.files.hashes import file_hash
from scenarios.files.provenance import versions
from scenarios.identification.methods import ESTIMATORS, estimate
from scenarios.identification.predictors import Hold, ModelPredictor, Predictor, StackedPredictor, StaticGain
from sysid import Estimate, IOData, SysidError, SysidWarning
from sysid.polynomial.fit_with_offset import fit_with_offset

TRUTH_METHOD = "truth"
"""The method that identifies nothing: the small-signal truth as it is."""

CLOSE = 1e-9
"""Relative difference of scores up to which a row counts as reproduced."""

TABLE = "table"
"""The last piece of the stage, which gathers the rows."""


@dataclass(frozen=True)
class Baseline:
    """Scores of one method.

    Attributes:
        method: The method.
        test: Scores on the test part.
        validation: Scores on the validation part; None where there is none.
        trained: Names of the training records, in order.
        twins: Numbers of the randomised twins that have a model; none in a data set without twins.
    """

    method: Method
    test: Scores
    validation: Scores | None
    trained: tuple[str, ...]
    twins: tuple[int, ...]


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
        recorded = sorted({one.twin for one in self.data_set.index if one.twin is not None and one.failed is None})
        count = len(recorded) if self.limits.twins == 0 else min(self.limits.twins, len(recorded))
        return tuple(recorded[round(k * (len(recorded) - 1) / max(count - 1, 1))] for k in range(count))

    @cached_property
    def test(self) -> tuple[DataRecord, ...]:
        """Records to score on."""
        return self._records("test")

    @cached_property
    def validation(self) -> tuple[DataRecord, ...]:
        """Records to choose by."""
        return self._records("validation")

    @cached_property
    def train(self) -> tuple[DataRecord, ...]:
        """Records to identify from: the first ones of each block, arm and set of joints."""
        kept, counts = list[DataRecord](), Counter[tuple[object, ...]]()
        for one in self._records("train"):
            key = (one.block, one.arm, frozenset(one.joints))
            counts[key] += 1
            if not self.limits.records or counts[key] <= self.limits.records:
                kept.append(one)
        return tuple(kept)

    def training(self, record: DataRecord) -> tuple[DataRecord, ...]:
        """Return the records that the model for a record is identified from.

        These are the training records with its joints of its own arm under its own conditions; where there are none,
        of its twin under any.

        Raises:
            ScenarioError: There are none with its joints.
        """
        alike = [one for one in self.train if set(one.joints) == set(record.joints) and one.twin == record.twin]
        if not alike:
            raise ScenarioError(f"no training records of {', '.join(record.joints)} for {record.name}")
        return tuple([one for one in alike if one.arm == record.arm] or alike)

    def _records(self, part: str) -> tuple[DataRecord, ...]:
        selected = set(self.twins)
        return tuple(one for one in self.data_set.records(part) if one.twin is None or one.twin in selected)


def baseline(data: BaselineData, method: Method) -> Baseline:
    """Identify the models of a method from the training part, and score them on test and validation part.

    Args:
        data: The records.
        method: The method.

    Raises:
        ScenarioError: No training records for a test record, or the method needs the truth and it is missing.
        SysidError: The estimator refuses the records.
    """
    models: dict[tuple[str, ...], Predictor] = {}
    trained: dict[str, None] = {}
    scoring = data.data_set.spec.scoring

    @lru_cache(maxsize=1)
    def true_predictor(arm: str, joints: tuple[str, ...]) -> Predictor:
        return _true_predictor(data.data_set, arm, joints)

    def predictor(record: DataRecord) -> Predictor:
        if method.name == TRUTH_METHOD:
            return true_predictor(record.arm, record.joints)
        training = data.training(record)
        key = (*record.joints, *(one.name for one in training))
        if key not in models:
            models[key] = identified(method, [_in_order(one, record.joints) for one in training])
            trained.update(dict.fromkeys(one.name for one in training))
        return models[key]

    def scores(records: Sequence[DataRecord]) -> Scores:
        by_name = {one.name: one for one in records}
        return score_outputs(
            scoring, records, lambda name: predictor(by_name[name]).predicted(by_name[name].iodata(), scoring.steps)
        )

    test = scores(data.test)
    joints = {frozenset(one.joints) for one in data.train}
    checked = [one for one in data.validation if method.name == TRUTH_METHOD or frozenset(one.joints) in joints]
    return Baseline(method, test, scores(checked) if checked else None, tuple(trained), data.twins)


def identified(method: Method, parts: Sequence[IOData]) -> Predictor:
    """Identify a predictor from records, its operating point with it.

    Args:
        method: The method; not the truth.
        parts: Training records with the same channels.

    Raises:
        SysidError: The estimator refuses the records.
    """
    if method.name == "hold":
        return Hold(np.concatenate([part.y for part in parts]).mean(axis=0))
    if method.name == "gain":
        return StaticGain.fitted(parts)
    if parts[0].ny > 1 and not ESTIMATORS[method.name].outputs:
        rows = range(parts[0].ny)
        return StackedPredictor(tuple(identified(method, [p.select(outputs=[i]) for p in parts]) for i in rows))

    def run(records: Sequence[IOData]) -> Estimate:
        return estimate(records[0] if len(records) == 1 else records, method.name, method.orders)[0]

    with warnings.catch_warnings():
        # A poor model shows in its score.
        warnings.simplefilter("ignore", SysidWarning)
        about = fit_with_offset(run, parts)
    return ModelPredictor(about.estimate.model, about.input, about.output)


def _true_predictor(data_set: DataSet, arm: str, joints: Sequence[str]) -> ModelPredictor:
    """The small-signal truth of joints of an arm, with its noise model and its operating point."""
    path = data_set.folder / arm_file(arm)
    if not path.is_file():
        raise ScenarioError(f"{data_set.label}: no {arm_file(arm)}; a baseline of the truth needs the truth")
    stored = read_arm(path)
    single = stored.joints.get(joints[0]) if len(joints) == 1 else None
    # The model of a joint alone has fewer states and the same behaviour.
    model = single.model if single else stored.truth.subset(joints, joints)
    index = [list(stored.truth.model.input_names or ()).index(f"{joint} commanded") for joint in joints]
    return ModelPredictor(model, stored.truth.angles[index], stored.rest[index])


def _in_order(record: DataRecord, joints: tuple[str, ...]) -> IOData:
    """A training record with its channels in the order of another record."""
    data = record.iodata()
    order = [record.joints.index(joint) for joint in joints]
    return data if order == list(range(len(joints))) else data.select(inputs=order, outputs=order)


@dataclass(frozen=True)
class BaselineStage:
    """The stage of a build that makes the baselines of the spec, a file for each, and their table."""

    name: str = field(default="baselines", init=False)

    def pieces(self, plan: DataSetPlan) -> Iterable[str]:
        """Return the methods as they are written in the spec, then the table; nothing where there are none."""
        methods = tuple(map(str, plan.spec.baselines.methods))
        return (*methods, TABLE) if methods else ()

    def make(self, plan: DataSetPlan, folder: Path, piece: str) -> Mapping[str, bytes]:
        """Make one baseline, or gather the table; see `Stage.make`."""
        if piece != TABLE:
            data = _data(folder, file_hash(folder / INDEX), plan.spec.baselines)
            text = json.dumps(report(data, Method.parsed(piece)), indent=1, allow_nan=False) + "\n"
            return {str(baseline_file(piece)): text.encode()}
        _data.cache_clear()
        files = (folder / baseline_file(str(method)) for method in plan.spec.baselines.methods)
        return {BASELINES: table([json.loads(path.read_bytes())["row"] for path in files])}


@lru_cache(maxsize=1)
def _data(folder: Path, index_hash: str, limits: BaselineSpec) -> BaselineData:
    """The records, read once for all baselines; the hash distinguishes a folder that was built anew."""
    return BaselineData(open_data_set(folder), limits)


def report(data: BaselineData, method: Method) -> dict[str, Any]:
    """Make a baseline as it is published: its row with the scores of every record, or with the reason of failure.

    Args:
        data: The records.
        method: The method.
    """
    columns = _columns(data, method)
    try:
        made = baseline(data, method)
    except (ScenarioError, SysidError) as error:
        return {"row": {**columns, "failed": str(error)}, "test": [], "validation": []}
    blocks = dict.fromkeys(one.block for one in data.train if one.name in set(made.trained))
    by_joint = {f"test_{joint}": _written(value) for joint, value in made.test.by_joint.items()}
    row = columns | {
        "trained_on": f"{' and '.join(blocks)} ({len(made.trained)})" if made.trained else "",
        "twins": " ".join(map(str, made.twins)),
        "validation": "" if made.validation is None else _written(made.validation.mean),
        "test": _written(made.test.mean),
        **{name: value for name, value in by_joint.items() if name in columns},
        "records_scored": str(len({score.experiment for score in made.test.scores})),
    }
    parts = {"test": made.test, "validation": made.validation}
    lists = {
        part: [[one.experiment, one.joint, _written(one.value)] for one in (scores.scores if scores else ())]
        for part, scores in parts.items()
    }
    return {"row": row, **lists, "trained_on": list(made.trained)}


def _columns(data: BaselineData, method: Method) -> dict[str, str]:
    """All columns of a row; those of results are empty."""
    spec = data.data_set.spec
    options = ["--method", method.name]
    options += ["--orders", *map(str, method.orders)] if method.orders else []
    for name in ("twins", "records"):
        if getattr(data.limits, name) != getattr(spec.baselines, name):
            options += [f"--{name}", str(getattr(data.limits, name))]
    joints = dict.fromkeys(joint for one in data.data_set.index if one.part == "test" for joint in one.joints)
    return {
        "method": method.name,
        "orders": " ".join(map(str, method.orders)),
        "metric": spec.scoring.metric,
        "unit": spec.scoring.unit,
        "steps": str(spec.scoring.steps),
        **dict.fromkeys(("test", *(f"test_{joint}" for joint in joints), "validation", "records_scored"), ""),
        **dict.fromkeys(("trained_on", "twins", "failed"), ""),
        "software": software(),
        "command": join(["hmtb", "dataset", "baselines", spec.label, *options]),
    }


@cache
def software() -> str:
    """Return the versions of the packages that baselines depend on."""
    installed = versions()
    return ", ".join(f"{name} {installed[name]}" for name in ("hmtb-twin", "numpy", "scipy"))


def table(rows: Sequence[Mapping[str, str]]) -> bytes:
    """Write rows with equal columns as CSV (RFC 4180, but for line feeds alone); nothing for no rows."""
    if not rows:
        return b""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue().encode()


def read_table(path: Path) -> tuple[dict[str, str], ...]:
    """Read the table of baselines.

    Raises:
        ScenarioError: There is none, or it is damaged.
    """
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            rows = tuple(csv.DictReader(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ScenarioError(f"cannot read the baselines {path}: {error}") from error
    if any(None in one or None in one.values() for one in rows):
        raise ScenarioError(f"{path} is damaged: a row has more or fewer columns than the first")
    return rows


def differences(made: Mapping[str, str], published: Mapping[str, str]) -> tuple[str, ...]:
    """List the scores of a row that differ from those of the published row, in words."""
    texts = []
    for name, now in made.items():
        if name in ("test", "validation") or name.startswith("test_"):
            then = published.get(name, "")
            if now != then and not (now and then and math.isclose(float(now), float(then), rel_tol=CLOSE)):
                texts.append(f"{name} = {now or 'none'}, published {then or 'none'}")
    return tuple(texts)


def _written(value: float) -> str:
    """A score as text; eleven digits, so that rounding is no difference."""
    return f"{value:.11g}"
