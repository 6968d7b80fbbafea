"""Comparison of models of any origin on one record: printed ones, the truth, and estimates."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import sysid
from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.files.data_file import joints_of, log_of
from scenarios.files.errors import ScenarioError, unknown
from scenarios.identification.identification import identify, usable
from scenarios.identification.methods import ESTIMATORS
from scenarios.truth.published import BY_NAME, EQUATIONS, PublishedModel, published, published_model
from sysid import Estimate, IOData, ModelFit, StateSpace
from sysid.models.predict import aligned, as_model, channels_in
from sysid.polynomial.fit_with_offset import subtract_means, unexplained_offset

FORMS = "truth, published, published:NAME (4.7 ... 5.10, sysid, okid, hybrid), METHOD:ORDERS (oe:2/2/1), FILE.json"
"""Forms of a model's name, for messages."""

DIGITS = 4  # of an order at most: more are a slip of the keyboard


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
    orders: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class JudgedModel:
    """A model on a record.

    Attributes:
        label: Text for tables and legends.
        kind: `truth`, `published`, `file` or the method of an estimator.
        model: The model.
        fit: Its fits, about its own operating point.
        level: Constant on every output between the mean and that operating point (ny,).
        bandwidth_hz: Bandwidth of every path (ny, nu), Hz; NaN where there is none, or none that can be claimed.
        ci95: Ends of their 95 % intervals (ny, nu, 2), Hz; NaN where they are not known.
        remarks: Remarks on the model.
    """

    label: str
    kind: str
    model: StateSpace
    fit: ModelFit
    level: NDArray[np.float64]
    bandwidth_hz: NDArray[np.float64]
    ci95: NDArray[np.float64]
    remarks: tuple[str, ...]


def parsed(text: str) -> ModelName:
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
        published_model(rest)
        return ModelName(text, kind, name=rest)
    if kind == "truth":
        raise ScenarioError(f"model {text!r}: the truth has no name or orders; expected truth alone")
    if kind not in ESTIMATORS:
        if text in BY_NAME:
            raise ScenarioError(f"unknown model {text!r}: did you mean 'published:{text}'? There are: {FORMS}")
        raise ScenarioError(unknown("model", kind, ("truth", "published", *ESTIMATORS)) + f"; written {FORMS}")
    words = rest.replace(",", "/").split("/") if colon else []
    if not all(re.fullmatch(rf"[0-9]{{1,{DIGITS}}}", word.strip()) for word in words):
        raise ScenarioError(
            f"model {text!r}: expected whole orders apart by slashes, of {DIGITS} digits at most, as in oe:2/2/1"
        )
    orders = tuple(int(word) for word in words)
    ESTIMATORS[kind].complete(kind, orders)
    return ModelName(text, kind, orders=orders)


def compare_models(
    names: Sequence[ModelName],
    records: Sequence[IOData],
    path: Path,
    *,
    estimation: Sequence[IOData] | None = None,
    estimation_path: Path | None = None,
    skip: float = 0.0,
    keep_mean: bool = False,
    steps: int = 1,
    test: str | None = None,
) -> tuple[tuple[IOData, ...], tuple[JudgedModel, ...]]:
    """Judge models on a record, each about its own operating point.

    Args:
        names: The models.
        records: The record, as read.
        path: Its file: the truth is that of the log's arm.
        estimation: Records that estimators identify from; the same records when None.
        estimation_path: Their file.
        skip: Length of the start that is left out of both, s.
        keep_mean: Whether models are of the values as they are, without an operating point.
        steps: Horizon of the further prediction, samples.
        test: Which test of the file, for messages.

    Returns:
        The record about its means, or as it is; and the models with their fits, in the sequence of their names.

    Raises:
        ScenarioError: A model does not go with the record: other joints, another sampling interval, no truth known.
        SysidError: An estimator refuses the records.
    """
    parts = usable(records, skip, path, test)
    shown = tuple(parts) if keep_mean else subtract_means(parts)
    models: list[JudgedModel] = []
    for name in names:
        if name.kind in ESTIMATORS:
            own = usable(estimation or records, skip, estimation_path or path, test)
            result = identify(own, name.kind, name.orders, keep_mean=keep_mean, steps=steps, check=parts)
            label = f"{name.kind.upper()} {'/'.join(map(str, result.fitted.orders.values()))}"
            # The same samples twice, about their means and about the model's own operating point.
            moved = [part.y - about.y for part, about in zip(shown, result.checked, strict=True)]
            claims = [[(claim.hz, claim.low, claim.high) for claim in row] for row in result.fitted.claims]
            models.append(
                JudgedModel(
                    label,
                    name.kind,
                    result.fitted.estimate.model,
                    replace(result.fit, name=label),
                    np.nanmean(np.concatenate(moved), axis=0),
                    np.array(claims)[..., 0],
                    np.array(claims)[..., 1:],
                    result.warnings,
                )
            )
            continue
        for label, known, remarks in _known_models(name, parts[0], path):
            model = as_model(known)
            level = np.zeros(model.ny) if keep_mean else unexplained_offset(model, shown)[0]
            about = shown if keep_mean else [part.subtract(y=level) for part in shown]
            (fit,) = sysid.compare({label: model}, about, steps=steps)
            band = known.bandwidth() if isinstance(known, Estimate) else None
            hz, ci95 = (model.bandwidth(), None) if band is None else (band.hz, np.stack(band.ci95, axis=-1))
            # channels in the sequence of the record's
            inputs, outputs = channels_in(model, parts[0])
            paths = np.ix_(outputs, inputs)
            ends = np.full((*hz.shape, 2), np.nan) if ci95 is None else ci95[paths]
            shaped = aligned(model, parts[0])
            models.append(JudgedModel(label, name.kind, shaped, fit, level, hz[paths], ends, remarks))
    return shown, tuple(models)


