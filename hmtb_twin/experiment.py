"""What the laboratory needs to know of an experiment before it can run it."""

from typing import Protocol

import numpy as np


class Experiment(Protocol):
    """One experiment on the arm; any object with these attributes will do.

    Attributes:
        name: Name under which its log, or its failure, is reported.
        variant: Arm variant.
        payload: What the end effector holds.
        pose: Keyframe at which the arm rests before the experiment and about which it is excited.
        mode: Control mode; `single_joint` moves the excited joints and holds the others.
        axes: The excited joints.
        seed: Seed of every random draw of the laboratory.
        duration: Length, s.
        friction: Whether the seals rub.
        noise: Whether hand-controller noise and bias and resolver noise act.
        quantisation: Whether the converters round.
    """

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def variant(self) -> str: ...  # noqa: D102
    @property
    def payload(self) -> str: ...  # noqa: D102
    @property
    def pose(self) -> str: ...  # noqa: D102
    @property
    def mode(self) -> str: ...  # noqa: D102
    @property
    def axes(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def seed(self) -> int: ...  # noqa: D102
    @property
    def duration(self) -> float: ...  # noqa: D102
    @property
    def friction(self) -> bool: ...  # noqa: D102
    @property
    def noise(self) -> bool: ...  # noqa: D102
    @property
    def quantisation(self) -> bool: ...  # noqa: D102

    def volts(self) -> np.ndarray:
        """Return the excitation computer's output, (N, n_axes) V at 50 Hz with N = 50 duration."""
        ...
