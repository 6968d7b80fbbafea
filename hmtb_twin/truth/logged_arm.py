"""The arm that a log was recorded from, and whether a truth belongs to it."""

from dataclasses import fields, replace
from json import loads
from typing import Any

import numpy as np

from hmtb_twin.arm.arm import Arm, load_arm
from hmtb_twin.bus.joint_log import JointLog
from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.plant import Plant
from hmtb_twin.parameters.specimen import Specimen
from hmtb_twin.truth.truth import Truth

REQUIRED = ("variant", "payload", "pose", "friction")
"""Provenance that every log of the twin has."""


def logged_payloads(log: JointLog) -> tuple[tuple[float, str], ...]:
    """Return the payloads of a log in their order, each with the time in s from which the end effector holds it.

    Raises:
        TwinError: The provenance of the log names none, or is damaged.
    """
    try:
        changes = [(float(time), str(payload)) for time, payload in loads(log.provenance.get("payload_changes", "[]"))]
        return ((0.0, log.provenance["payload"]), *changes)
    except (KeyError, TypeError, ValueError) as error:
        raise TwinError(f"{log.name}: damaged provenance, its payloads cannot be read: {error}") from error


def logged_arm(log: JointLog, payload: str | None = None) -> Arm:
    """Return the arm of a log, in free space and under the logged conditions.

    Args:
        log: A log of the twin; plant and specimen are nominal where its provenance does not name them.
        payload: Payload in place of the logged one; necessary where the payload changes.

    Raises:
        TwinError: The provenance of the log is incomplete or damaged, the payload changes and none is named, or the
            laboratory has no such arm.
    """
    missing = [key for key in REQUIRED if key not in log.provenance]
    if missing:
        raise TwinError(
            f"{log.name}: its provenance lacks {', '.join(missing)}; expected a log of the twin, which knows the "
            "truth about its own arm only"
        )
    if payload is None and len(payloads := logged_payloads(log)) > 1:
        raise TwinError(
            f"{log.name}: its payload changes, {', '.join(f'{name} from {time:g} s' for time, name in payloads)}; "
            "expected one payload: the arm has another truth with each (hmtb truth --payload NAME)"
        )
    kinds = {"plant": Plant, "specimen": Specimen}
    known = [f"{kind}_{entry.name}" for kind, record in kinds.items() for entry in fields(record)]
    tables: dict[str, dict[str, Any]] = {kind: {} for kind in kinds}
    for key, text in log.provenance.items():
        kind, _, name = key.partition("_")
        if kind in tables:
            if key not in known:
                raise TwinError(f"{log.name}: {key} in its provenance, expected one of {', '.join(known)}")
            try:
                tables[kind][name] = loads(text)
            except ValueError:  # names of models of friction and so on are no JSON
                tables[kind][name] = text
    try:
        plant, specimen = Plant(**tables["plant"]), Specimen(**tables["specimen"])
    except (TypeError, ValueError) as error:
        raise TwinError(f"{log.name}: damaged provenance: {error}") from error
    return load_arm(
        log.provenance["variant"],
        log.provenance["payload"] if payload is None else payload,
        plant=plant,
        specimen=specimen,
        friction=log.provenance["friction"] == "true",
    )


def check_truth(log: JointLog, arm: Arm, truth: Truth) -> None:
    """Check that a truth belongs to the arm, conditions and pose of a log; dry friction, absent there, may differ.

    Args:
        log: The log.
        arm: Its arm, from `logged_arm`.
        truth: The truth.

    Raises:
        TwinError: The truth is of another arm, of other conditions, or of another pose.
    """
    # Truths are without dry friction, so that its level and bristles must not count as a difference.
    dry = {name: getattr(Plant, name) for name in ("friction_level", "presliding")}
    truth_plant, log_plant = (vars(replace(plant.sliding, **dry)) for plant in (truth.plant, arm.plant))
    pairs = {
        "variant": (truth.variant, arm.variant),
        "payload": (truth.payload, arm.payload),
        **{name: (truth_plant[name], log_plant[name]) for name in truth_plant},
        **{
            f"specimen_{entry.name}": (getattr(truth.specimen, entry.name), getattr(arm.specimen, entry.name))
            for entry in fields(Specimen)
            if entry.name != "dry_friction"
        },
    }
    differences = [
        f"{name} = {of_truth}, not {of_log}" for name, (of_truth, of_log) in pairs.items() if of_truth != of_log
    ]
    pose = log.provenance["pose"]
    if not np.allclose(truth.angles, arm.pose(pose), rtol=0.0, atol=1e-9):
        differences.append(f"pose = {truth.pose}, not {pose}")
    if differences:
        raise TwinError(f"{log.name}: a truth given of {'; '.join(differences)}; expected that of the log's own arm")
