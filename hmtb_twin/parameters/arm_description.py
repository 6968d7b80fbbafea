"""Description of an arm: joints, drives, servos, bus, poses and payloads, whatever machine it is."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from math import inf

import numpy as np

from hmtb_twin.files.errors import TwinError, shown
from hmtb_twin.parameters.drives import Actuator, Drive
from hmtb_twin.parameters.payloads import OWN, OWN_FORM, Load, Payload, load_of
from hmtb_twin.parameters.quantity import Provenance
from hmtb_twin.parameters.servo_valve import POWER_UNIT, PowerUnit
from hmtb_twin.parameters.values import RECORDER, BusTerminal, Link, Motion, Recorder, Servo

LEAST_VOLUME = 1.2
"""Least trapped volume of an actuator over the volume that its joint sweeps: chambers, ports and lines."""

ROUNDING = 1e-9
"""Part by which two equal numbers may differ."""

EARTH = 9.81
"""Acceleration of gravity that the arm feels on the ground, m/s^2."""


@dataclass(frozen=True, eq=False)
class RigidModel:
    """Bodies of an arm as MJCF: its joints alone, a body `payload` at the tool, sites `tool` and `wrist_sensor`.

    Attributes:
        mjcf: The text. It has no geoms, actuators or keyframes, and its joints have no armature, damping or spring.
        picture: The file from which pictures of the arm are drawn; empty if it has no shapes.
        locked: Angles at which joints of that file are held that are none of the arm's, rad or m.
    """

    mjcf: str
    picture: str
    locked: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class ArmDescription:
    """One arm: everything in which it may differ from another one.

    Attributes:
        name: Its name.
        description: One line for lists.
        joints: Names of its joints from the base outward.
        motions: Range of each joint and velocity limit of its command.
        actuators: Drive of each joint.
        servos: Servo of each joint.
        bus: Bus terminal of each joint.
        poses: Joint angles of the keyframes, rad.
        operating_pose: The keyframe at which joints are excited and servos are tuned.
        payloads: Payloads of the end effector by name; None is an empty one.
        tuned_payload: The payload for which the servos are tuned, and the default one.
        gravity: Acceleration of gravity, m/s^2.
        links: Link that each joint moves, and the end effector, of an arm whose bodies are those of `hmtb.xml`; None of
            another machine.
        rigid: Bodies of another machine; None of an arm with `links`.
        servo: Servo law, "flow" or "torque"; a `Plant` may ask for the other one.
        indexed: Joints that a pin holds, which follow no command.
        studied: Joints on which linear models are compared with simulation; all when empty.
        sample_rate: Rate of the position loop and of the bus, Hz.
        power_unit: The pump that feeds hydraulic drives.
        recorder: Resolution and noise of the measured angles.
        given_gains: Gains kp, N m/rad, and kd, N m s/rad, of joints whose servos are given, not tuned.
        numbers: Numbers of the joints of an arm from files, each with its source: given, read, or assumed by a rule.
        remarks: What was done to the files that it was read from, one line each.
    """

    name: str
    description: str
    joints: tuple[str, ...]
    motions: Mapping[str, Motion]
    actuators: Mapping[str, Drive]
    servos: Mapping[str, Servo]
    bus: Mapping[str, BusTerminal]
    poses: Mapping[str, tuple[float, ...]]
    operating_pose: str
    payloads: Mapping[str, Payload | Load | None]
    tuned_payload: str
    gravity: float = EARTH
    links: Mapping[str, Link] | None = None
    rigid: RigidModel | None = None
    servo: str = "torque"
    indexed: tuple[str, ...] = ()
    studied: tuple[str, ...] = ()
    sample_rate: int = 50
    power_unit: PowerUnit = POWER_UNIT
    recorder: Recorder = RECORDER
    given_gains: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    numbers: tuple[Provenance, ...] = ()
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Raise `TwinError` for an arm that cannot be."""
        for kind in ("motions", "actuators", "servos", "bus"):
            missing = [joint for joint in self.joints if joint not in getattr(self, kind)]
            if missing:
                raise TwinError(f"{self.name}: no {kind} of {', '.join(missing)} given, expected one of each joint")
        # Servos are tuned at this pose: without it there is no arm.
        if self.operating_pose not in self.poses:
            raise TwinError(
                f"{self.name}: operating pose {self.operating_pose!r} given, available: {', '.join(self.poses)}"
            )
        self._check_hydraulics()
        self._check_friction()

    def _check_hydraulics(self) -> None:
        """Raise `TwinError` for chambers that are too small, or valves that starve each other."""
        hydraulic = {name: drive for name, drive in self.actuators.items() if isinstance(drive, Actuator)}
        for name, actuator in hydraulic.items():
            smallest = LEAST_VOLUME * actuator.displacement * (self.motions[name].upper - self.motions[name].lower)
            if actuator.trapped_volume < smallest:
                raise TwinError(
                    f"{self.name}: trapped volume {actuator.trapped_volume:g} cm3 of the {name.replace('_', ' ')} "
                    f"given, expected at least {smallest:.0f}: {LEAST_VOLUME:g} times what the joint sweeps over its "
                    "range"
                )
        # All joints at full speed must not starve each other: the pump feeds every valve at once.
        flow = sum(actuator.rated_flow for actuator in hydraulic.values())
        if flow > self.power_unit.largest_flow:
            raise TwinError(
                f"{self.name}: valves that pass {flow:.0f} cm3/s together given, expected at most the pump's "
                f"{self.power_unit.largest_flow:g}"
            )

    def _check_friction(self) -> None:
        """Raise `TwinError` for friction that would give energy to a joint."""
        for name, drive in self.actuators.items():
            friction = drive.friction
            if friction is None:
                continue
            # `Friction.bristles` would silently reduce the damping; a variant's own numbers must not need that.
            damping = friction.bristle_time * drive.bristle_torque / friction.presliding
            passive = drive.drag / (friction.static_ratio - 1.0) if friction.static_ratio > 1.0 else inf
            # A rule may set the damping to the limit itself: what is beyond it by rounding is at it.
            if damping > passive * (1.0 + ROUNDING):
                raise TwinError(
                    f"{self.name}: LuGre damping {damping:.3g} N m s/rad of the {name.replace('_', ' ')} given, "
                    f"expected at most {passive:.3g}: beyond, the friction is not passive"
                )

    def __repr__(self) -> str:
        """Name the arm and its joints, not its numbers."""
        return f"ArmDescription({self.name!r}, joints=({', '.join(self.joints)}), {self.description!r})"

    @cached_property
    def fingerprint(self) -> str:
        """Hash of everything that decides how the arm moves and what is recorded of it."""
        moving = ("joints", "motions", "actuators", "servos", "bus", "gravity", "links", "servo", "indexed")
        told = [getattr(self, name) for name in (*moving, "sample_rate", "power_unit", "recorder", "given_gains")]
        # Poses and payloads are named in a log, which has to find the same ones under these names.
        told += [self.poses, self.payloads, "" if self.rigid is None else self.rigid.mjcf]
        return sha256(repr(told).encode()).hexdigest()

    @property
    def sample_time(self) -> float:
        """Period of the position loop, s."""
        return 1.0 / self.sample_rate

    @property
    def assumed(self) -> tuple[Provenance, ...]:
        """Numbers that no file gave and a rule supplied."""
        return tuple(row for row in self.numbers if row.tag == "assumed")

    @property
    def compared(self) -> tuple[str, ...]:
        """Joints on which linear models are compared with simulation."""
        return self.studied or self.joints

    @property
    def free(self) -> tuple[str, ...]:
        """Joints that follow commands."""
        return tuple(joint for joint in self.joints if joint not in self.indexed)

    @cached_property
    def lower(self) -> np.ndarray:
        """Lower ends of the joint ranges (n,), rad."""
        return np.array([self.motions[joint].lower for joint in self.joints])

    @cached_property
    def upper(self) -> np.ndarray:
        """Upper ends of the joint ranges (n,), rad."""
        return np.array([self.motions[joint].upper for joint in self.joints])

    def held(self, payload: str) -> Payload | Load | None:
        """Return a payload of the arm by its name, or one of a user's own from its text (`Load.text`); None if empty.

        Raises:
            TwinError: It is neither.
        """
        if isinstance(payload, str) and payload.startswith(OWN):
            return load_of(payload)
        if not isinstance(payload, str) or payload not in self.payloads:
            raise TwinError(
                f"unknown payload {shown(payload)}, available: {', '.join(self.payloads)}; or one of your own, "
                f"{OWN_FORM}"
            )
        return self.payloads[payload]

    def joint_index(self, name: str) -> int:
        """Return the place of a joint; raises `TwinError` for an unknown one."""
        if not isinstance(name, str) or name not in self.joints:
            raise TwinError(f"unknown joint {shown(name)}, available: {', '.join(self.joints)}")
        return self.joints.index(name)
