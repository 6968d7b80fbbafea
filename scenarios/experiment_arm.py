"""The arm that an experiment is run on."""

from hmtb_twin import Arm, Experiment, load_arm


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
