"""Baselines: what known estimators score on a data set, and the table of them."""

import json
import math
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache, partial
from pathlib import Path
from shlex import join
from typing import Any, NamedTuple

import numpy as np

from hmtb_twin import TwinError, load_arm
from hmtb_twin.files.hashes import file_hash
from scenarios.datasets.arm_truth import StoredArm, read_arm
from scenarios.datasets.data_set import DataRecord, DataSet, open_data_set
from scenarios.datasets.plan import BASELINES, INDEX, DataSetPlan, arm_file
from scenarios.datasets.score import Scores, score_outputs
from scenarios.datasets.spec_tables import PARTS, BaselineSpec, Method
from scenarios.datasets.tables import table_text
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import versions
from scenarios.identification.methods import ESTIMATORS, estimate
from scenarios.identification.nonlinear_methods import NONLINEAR, RECORDS_ALONE, Known
from sysid import IOData, SysidError, SysidWarning
from sysid.polynomial.fit_with_offset import fit_with_offset
from sysid.validation.predictors import Hold, ModelPredictor, Predictor, StackedPredictor, StaticGain


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
        recorded = sorted({one.twin for one in self.data_set.index if one.twin is not None and one.failed is None})
        count = len(recorded) if self.limits.twins == 0 else min(self.limits.twins, len(recorded))
        return tuple(recorded[round(k * (len(recorded) - 1) / max(count - 1, 1))] for k in range(count))

    @cached_property
    def records(self) -> Mapping[str, tuple[DataRecord, ...]]:
        """Records on the selected twins by part, the same objects for all baselines: each file is read once."""
        kept = [one for one in self.data_set.records() if one.twin is None or one.twin in self.twins]
        return {part: tuple(one for one in kept if one.part == part) for part in PARTS}

    @cached_property
    def train(self) -> tuple[DataRecord, ...]:
        """Records to identify from: the first ones of each block, arm and set of joints."""
        kept, counts = list[DataRecord](), Counter[tuple[object, ...]]()
        for one in self.records["train"]:
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


def baseline(data: BaselineData, method: Method) -> Baseline:
    """Identify the models of a method from the training part, and score them on test and validation part.

    Raises:
        ScenarioError: No training records for a test record, or the method needs the truth and it is missing.
        SysidError: The estimator refuses the records.
    """
    models: dict[tuple[str, ...], Predictor] = {}
    trained: dict[str, None] = {}
    scoring, joints = data.data_set.spec.scoring, {frozenset(one.joints) for one in data.train}
    uses_truth = method.name in NONLINEAR and NONLINEAR[method.name].truth

    def predicted(record: DataRecord) -> np.ndarray:
        training = () if method.name == "truth" else data.training(record)
        own_arm = method.name == "truth" or uses_truth
        key = (record.arm if own_arm else "", *record.joints, *(one.name for one in training))
        if key not in models and method.name == "truth":
            models[key] = _true_predictor(data.data_set, record.arm, record.joints)
        elif key not in models:
            order = {one.name: [one.joints.index(joint) for joint in record.joints] for one in training}
            parts = [one.iodata().select(inputs=order[one.name], outputs=order[one.name]) for one in training]
            known = Known(data.data_set.spec.seed)
            if uses_truth:
                zones = [dead_zone(data.data_set, one.arm, record.joints[0]) for one in (*training, record)]
                known = Known(data.data_set.spec.seed, tuple(zones[:-1]), zones[-1])
            models[key] = identified(method, parts, known)
            trained.update(dict.fromkeys(order))
        return models[key].predicted(record.iodata(), scoring.steps)

    test = score_outputs(scoring, data.records["test"], predicted)
    known = [r for r in data.records["validation"] if method.name == "truth" or frozenset(r.joints) in joints]
    return Baseline(test, score_outputs(scoring, known, predicted) if known else None, tuple(trained))


def identified(method: Method, parts: Sequence[IOData], known: Known = RECORDS_ALONE) -> Predictor:
    """Identify a predictor from records, its operating point with it.

    Args:
        method: The method; not the truth.
        parts: Training records with the same channels.
        known: What a nonlinear method may know besides them.

    Raises:
        ScenarioError: Orders or records that a nonlinear method cannot use.
        SysidError: The estimator refuses the records.
    """
    if method.name == "hold":
        return Hold(np.concatenate([part.y for part in parts]).mean(axis=0))
    if method.name == "gain":
        return StaticGain.fitted(parts)
    if parts[0].ny > 1 and not (method.name in ESTIMATORS and ESTIMATORS[method.name].outputs):
        rows = range(parts[0].ny)
        return StackedPredictor(tuple(identified(method, [p.select(outputs=[i]) for p in parts], known) for i in rows))
    with warnings.catch_warnings():
        # A poor model shows in its score.
        warnings.simplefilter("ignore", SysidWarning)
        if method.name in NONLINEAR:
            return NONLINEAR[method.name].run(parts, method.orders, known)
        model = fit_with_offset(partial(estimate, method=method.name, orders=method.orders), parts).estimate
    return ModelPredictor(model.model, *(model.operating_point or ()))


