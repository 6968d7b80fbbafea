"""What experiments have in common that differ by chance alone: arm, joints, and what is played how strongly."""

from collections.abc import Hashable
from dataclasses import fields

from scenarios.datasets.plan import Entry
from scenarios.multisine_experiment import MultisineExperiment

CHANCE = ("seed", "realisations")
"""Parameters of an excitation that only chance is drawn by."""


def excitation_class(entry: Entry) -> Hashable:
    """What is played on which joints, how strongly, on which arm: equal for repeats and for twins.

    Args:
        entry: An experiment.
    """
    arm = entry.arm if entry.twin is None else entry.arm.partition("arm-")[2]
    return arm, entry.joints, tuple(entry.experiment.axes), _played(entry.experiment)


def _played(experiment: object) -> Hashable:
    if isinstance(experiment, MultisineExperiment):
        given = experiment.multisines
        return tuple((f.name, str(getattr(given, f.name))) for f in fields(given) if f.name not in CHANCE)
    return tuple(
        (
            one.kind,
            one.repeat_frequency,
            tuple(sorted((key, str(value)) for key, value in one.parameters.items() if key not in CHANCE)),
        )
        for one in getattr(experiment, "excitation", ())
    )
