"""The arm that an experiment is run on."""

from hmtb_twin import Arm, Experiment, load_arm


def experiment_arm(experiment: Experiment) -> Arm:
    """Return the arm of an experiment in free space: its variant and payload, conditions, specimen and friction.

    Raises:
        TwinError: The experiment asks for an arm that the laboratory does not have.
    """
    return load_arm(
        experiment.variant,
        experiment.payload,
        plant=experiment.plant,
        specimen=experiment.specimen,
        friction=experiment.chain.friction,
    )
