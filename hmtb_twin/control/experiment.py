"""Experiment, operator and status: the interface between the laboratory and whoever plans an experiment."""

from dataclasses import dataclass
from enum import IntFlag
from typing import Protocol

import numpy as np

from hmtb_twin.parameters.plant import Plant
from hmtb_twin.parameters.specimen import Specimen
from hmtb_twin.parameters.values import HandController


@dataclass(frozen=True)
class Chain:
    """Imperfections of the laboratory; each can be switched off separately.

    Attributes:
        dac: The excitation computer's converter rounds.
        noise: The wires pick up noise and hum.
        bias: The hand controller's axes have offsets.
        adc: The hand controller's converter rounds.
        logged_noise: The command in the record has noise that the arm does not feel.
        hold: Its processor holds each sample for `HandController.hold` ticks.
        velocity_limit: Joint commands move no faster than their limits.
        friction: The seals have dry friction; the oil's drag is always there.
        resolver: The resolvers round and have noise.
    """

    dac: bool = True
    noise: bool = True
    bias: bool = True
    logged_noise: bool = True
    adc: bool = True
    hold: bool = True
    velocity_limit: bool = True
    friction: bool = True
    resolver: bool = True


IDEAL = Chain(
    dac=False,
    noise=False,
    bias=False,
    logged_noise=False,
    adc=False,
    hold=False,
    velocity_limit=False,
    friction=False,
    resolver=False,
)
"""All imperfections switched off; converters still saturate and joints keep their ranges."""


class Status(IntFlag):
    """Status flags of one tick; 0 is normal operation.

    Attributes:
        VELOCITY_LIMITED: A joint's command moved at its velocity limit.
        JOINT_LIMITED: A joint's command stood at an end of its range.
        SINGULAR: The step was damped near a singular pose, and the tool lags.
        CONVERTER_SATURATED: A hand-controller count stood at an end of the converter's range.
        SHUT_DOWN: Emergency shutdown: servo power off, valves closed.
        UNIT_HELD: The end effector holds the orbital replacement unit.
    """

    VELOCITY_LIMITED = 1
    JOINT_LIMITED = 2
    SINGULAR = 4
    CONVERTER_SATURATED = 8
    SHUT_DOWN = 16
    UNIT_HELD = 32


@dataclass(frozen=True)
class UnitView:
    """View of the replacement unit by the cameras.

    Attributes:
        position: Its grip, the tool point when it is held, in the world (3,), m.
        rotation: Its frame, the tool frame when it is held, in the world (3, 3).
        held: Whether the end effector holds it.
    """

    position: np.ndarray
    rotation: np.ndarray
    held: bool


@dataclass(frozen=True)
class View:
    """View of an operator at the control station at a tick: cameras and displays, without human delay or error.

    Attributes:
        time: Since the start of the experiment, s.
        tool_position: Tool point in the world (3,), m.
        tool_rotation: Tool frame in the world (3, 3).
        wrench: Wrist force and torque (6,), N and N m.
        unit: The replacement unit; None in free space.
    """

    time: float
    tool_position: np.ndarray
    tool_rotation: np.ndarray
    wrench: np.ndarray
    unit: UnitView | None = None


@dataclass(frozen=True)
class Motion:
    """Stick and grip motion of an operator at a tick.

    Attributes:
        volts: Stick voltage of each axis of the experiment (n_axes,), V.
        grip: Whether the end effector is closed; at the worksite, closing about the unit's fitting takes hold of it.
    """

    volts: np.ndarray
    grip: bool = True


class Operator(Protocol):
    """Whoever moves the hand controller; one operator serves one experiment from its first tick to its last."""

    def move(self, view: View) -> Motion:
        """Return the stick motion of a tick; called 50 times a second.

        Args:
            view: The operator's view at this tick, in the world frame.

        Returns:
            Volts in the order of the experiment's axes. Positive moves a joint up its angle, or the tool along or
            about its own axis, by `axis_gains` per volt: an offset in the position modes, a velocity in the rate modes.
            `grip` matters at the worksite only.
        """
        ...


@dataclass(frozen=True)
class PayloadChange:
    """Exchange of the payload in free space: the new load acts from one tick to the next, where the old one was.

    The arm keeps its angles, velocities and oil pressures, so that the joints sag or rise until the pressures carry the
    new weight. The controller knows the payload from the same tick on and feeds its weight forward.

    Attributes:
        time: Since the start of the experiment, s.
        payload: The new payload, one of `PAYLOADS`.
    """

    time: float
    payload: str


class JointController(Protocol):
    """Controller between the operator and the position loop; one serves one experiment from its first tick to its last.

    It works at 50 Hz and sees what the bus carries: resolver readings, late by the bus delay of each joint.
    """

    def restart(self, command: np.ndarray) -> None:
        """Begin at rest under a command (7,), rad: before the first tick, and while and after the servos lack power."""
        ...

    def command(self, requested: np.ndarray, measured: np.ndarray, sent: np.ndarray) -> np.ndarray:
        """Return the joint command of a tick, before velocity limits and joint ranges.

        Args:
            requested: The joint command that the operator's control mode asks for (7,), rad.
            measured: The measured angles of this tick as the bus records them (7,), rad.
            sent: The command of the tick before, within all limits, as the arm feels it (7,), rad.

        Returns:
            Command (7,), rad.
        """
        ...


class Experiment(Protocol):
    """One experiment on the arm; any object with these attributes will do.

    A method `controller()` that returns a new `JointController`, or None, may be added.

    Attributes:
        name: Name of its log, or of its failure.
        variant: Arm variant.
        payload: Payload of the end effector.
        plant: Supply, oil, friction and noise of the drives.
        specimen: Deviations of this arm from its variant.
        pose: Keyframe at which the arm rests before the experiment and about which it is excited.
        worksite: Whether the arm works at the worksite, with contact, instead of in free space.
        mode: Control mode, one of `MODES`.
        axes: Axes that the stick moves: joints in the single-joint modes, tool directions in the Cartesian modes.
        seed: Seed of every random draw of the laboratory.
        duration: Length, s.
        chain: Imperfections that are switched on.
        hand_controller: The hand-controller interface.
        shutdown: Emergency shutdowns: times of power off and power on, alternating, s.
        payload_changes: Exchanges of the payload in their order; in free space alone.
    """

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def variant(self) -> str: ...  # noqa: D102
    @property
    def payload(self) -> str: ...  # noqa: D102
    @property
    def plant(self) -> Plant: ...  # noqa: D102
    @property
    def specimen(self) -> Specimen: ...  # noqa: D102
    @property
    def pose(self) -> str: ...  # noqa: D102
    @property
    def worksite(self) -> bool: ...  # noqa: D102
    @property
    def mode(self) -> str: ...  # noqa: D102
    @property
    def axes(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def seed(self) -> int: ...  # noqa: D102
    @property
    def duration(self) -> float: ...  # noqa: D102
    @property
    def chain(self) -> Chain: ...  # noqa: D102
    @property
    def hand_controller(self) -> HandController: ...  # noqa: D102
    @property
    def shutdown(self) -> tuple[float, ...]: ...  # noqa: D102
    @property
    def payload_changes(self) -> tuple[PayloadChange, ...]: ...  # noqa: D102

    def volts(self) -> np.ndarray:
        """Return the excitation computer's output, (N, n_axes) V at 50 Hz with N = 50 duration."""
        ...

    def operator(self) -> Operator | None:
        """Return a new operator who replaces the excitation computer, or None."""
        ...
