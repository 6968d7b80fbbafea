"""The arm of an experiment, and the arm that a log was recorded from."""

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from json import loads
from typing import Any, get_type_hints

import numpy as np

from hmtb_twin import Arm, Experiment, JointLog, Plant, Specimen, Truth, load_arm
from scenarios.files.errors import ScenarioError

REQUIRED = ("variant", "payload", "pose", "friction")
"""Provenance that every log of the twin has."""


def logged_arm(log: JointLog) -> Arm:
    """Return the arm of a log, in free space and under the logged conditions.

    Args:
        log: A log of the twin, of this version or an older one; conditions that it does not hold are nominal.

    Raises:
        ScenarioError: The provenance of the log is incomplete or damaged.
        TwinError: The laboratory has no such arm.
    """
    missing = [key for key in REQUIRED if key not in log.provenance]
    if missing:
        raise ScenarioError(
            f"{log.name}: its provenance lacks {', '.join(missing)}; expected a log of the twin, which knows the "
            "truth about its own arm only"
        )
    return load_arm(
        log.provenance["variant"],
        log.provenance["payload"],
        plant=Plant(**_logged(log, "plant", get_type_hints(Plant))),
        specimen=_logged_specimen(log),
        friction=log.provenance["friction"] == "true",
    )


def pictured_arm(log: JointLog) -> Arm:
    """Return an arm that looks like that of a log, whatever its drives; nominal where the log has no provenance."""
    return load_arm(
        log.provenance.get("variant", "nominal"),
        log.provenance.get("payload", "rpcm"),
        worksite=log.unit_pose is not None,
    )


def _logged_specimen(log: JointLog) -> Specimen:
    """Return the deviations of a log's arm from its variant; raises `ScenarioError` where the provenance is damaged."""
    names = [f"specimen_{entry.name}" for entry in fields(Specimen)]
    unknown = [key for key in log.provenance if key.startswith("specimen_") and key not in names]
    if unknown:
        raise ScenarioError(f"{log.name}: {unknown[0]} in its provenance, expected one of {', '.join(names)}")
    values = _logged(log, "specimen", {entry.name: loads for entry in fields(Specimen)})
    try:
        return Specimen(**values)
    except ValueError as error:
        raise ScenarioError(f"{log.name}: its provenance describes no specimen of the arm: {error}") from error


def _logged(log: JointLog, kind: str, readers: Mapping[str, Callable[[str], Any]]) -> dict[str, Any]:
    """Return the values that the provenance holds under `kind_name`, by name."""
    values: dict[str, Any] = {}
    for name, read in readers.items():
        text = log.provenance.get(f"{kind}_{name}")
        try:
            values |= {} if text is None else {name: read(text)}
        except ValueError as error:
            raise ScenarioError(f"{log.name}: {kind}_{name} = {text!r} in its provenance, expected numbers") from error
    return values


def check_truth(log: JointLog, arm: Arm, truth: Truth) -> None:
    """Check that a truth belongs to the arm, conditions and pose of a log; dry friction, absent there, may differ.

    Args:
        log: The log.
        arm: Its arm, from `logged_arm`.
        truth: The truth.

    Raises:
        ScenarioError: The truth is of another arm, of other conditions, or of another pose.
    """
    # Truths are without dry friction, so that its level must not count as a difference.
    truth_plant, log_plant = (vars(replace(plant.sliding, friction_level=1.0)) for plant in (truth.plant, arm.plant))
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
        raise ScenarioError(
            f"{log.name}: a truth given of {'; '.join(differences)}; expected that of the log's own arm"
        )


def experiment_arm(experiment: Experiment, *, worksite: bool = False) -> Arm:
    """Return the arm of an experiment; at its worksite only if both the experiment and `worksite` say so."""
    return load_arm(
        experiment.variant,
        experiment.payload,
        plant=experiment.plant,
        specimen=experiment.specimen,
        friction=experiment.chain.friction,
        worksite=worksite and bool(experiment.worksite),
    )
