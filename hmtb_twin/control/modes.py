"""Control modes: how stick motions become joint commands, within velocity limits and joint ranges."""

from typing import Protocol

import numpy as np

from hmtb_twin.arm.arm import Arm
from hmtb_twin.control.cartesian import Cartesian
from hmtb_twin.control.experiment import Experiment
from hmtb_twin.control.single_joint import SingleJoint
from hmtb_twin.control.status import Status
from hmtb_twin.parameters.errors import TwinError
from hmtb_twin.parameters.values import INDEXED_JOINTS, JOINTS, MOTIONS, SAMPLE_TIME, HandController

MODES = ("single_joint", "single_joint_rate", "cartesian", "cartesian_rate")
"""The control modes: a deflection is an offset (position mode) or a velocity (rate mode), of a joint or of the tool in
its own frame."""

TOOL_AXES = ("x", "y", "z", "roll", "pitch", "yaw")
"""Axes of the two three-axis hand controllers: translations along, rotations about x, y and z of the tool frame."""


class Mode(Protocol):
    """A control mode at work: it keeps the last command."""

    def step(self, deflection: np.ndarray) -> tuple[np.ndarray, Status]:
        """Return the next command (7,), rad, and what was limited, from deflections (n_axes,) in SI units."""
        ...

    def rebase(self, angles: np.ndarray, deflection: np.ndarray) -> tuple[np.ndarray, Status]:
        """Take over at measured angles (7,) without a bump; return the command (7,), rad, and what was limited."""
        ...


def joint_index(name: str) -> int:
    """Return a joint's place in `JOINTS`.

    Raises:
        TwinError: There is no such joint.
    """
    if not isinstance(name, str) or name not in JOINTS:
        raise TwinError(f"unknown joint {name!r}, available: {', '.join(JOINTS)}")
    return JOINTS.index(name)


def axis_names(mode: str) -> tuple[str, ...]:
    """Return what the stick can move in a mode.

    Raises:
        TwinError: There is no such mode.
    """
    if mode not in MODES:
        raise TwinError(f"unknown mode {mode!r}, available: {', '.join(MODES)}")
    if mode.startswith("cartesian"):
        return TOOL_AXES
    return tuple(name for name in JOINTS if name not in INDEXED_JOINTS)


def axis_gains(mode: str, axes: tuple[str, ...], parameters: HandController) -> np.ndarray:
    """Return what one volt of deflection asks for on each axis (n_axes,), in rad/V, m/V, rad/(s V) or m/(s V)."""
    rate = mode.endswith("rate")
    joint = parameters.rate_gain if rate else parameters.gain
    translation = parameters.translation_rate_gain if rate else parameters.translation_gain
    rotation = parameters.rotation_rate_gain if rate else parameters.rotation_gain
    gains = {"x": translation, "y": translation, "z": translation, "roll": rotation, "pitch": rotation, "yaw": rotation}
    return np.array([gains.get(name, joint) for name in axes])


def start_mode(experiment: Experiment, arm: Arm) -> Mode:
    """Return an experiment's control mode, its command at the experiment's pose.

    Args:
        experiment: Its pose, mode, axes and chain count.
        arm: The arm whose controller it is.

    Raises:
        TwinError: Unknown mode, or axes that the mode does not have.
    """
    known = axis_names(experiment.mode)
    axes = experiment.axes
    if not axes or len(set(axes)) != len(axes) or set(axes) - set(known):
        raise TwinError(
            f"{experiment.name}: axes {', '.join(axes) or 'none'} given, expected different ones of "
            f"{', '.join(known)} in mode {experiment.mode}"
            + ("; the shoulder roll is indexed" if set(axes) & set(INDEXED_JOINTS) else "")
        )
    pose = arm.pose(experiment.pose)
    lower = np.array([MOTIONS[name].lower for name in JOINTS])
    upper = np.array([MOTIONS[name].upper for name in JOINTS])
    step = arm.velocity_limits * SAMPLE_TIME if experiment.chain.velocity_limit else np.full(len(JOINTS), np.inf)
    dt = SAMPLE_TIME if experiment.mode.endswith("rate") else None
    if experiment.mode.startswith("cartesian"):
        directions = [TOOL_AXES.index(name) for name in axes]
        return Cartesian(arm.controller, pose, directions, lower, upper, step, dt)
    return SingleJoint(pose, [joint_index(name) for name in axes], lower, upper, step, dt)
