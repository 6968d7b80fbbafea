"""The arm that a log was recorded from, and whether a truth belongs to it."""

from dataclasses import fields, replace
from json import loads
from typing import Any

import numpy as np

from hmtb_twin.arm.arm import Arm, load_arm
from hmtb_twin.arm_files.known_arms import arm_named
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
        payloads = [(0.0, log.provenance["payload"])]
        for time, payload in loads(log.provenance.get("payload_changes", "[]")):
            payloads.append((float(time), str(payload)))
        return tuple(payloads)
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
    if payload is None:
        payload = _only_payload(log)
    settings = _logged_settings(log)
    try:
        plant, specimen = Plant(**settings["plant"]), Specimen(**settings["specimen"])
    except (TypeError, ValueError) as error:
        raise TwinError(f"{log.name}: damaged provenance: {error}") from error
    # Written as in TOML.
    friction = log.provenance["friction"] == "true"
    variant = log.provenance["variant"]
    then = log.provenance.get("arm_sha256", "")
    if then and arm_named(variant).fingerprint != then:
        raise TwinError(
            f"{log.name}: the files of the arm {variant} are others than when the log was made; expected those of "
            "then, as its truth is theirs"
        )
    return load_arm(log.provenance["variant"], payload, plant=plant, specimen=specimen, friction=friction)


def _only_payload(log: JointLog) -> str:
    """Return the payload of a log; raises `TwinError` if it changes."""
    payloads = logged_payloads(log)
    if len(payloads) > 1:
        changes = ", ".join(f"{name} from {time:g} s" for time, name in payloads)
        raise TwinError(
            f"{log.name}: its payload changes, {changes}; "
            "expected one payload: the arm has another truth with each (hmtb truth --payload NAME)"
        )
    return payloads[0][1]


def _logged_settings(log: JointLog) -> dict[str, dict[str, Any]]:
    """Return the attributes of plant and specimen that the provenance of a log names."""
    plant_keys = [f"plant_{attribute.name}" for attribute in fields(Plant)]
    specimen_keys = [f"specimen_{attribute.name}" for attribute in fields(Specimen)]
    allowed = plant_keys + specimen_keys
    settings: dict[str, dict[str, Any]] = {"plant": {}, "specimen": {}}
    for key, value in log.provenance.items():
        record, _, name = key.partition("_")
        if record not in settings:
            continue
        # A key of a newer or foreign laboratory: without it the arm would silently be another one.
        if key not in allowed:
            raise TwinError(f"{log.name}: {key} in its provenance, expected one of {', '.join(allowed)}")
        try:
            settings[record][name] = loads(value)
        except ValueError:  # names of models of friction and so on are no JSON
            settings[record][name] = value
    return settings


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
    truth_plant = vars(replace(truth.plant.sliding, **dry))
    log_plant = vars(replace(arm.plant.sliding, **dry))
    pairs = {"variant": (truth.variant, arm.variant), "payload": (truth.payload, arm.payload)}
    pairs |= {name: (truth_plant[name], log_plant[name]) for name in truth_plant}
    for attribute in fields(Specimen):
        if attribute.name != "dry_friction":
            truth_value, log_value = getattr(truth.specimen, attribute.name), getattr(arm.specimen, attribute.name)
            pairs[f"specimen_{attribute.name}"] = (truth_value, log_value)
    differences = []
    for name, (truth_value, log_value) in pairs.items():
        if truth_value != log_value:
            differences.append(f"{name} = {truth_value}, not {log_value}")
    pose = log.provenance["pose"]
    if not np.allclose(truth.angles, arm.pose(pose), rtol=0.0, atol=1e-9):
        differences.append(f"pose = {truth.pose}, not {pose}")
    if differences:
        raise TwinError(f"{log.name}: the truth has other settings than the log: {'; '.join(differences)}")
