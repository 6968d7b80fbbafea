"""The arm of an experiment, and the arm that a log was recorded from."""

from dataclasses import fields, replace
from json import JSONDecodeError, loads
from typing import Any, get_type_hints

import numpy as np

from hmtb_twin import Arm, Experiment, JointLog, Plant, Specimen, Truth, TwinError, load_arm
from scenarios.files.errors import ScenarioError

NEEDED = ("variant", "payload", "pose", "friction")


def logged_arm(log: JointLog) -> Arm:
    """Return the arm in free space, under the conditions of the record.

    Args:
        log: A log of the twin, of this version or an older one: what an older one does not tell is nominal.

    Raises:
        ScenarioError: The log does not tell, or holds an emergency shutdown or work in contact.
        TwinError: It tells of something that the laboratory does not have.
    """
    missing = [key for key in NEEDED if key not in log.provenance]
    if missing:
        raise ScenarioError(
            f"{log.name}: its provenance lacks {', '.join(missing)}; expected a log of the twin, which knows the "
            "truth about its own arm only"
        )
    return load_arm(
        log.provenance["variant"],
        log.provenance["payload"],
        plant=logged_plant(log),
        specimen=logged_specimen(log),
        friction=log.provenance["friction"] == "true",
    )


def pictured_arm(log: JointLog) -> Arm:
    """Return an arm that looks like that of a log; what moved it does not matter, nor whether the log tells of it."""
    return load_arm(
        log.provenance.get("variant", "nominal"),
        log.provenance.get("payload", "rpcm"),
        worksite=log.unit_pose is not None,
    )


def logged_plant(log: JointLog) -> Plant:
    """Return the conditions of the record.

    Raises:
        ScenarioError: A condition is no number where one is expected.
    """
    hints = get_type_hints(Plant)
    values: dict[str, Any] = {}
    for entry in fields(Plant):
        text = log.provenance.get(f"plant_{entry.name}")
        if text is None:
            continue
        try:
            values[entry.name] = hints[entry.name](text)
        except ValueError as error:
            raise ScenarioError(
                f"{log.name}: plant_{entry.name} = {text!r} in its provenance, expected a number"
            ) from error
    return Plant(**values)


def logged_specimen(log: JointLog) -> Specimen:
    """Return how the arm of the record deviates from its variant: what the log does not tell of does not.

    Raises:
        ScenarioError: What it tells is nothing that an arm could be.
    """
    known = {f"specimen_{entry.name}": entry.name for entry in fields(Specimen)}
    told = {key: text for key, text in log.provenance.items() if key.startswith("specimen_")}
    unknown = sorted(told.keys() - known.keys())
    if unknown:
        raise ScenarioError(f"{log.name}: {unknown[0]} in its provenance, expected one of {', '.join(known)}")
    try:
        return Specimen(**{known[key]: loads(text) for key, text in told.items()})
    except (JSONDecodeError, TwinError) as error:
        raise ScenarioError(f"{log.name}: its provenance tells of no specimen of the arm: {error}") from error


def check_truth(log: JointLog, arm: Arm, truth: Truth) -> None:
    """Refuse a truth that is not of a log's arm, conditions and pose; dry friction, which no truth knows, may differ.

    Args:
        log: The log.
        arm: Its arm, from `logged_arm`.
        truth: The truth.

    Raises:
        ScenarioError: It is of another arm, of other conditions, or of another pose.
    """
    given, logged = (vars(replace(plant.sliding, friction_level=1.0)) for plant in (truth.plant, arm.plant))
    pairs = {
        "variant": (truth.variant, arm.variant),
        "payload": (truth.payload, arm.payload),
        **{name: (given[name], logged[name]) for name in given},
        **{
            f"specimen_{entry.name}": (getattr(truth.specimen, entry.name), getattr(arm.specimen, entry.name))
            for entry in fields(Specimen)
            if entry.name != "dry_friction"
        },
    }
    wrong = [f"{name} = {of_truth}, not {of_log}" for name, (of_truth, of_log) in pairs.items() if of_truth != of_log]
    pose = log.provenance["pose"]
    if not np.allclose(truth.angles, arm.pose(pose), rtol=0.0, atol=1e-9):
        wrong.append(f"pose = {truth.pose}, not {pose}")
    if wrong:
        raise ScenarioError(f"{log.name}: a truth given of {'; '.join(wrong)}; expected that of the log's own arm")


def experiment_arm(experiment: Experiment, *, worksite: bool = False) -> Arm:
    """Return the arm of an experiment: its variant and payload, conditions, specimen and friction.

    Args:
        experiment: The experiment.
        worksite: Whether the arm stands at its worksite where the experiment says so; otherwise it is in free space.

    Raises:
        TwinError: The experiment asks for an arm that the laboratory does not have.
    """
    return load_arm(
        experiment.variant,
        experiment.payload,
        plant=experiment.plant,
        specimen=experiment.specimen,
        friction=experiment.chain.friction,
        worksite=worksite and bool(experiment.worksite),
    )