def _known_models(
    name: ModelName, record: IOData, path: Path
) -> list[tuple[str, StateSpace | Estimate, tuple[str, ...]]]:
    """Label, model and remarks of models that need no estimation."""
    joints = joints_of(record)
    if name.kind == "file":
        model = sysid.read_model(name.text)
        if isinstance(model, sysid.Polynomials):
            model = sysid.models.innovations_form(model, record.dt)
        return [(Path(name.text).stem, model, ())]
    if name.kind == "truth":
        from hmtb_twin import linearize
        from hmtb_twin.truth.logged_arm import logged_arm

        log = log_of(path)
        if log is None or not joints:
            raise ScenarioError(
                f"{path.name} tells of no arm; the truth is known of logs of hmtb simulate only (.nc); name models: "
                "--models arx:2/2/1 n4sid:2"
            )
        truth = linearize(logged_arm(log), log.provenance["pose"], amplitudes=())
        if len(joints) == 1:
            return [("truth", truth.joint(joints[0]).model, ())]
        return [("truth", replace(truth.subset(joints, joints), K=None, innovation_covariance=None), ())]
    if not name.name and len(joints) != 1:
        what = f"{len(joints)} joints" if joints else "no joint that is known"
        raise ScenarioError(
            f"{path.name} holds {what}; 'published' takes all printed models of one: name one, as published:4.7"
            + (" or published:sysid" if joints else "")
        )
    entries = [published_model(name.name)] if name.name else list(published(joints[0]))
    if not entries:
        have = ", ".join(dict.fromkeys(entry.joint for entry in EQUATIONS.values()))
        raise ScenarioError(f"the thesis prints no model of {joints[0]}; it does of {have}")
    if abs(record.dt - SAMPLE_TIME) > 1e-6:
        raise ScenarioError(
            f"{path.name} is sampled every {record.dt:g} s; the printed models hold at {SAMPLE_TIME:g} s only: "
            "resample the record"
        )
    models: list[tuple[str, StateSpace | Estimate, tuple[str, ...]]] = []
    for entry in entries:
        parts = (entry,) if isinstance(entry, PublishedModel) else entry.parts
        # Of a model of three joints only the part of the record's joint counts.
        chosen = [part for part in parts if part.joint in joints] if joints and len(parts) > 1 else list(parts)
        if joints and [part.joint for part in chosen] != list(joints):
            raise ScenarioError(
                f"published:{entry.name} is of {', '.join(entry.joints)}; {path.name} was read for {', '.join(joints)}"
            )
        if len(chosen) != record.nu:
            raise ScenarioError(
                f"published:{entry.name} takes {len(chosen)} input(s), {path.name} was read with {record.nu}"
            )
        label = entry.label if len(chosen) == len(parts) else f"{entry.label}, {chosen[0].label}"
        blocks = sysid.models.block_diagonal([part.model for part in chosen])
        if not joints and blocks.ny == record.ny:
            # the user says of which joint the record is: its channels may have any names
            blocks = replace(blocks, input_names=record.input_names, output_names=record.output_names)
        models.append((f"published {label}", blocks, tuple(f"{part.label}: {part.doubts}" for part in chosen)))
    return models