def _true_predictor(data_set: DataSet, arm: str, joints: Sequence[str]) -> ModelPredictor:
    """The small-signal truth of joints of an arm, with its noise model and its operating point."""
    stored = _stored_arm(data_set, arm, "a baseline of the truth needs the truth")
    single = stored.joints.get(joints[0]) if len(joints) == 1 else None
    # The model of a joint alone has fewer states and the same behaviour.
    model = single.model if single else stored.truth.subset(joints, joints)
    index = [list(stored.truth.model.input_names or ()).index(f"{joint} commanded") for joint in joints]
    return ModelPredictor(model, stored.truth.angles[index], stored.rest[index])


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


def _stored_arm(data_set: DataSet, arm: str, why: str) -> StoredArm:
    """The truth of an arm; an error says why it is needed where it is missing."""
    path = data_set.folder / arm_file(arm)
    if not path.is_file():
        raise ScenarioError(f"{data_set.label}: no {arm_file(arm)}; {why}")
    return read_arm(path)


def baseline_pieces(plan: DataSetPlan) -> tuple[str, ...]:
    """Return the methods as they are written in the spec, then the table; nothing where there are none."""
    methods = tuple(map(str, plan.spec.baselines.methods))
    return (*methods, "table") if methods else ()


def baseline_files(plan: DataSetPlan, folder: Path, piece: str) -> Mapping[str, bytes]:
    """Score one method, or gather the table; a piece of a stage of the build."""
    if piece != "table":
        data = _data(folder, file_hash(folder / INDEX), plan.spec.baselines)
        text = json.dumps(report(data, Method.parsed(piece)), indent=1, allow_nan=False) + "\n"
        return {_file(piece): text.encode()}
    _data.cache_clear()
    rows = [json.loads((folder / _file(name)).read_bytes())["row"] for name in map(str, plan.spec.baselines.methods)]
    return {BASELINES: table_text(rows[0], rows).encode()}


def _file(method: str) -> str:
    """File of the scores of a baseline, written as in a spec, ``"oe:2/2/1"``, on every record."""
    return f"baselines/{method.replace(':', '-').replace('/', '-')}.json"


@lru_cache(maxsize=1)
def _data(folder: Path, index_hash: str, limits: BaselineSpec) -> BaselineData:
    """The records, read once for all baselines; the hash distinguishes a folder that was built anew."""
    return BaselineData(open_data_set(folder), limits)


def report(data: BaselineData, method: Method) -> dict[str, Any]:
    """Make a baseline as it is published: its row with the scores of every record, or with the reason of failure."""
    spec = data.data_set.spec
    joints = dict.fromkeys(joint for one in data.data_set.index if one.part == "test" for joint in one.joints)
    options = ["--method", method.name]
    options += ["--orders", *map(str, method.orders)] if method.orders else []
    for name in ("twins", "records"):
        if getattr(data.limits, name) != getattr(spec.baselines, name):
            options += [f"--{name}", str(getattr(data.limits, name))]
    row = {
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
    try:
        result = baseline(data, method)
    except (ScenarioError, SysidError) as error:
        return {"row": {**row, "failed": str(error)}, "test": [], "validation": []}
    blocks = dict.fromkeys(one.block for one in data.train if one.name in set(result.trained))
    row |= {
        "trained_on": f"{' and '.join(blocks)} ({len(result.trained)})" if result.trained else "",
        "twins": " ".join(map(str, data.twins)),
        "validation": "" if result.validation is None else _text(result.validation.mean),
        "test": _text(result.test.mean),
        **{f"test_{joint}": _text(value) for joint, value in result.test.by_joint.items()},
        "records_scored": str(len({score.experiment for score in result.test.scores})),
    }
    lists = {
        part: [[one.experiment, one.joint, _text(one.value)] for one in (scores.scores if scores else ())]
        for part, scores in (("test", result.test), ("validation", result.validation))
    }
    return {"row": row, **lists, "trained_on": list(result.trained)}


@cache
def software() -> str:
    """Return the versions of the packages that baselines depend on."""
    installed = versions()
    return ", ".join(f"{name} {installed[name]}" for name in ("hmtb-twin", "numpy", "scipy"))


def differences(made: Mapping[str, str], published: Mapping[str, str]) -> tuple[str, ...]:
    """List the scores of a row that differ from those of the published row, in words."""
    texts = []
    for name, now in made.items():
        if name in ("test", "validation") or name.startswith("test_"):
            then = published.get(name, "")
            if now != then and not (now and then and math.isclose(float(now), float(then), rel_tol=1e-9)):
                texts.append(f"{name} = {now or 'none'}, published {then or 'none'}")
    return tuple(texts)


def _text(value: float) -> str:
    """A score as text; eleven digits, so that rounding is no difference."""
    return f"{value:.11g}"
