"""Independence of the commands of several joints: whether a model of each response to each command is identifiable.

A common waveform in Cartesian mode turns one signal into the commands of several joints. They are then nearly multiples
of each other, and their effects on a joint cannot be separated.
"""

from dataclasses import dataclass, replace

import numpy as np

from hmtb_twin import Experiment
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.parameters.arm_description import ArmDescription
from scenarios.experiments.log_review import SETTLING
from sysid.validation.input_independence import LIMIT, InputIndependence, input_independence

LAGS = 8
"""Past samples that enter the models of the study: na + nb of the largest.

By this measure the tests lie far from `LIMIT` on either side, as docs/tests.md shows, if the wires are quiet: above 100
where the axes share a waveform, 3 where they have one each. Noise of the wires is an input of its own on each axis.
"""

STILL = 1e-9
"""Motion of a command up to which its joint stands still, rad: rounding of the kinematics."""


@dataclass(frozen=True)
class JointInputs(InputIndependence):
    """Independence of the commands of several joints, with the words of the laboratory for it.

    Attributes:
        advice: What would make them independent.
    """

    advice: str = "independent_channels helps"

    def summary(self) -> dict[str, object]:
        """Return all measures by name, for JSON."""
        return {
            "joints": self.names,
            "lags": self.lags,
            "condition": self.condition,
            "limit": LIMIT,
            "covariance_condition": self.covariance_condition,
            "orders": self.orders,
            "full_model": self.full,
            "block_diagonal_model": self.block_diagonal,
        }

    def warning(self) -> str | None:
        """Return one line if a full model cannot be identified, else None."""
        if self.full:
            return None
        subject = f"the commands of {', '.join(self.names)}"
        if not self.block_diagonal:
            orders = ", ".join(map(str, self.orders))
            return f"{subject} excite to the orders {orders}, expected {self.lags} for the models of the study"
        return (
            f"{subject} move together (condition {self.condition:.3g} between them, limit {LIMIT:g}): no full model of "
            f"several inputs can be identified, at best one of each joint by its own command; {self.advice}"
        )


def moved_joints(experiment: Experiment) -> tuple[str, ...]:
    """Return the joints that an experiment can identify: its axes, or in Cartesian mode the three of the thesis.

    The wrist moves too, to hold the orientation, but three translations move at most three joints independently; of
    another arm all joints are named.
    """
    # Axes of Cartesian modes are directions of the tool.
    if experiment.mode.startswith("cartesian"):
        return arm_named(experiment.variant).compared
    return tuple(experiment.axes)


def joint_inputs(commands: np.ndarray, joints: tuple[str, ...], arm: ArmDescription) -> JointInputs | None:
    """Measure how independently those of the joints that move are commanded.

    Args:
        commands: Commanded angles (N, n), rad.
        joints: The joints.
        arm: The arm.

    Returns:
        The measures; None if fewer than two joints move, or the record is too short.
    """
    moving = [joint for joint in joints if np.ptp(commands[:, arm.joint_index(joint)]) > STILL]
    columns = [arm.joint_index(joint) for joint in moving]
    measures = input_independence(commands[:, columns], moving, lags=LAGS)
    return None if measures is None else JointInputs(**vars(measures))


def _advice(experiment: Experiment, joints: tuple[str, ...]) -> str:
    """What would make the commands of an experiment independent."""
    if experiment.mode.startswith("cartesian") and len(experiment.axes) < len(joints):
        directions = f"{len(experiment.axes)} directions of the tool move {len(joints)} joints"
        return f"{directions}: a test that moves the joints themselves, as all-joints, tells them apart"
    if getattr(experiment, "independent_channels", False):
        return "signals that differ more between the axes help"
    return JointInputs.advice


def settled_inputs(commands: np.ndarray, experiment: Experiment) -> JointInputs | None:
    """Return `joint_inputs` of the settled part of the commands (N, 7), rad; None also with an operator."""
    if experiment.operator() is not None:
        return None
    arm = arm_named(experiment.variant)
    start = round(SETTLING * arm.sample_rate)
    if len(commands) > 2 * start:  # of shorter records too little would be left
        commands = commands[start:]
    joints = moved_joints(experiment)
    inputs = joint_inputs(commands, joints, arm)
    return None if inputs is None else replace(inputs, advice=_advice(experiment, joints))
