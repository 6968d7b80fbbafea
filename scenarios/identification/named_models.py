"""Models by name: the truth of the logged arm, models that the thesis prints, estimators with orders, model files."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import sysid
from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.files.data_file import joints_of, log_of
from scenarios.files.errors import ScenarioError, unknown
from scenarios.identification.methods import DIGITS, ESTIMATORS, typed_orders
from scenarios.truth.published import (
    BY_NAME,
    EQUATIONS,
    PublishedModel,
    PublishedSystem,
    published,
    published_model,
)
from sysid import Estimate, IOData, StateSpace
from sysid.validation.structure_scan import Order

FORMS = (
    "truth, published, published:NAME (4.7 ... 5.10, sysid, okid, hybrid), METHOD:ORDERS (oe:2/2/1, procest:P1D), "
    "FILE.json"
)
"""Forms of a model's name, for messages."""


class ModelName(NamedTuple):
    """A model by name.

    Attributes:
        text: The name as typed.
        kind: `truth`, `published`, `file` or the method of an estimator.
        name: Name of a printed model; empty for all of the joint, and for others.
        orders: Orders of an estimator.
    """

    text: str
    kind: str
    name: str = ""
    orders: tuple[Order | str, ...] = ()

    @property
    def is_estimated(self) -> bool:
        """Whether the model is identified from records; others are known beforehand."""
        return self.kind in ESTIMATORS


def parse_model_name(text: str) -> ModelName:
    """Parse the name of a model.

    Args:
        text: `truth`, `published`, `published:4.7`, a method with its orders, `oe:2/2/1`, or a model file, `my.json`.

    Raises:
        ScenarioError: It names no model.
    """
    kind, colon, rest = text.partition(":")
    if text.endswith(".json"):
        return ModelName(text, "file")
    if text in ("truth", "published"):
        return ModelName(text, kind)
    if kind == "published":
        published_model(rest)  # refuses a name that the thesis does not have
        return ModelName(text, kind, name=rest)
    if kind == "truth":
        raise ScenarioError(f"model {text!r}: the truth has no name or orders; expected truth alone")
    if kind not in ESTIMATORS:
        if text in BY_NAME:
            raise ScenarioError(f"unknown model {text!r}: did you mean 'published:{text}'? There are: {FORMS}")
        raise ScenarioError(unknown("model", kind, ("truth", "published", *ESTIMATORS)) + f"; written {FORMS}")
    words = [word.strip() for word in rest.replace(",", "/").split("/")] if colon else []
    orders = typed_orders(words, kind)
    if orders is None:
        expected = "orders" if ESTIMATORS[kind].words else "whole orders"
        example = "procest:P1D" if ESTIMATORS[kind].words else "oe:2/2/1"
        raise ScenarioError(
            f"model {text!r}: expected {expected} apart by slashes, of {DIGITS} digits at most, as in {example}"
        )
    ESTIMATORS[kind].complete(orders)
    return ModelName(text, kind, orders=orders)


class KnownModel(NamedTuple):
    """A model that is known beforehand.

    Attributes:
        label: Text for tables and legends.
        model: The model.
        remarks: Doubts about it.
    """

    label: str
    model: StateSpace | Estimate
    remarks: tuple[str, ...] = ()


def known_models(name: ModelName, record: IOData, path: Path) -> list[KnownModel]:
    """Return the models of a name that is no estimator's, of the joints of a record.

    Args:
        name: The name; `published` alone may have several models.
        record: The record.
        path: Its file: the truth is that of the log's arm.

    Raises:
        ScenarioError: The model does not go with the record: other joints, another sampling interval, no truth known.
        SysidError: A model file cannot be read.
    """
    if name.kind == "file":
        return [_model_of_file(name.text, record)]
    if name.kind == "truth":
        return [_truth(record, path)]
    return _published_models(name, record, path)


def _model_of_file(file: str, record: IOData) -> KnownModel:
    model = sysid.read_model(file)
    if isinstance(model, sysid.Polynomials):
        model = sysid.models.innovations_form(model, record.dt)
    return KnownModel(Path(file).stem, model)


def _truth(record: IOData, path: Path) -> KnownModel:
    """Small-signal truth of the arm of a log, between the joints of the record."""
    from hmtb_twin import linearize
    from hmtb_twin.truth.logged_arm import logged_arm

    joints, log = joints_of(record), log_of(path)
    if log is None or not joints:
        raise ScenarioError(
            f"{path.name} tells of no arm; the truth is known of logs of hmtb simulate only (.nc); name models: "
            "--models arx:2/2/1 n4sid:2"
        )
    truth = linearize(logged_arm(log), log.provenance["pose"], amplitudes=())
    if len(joints) == 1:
        return KnownModel("truth", truth.joint(joints[0]).model)
    # Without a noise model: of several joints the truth predicts one step ahead as it simulates.
    return KnownModel("truth", replace(truth.subset(joints, joints), K=None, innovation_covariance=None))


def _published_models(name: ModelName, record: IOData, path: Path) -> list[KnownModel]:
    joints = joints_of(record)
    if not name.name and len(joints) != 1:
        held = f"{len(joints)} joints" if joints else "no joint that is known"
        system = " or published:sysid" if joints else ""
        raise ScenarioError(
            f"{path.name} holds {held}; 'published' takes all printed models of one: name one, as published:4.7{system}"
        )
    printed = [published_model(name.name)] if name.name else list(published(joints[0]))
    if not printed:
        have = ", ".join(dict.fromkeys(model.joint for model in EQUATIONS.values()))
        raise ScenarioError(f"the thesis prints no model of {joints[0]}; it does of {have}")
    if abs(record.dt - SAMPLE_TIME) > 1e-6:
        raise ScenarioError(
            f"{path.name} is sampled every {record.dt:g} s; the printed models hold at {SAMPLE_TIME:g} s only: "
            "resample the record"
        )
    return [_published_on(model, record, joints, path) for model in printed]


def _published_on(
    printed: PublishedModel | PublishedSystem, record: IOData, joints: Sequence[str], path: Path
) -> KnownModel:
    """A printed model, or the part of a printed system, for the joints of a record."""
    of_joints = (printed,) if isinstance(printed, PublishedModel) else printed.parts
    chosen = list(of_joints)
    if joints and len(of_joints) > 1:
        # Of a model of three joints only the part of the record's joint counts.
        chosen = [model for model in of_joints if model.joint in joints]
    if joints and [model.joint for model in chosen] != list(joints):
        raise ScenarioError(
            f"published:{printed.name} is of {', '.join(printed.joints)}; {path.name} was read for {', '.join(joints)}"
        )
    if len(chosen) != record.nu:
        raise ScenarioError(
            f"published:{printed.name} takes {len(chosen)} input(s), {path.name} was read with {record.nu}"
        )
    label = printed.label
    if len(chosen) < len(of_joints):
        label += f", {chosen[0].label}"
    blocks = sysid.models.block_diagonal([model.model for model in chosen])
    if not joints and blocks.ny == record.ny:
        # The user says of which joint the record is: its channels may have any names.
        blocks = replace(blocks, input_names=record.input_names, output_names=record.output_names)
    doubts = tuple(f"{model.label}: {model.doubts}" for model in chosen)
    return KnownModel(f"published {label}", blocks, doubts)
