"""The ground arm of a study: the one arm on which all its scenarios run, and the experiment that identifies it."""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from scenarios.control.campaign import controlled, identification_experiment
from scenarios.experiments.multisines import MultisineExperiment
from scenarios.experiments.scenario import Scenario, known_arm
from scenarios.files.errors import ScenarioError

Experiment = TypeVar("Experiment", Scenario, MultisineExperiment)

ARM_FIELDS = ("variant", "payload", "plant", "specimen", "pose", "chain")
"""Fields of an experiment that its identification shares: the arm, where it stands, and the laboratory's faults.

All others say how the arm is moved in a run, and belong to the run alone."""

UNIT_PAYLOAD = "rpcm"
"""Payload that stands for the replacement unit in free space."""


def with_options(experiment: Experiment, payload: str | None, friction_level: float | None) -> Experiment:
    """Return an experiment with what was asked for instead of its own.

    Args:
        experiment: The experiment.
        payload: Another payload; at the worksite the operator takes the unit, and the payload stays.
        friction_level: Dry friction in multiples of the nominal.
    """
    # The laboratory refuses other payloads at the worksite: its seats fit the unit alone.
    if payload is not None and not experiment.worksite:
        experiment = replace(experiment, payload=payload)
    if friction_level is not None:
        experiment = replace(experiment, plant=replace(experiment.plant, friction_level=friction_level))
    return experiment


def identification_of(
    experiments: Sequence[Scenario | MultisineExperiment], seed: int = 0, payload: str | None = None
) -> MultisineExperiment:
    """Return the experiment that identifies the arm of a study, in free space.

    Args:
        experiments: The experiments of the study, at least one.
        seed: Draws phases and noise.
        payload: Payload in place of the unit that the operator takes at the worksite.

    Raises:
        ScenarioError: The experiments run on different arms, or one moves a joint that is not under control.
    """
    for experiment in experiments:
        _check_joints(experiment)
    first = experiments[0]
    arm = _identified_arm(first, payload)
    # A design for one arm on another one is a stress test: nobody gets it unasked.
    for experiment in experiments[1:]:
        for name, value in _identified_arm(experiment, payload).items():
            if value != arm[name]:
                field, of_first, of_experiment = _difference(name, arm[name], value)
                raise ScenarioError(
                    f"{first.name} with {field} = {of_first} and {experiment.name} with {of_experiment} given, "
                    "expected one arm: control identifies one ground arm; run them one after the other"
                )
    # Excitation and hand controller stay those of the identification: a scenario's own need not move all joints.
    return replace(identification_experiment(arm["variant"], seed), **arm)


def on_arm_of(ground: MultisineExperiment, experiment: MultisineExperiment) -> MultisineExperiment:
    """Return an experiment on the arm that another one identifies."""
    return replace(experiment, **{name: getattr(ground, name) for name in ARM_FIELDS})


def _identified_arm(experiment: Scenario | MultisineExperiment, payload: str | None) -> dict[str, Any]:
    """Return the fields that describe the arm from which a controller for an experiment is designed."""
    arm = {name: getattr(experiment, name) for name in ARM_FIELDS}
    if experiment.worksite:
        # The operator takes the unit: the arm is identified with it.
        arm["payload"] = UNIT_PAYLOAD if payload is None else payload
    return arm


def _check_joints(experiment: Scenario | MultisineExperiment) -> None:
    """Raise `ScenarioError` if the stick moves a joint that is not under control; Cartesian modes move none."""
    # Axes of Cartesian modes are directions of the tool, whose kinematics hold the shoulder roll.
    joints = controlled(experiment.variant)
    for name in experiment.axes:
        if name in known_arm(experiment.variant).joints and name not in joints:
            raise ScenarioError(
                f"{experiment.name}: axes with {name} given, which is not under control; expected some of "
                f"{', '.join(joints)}"
            )


def _difference(name: str, first: object, second: object) -> tuple[str, object, object]:
    """Name and values of the first field in which two different values of a field differ, inside of records too."""
    # A plant of eight numbers in an error message hides the one that differs.
    if is_dataclass(first) and is_dataclass(second):
        for field in fields(first):
            of_first, of_second = getattr(first, field.name), getattr(second, field.name)
            if of_first != of_second:
                return _difference(f"{name}.{field.name}", of_first, of_second)
    return name, first, second
