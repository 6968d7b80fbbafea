"""Baselines: what the analyst's estimators reach on a data set."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenarios.datasets.arm_truth import StoredArm, read_arm
from scenarios.datasets.data_set import DataRecord, DataSet
from scenarios.datasets.layout import arm_file
from scenarios.datasets.score import Hold, ModelPredictor, Predictor, Scores, StackedPredictor, StaticGain, scored
from scenarios.datasets.spec import DataSetSpec
from scenarios.datasets.spec_tables import BaselineSpec, Method
from scenarios.files.errors import ScenarioError
from scenarios.identification.methods import ESTIMATORS, estimate
from sysid import Estimate, IOData, SysidWarning
from sysid.polynomial.fit_with_offset import fit_with_offset

NEEDS_TRUTH = "truth"
"""The method that identifies nothing."""


@dataclass(frozen=True)
class Baseline:
    """What one method reaches.

    Attributes:
        method: The method.
        test: Scores on the test part.
        validation: Scores on the validation part; None where there is none.
        trained: Names of the training records, in order.
        twins: Numbers of the randomised twins that it is made for; none of a data set without twins.
    """

    method: Method
    test: Scores
    validation: Scores | None
    trained: tuple[str, ...]
    twins: tuple[int, ...]


@dataclass(frozen=True)
class BaselineData:
    """A data set and the records of it that baselines are made from and scored on.

    Attributes:
        data_set: The data set.
        asked: How many twins and training records are used.
    """

    data_set: DataSet
    asked: BaselineSpec

    @cached_property
    def spec(self) -> DataSetSpec:
        """The spec of the data set."""
        return self.data_set.spec

    @cached_property
    def twins(self) -> tuple[int, ...]:
        """The twins chosen, evenly over all that have a test record; empty where there are none."""
        there = sorted({line.twin for line in self.data_set.index if line.twin is not None and line.failed is None})
        most = len(there) if self.asked.twins == 0 else min(self.asked.twins, len(there))
        return tuple(there[round(k * (len(there) - 1) / max(most - 1, 1))] for k in range(most))

    def records(self, part: str) -> tuple[DataRecord, ...]:
        """Records of a part, of the twins chosen; each is read once."""
        chosen = set(self.twins)
        return tuple(one for one in self.data_set.records(part) if one.twin is None or one.twin in chosen)

    @cached_property
    def test(self) -> tuple[DataRecord, ...]:
        """Records to score on."""
        return self.records("test")

    @cached_property
    def validation(self) -> tuple[DataRecord, ...]:
        """Records to choose by."""
        return self.records("validation")

    @cached_property
    def train(self) -> tuple[DataRecord, ...]:
        """Records to identify from: of each block, arm and set of joints as many as asked for."""
        kept, counts = list[DataRecord](), dict[tuple[object, ...], int]()
        for one in self.records("train"):
            key = (one.block, one.arm, frozenset(one.joints))
            counts[key] = counts.get(key, 0) + 1
            if not self.asked.records or counts[key] <= self.asked.records:
                kept.append(one)
        return tuple(kept)

    def training(self, record: DataRecord) -> tuple[DataRecord, ...]:
        """What a model for a record is identified from.

        Training records with its joints of its own arm under its own conditions; where there are none, of its twin
        under any.

        Raises:
            ScenarioError: There are none with its joints.
        """
        alike = [one for one in self.train if set(one.joints) == set(record.joints) and one.twin == record.twin]
        if not alike:
            raise ScenarioError(f"no training records of {', '.join(record.joints)} for {record.name}")
        own = [one for one in alike if one.arm == record.arm]
        return tuple(own or alike)


def baseline(bench: BaselineData, method: Method) -> Baseline:
    """Identify the models of a method from the training part, and score them on test and validation part.

    Args:
        bench: The data set.
        method: The method.

    Raises:
        ScenarioError: No training records for a test record, or the method needs the truth and it is kept apart.
        SysidError: What the estimator refuses.
    """
    models: dict[tuple[str, ...], Predictor] = {}
    names: dict[str, None] = {}
    rule = bench.spec.scoring
    arms = _Arms(bench.data_set)

    def found(record: DataRecord) -> Predictor:
        if method.name == NEEDS_TRUTH:
            return arms.predictor(record)
        training = bench.training(record)
        key = (*record.joints, *(one.name for one in training))
        if key not in models:
            models[key] = identified(method, [_in_order(one, record.joints) for one in training])
            names.update(dict.fromkeys(one.name for one in training))
        return models[key]

    def scores(records: Sequence[DataRecord]) -> Scores:
        by_name = {record.name: record for record in records}

        def hat(name: str) -> np.ndarray:
            record = by_name[name]
            return found(record).predicted(record.iodata(), rule.steps)

        return scored(rule, records, hat)

    test = scores(bench.test)
    used = {frozenset(one.joints) for one in bench.train}
    checked = [one for one in bench.validation if method.name == NEEDS_TRUTH or frozenset(one.joints) in used]
    validation = scores(checked) if checked else None
    return Baseline(method, test, validation, tuple(names), bench.twins)


def identified(method: Method, parts: Sequence[IOData]) -> Predictor:
    """Identify a predictor from records, its operating point with it.

    Args:
        method: The method; not the truth.
        parts: Training records with the same channels.

    Raises:
        SysidError: What the estimator refuses.
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


class _Arms:
    """Small-signal truths as predictors, each file read once."""

    def __init__(self, data_set: DataSet) -> None:
        self._folder = data_set.folder
        self._label = data_set.label
        self._known: dict[str, StoredArm] = {}

    def predictor(self, record: DataRecord) -> Predictor:
        place = self._folder / arm_file(record.arm)
        if not place.is_file():
            raise ScenarioError(f"{self._label}: no {arm_file(record.arm)}; a baseline of the truth needs the truth")
        if record.arm not in self._known:
            self._known = {record.arm: read_arm(place)}
        return true_predictor(self._known[record.arm], record.joints)


def true_predictor(arm: StoredArm, joints: Sequence[str]) -> ModelPredictor:
    """The small-signal truth of some joints of an arm, with its noise model and its operating point.

    Args:
        arm: What the file of the arm tells.
        joints: Inputs and outputs, in this order.
    """
    single = arm.joints.get(joints[0]) if len(joints) == 1 else None
    # The model of a joint alone has fewer states and the same behaviour.
    model = single.model if single else arm.truth.subset(joints, joints)
    index = [list(arm.truth.model.input_names or ()).index(f"{joint} commanded") for joint in joints]
    return ModelPredictor(model, arm.truth.angles[index], arm.rest[index])


def _in_order(record: DataRecord, joints: tuple[str, ...]) -> IOData:
    """A training record with its channels in the order of another record; all its samples count."""
    data = record.iodata()
    order = [record.joints.index(joint) for joint in joints]
    return data if order == list(range(len(joints))) else data.select(inputs=order, outputs=order)
