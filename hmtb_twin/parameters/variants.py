"""The arms of the test bed, as the files of `models/hmtb` describe them: nominal, published, flight and released."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from hmtb_twin.files.errors import TwinError, shown
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.arm_toml import FILE_NAME, read_arm_toml
from hmtb_twin.parameters.chain_arm import chain_arm
from hmtb_twin.parameters.drives import Actuator
from hmtb_twin.parameters.payloads import Load, Payload
from hmtb_twin.parameters.quantity import Provenance
from hmtb_twin.parameters.resources import models_directory
from hmtb_twin.parameters.values import BusTerminal, Link, Motion, Servo

FILES = MappingProxyType(
    {"nominal": FILE_NAME, "published": "published.toml", "flight": "flight.toml", "released": "released.toml"}
)
"""Files of the arms by name, in `models/hmtb`."""


def _read() -> tuple[dict[str, ArmDescription], dict[str, tuple[Provenance, ...]]]:
    """Read the arms, and apart from them their numbers with sources: those have a table of their own."""
    arms, numbers = {}, {}
    for name, file in FILES.items():
        # Truth files and data sheets of these arms point to that table, not to rows of their own.
        arm = chain_arm(name, read_arm_toml(models_directory() / "hmtb" / file))
        arms[name], numbers[name] = replace(arm, numbers=()), arm.numbers
    return arms, numbers


_ARMS, _NUMBERS = _read()

VARIANTS: Mapping[str, ArmDescription] = MappingProxyType(_ARMS)
"""All arms of the test bed by name."""

NUMBERS: Mapping[str, tuple[Provenance, ...]] = MappingProxyType(_NUMBERS)
"""Their numbers with units, tags and sources."""

NOMINAL = VARIANTS["nominal"]
"""The arm whose links, drives and servos the others share but for what their files say."""

JOINTS = NOMINAL.joints
"""The seven joints from the base outward."""

INDEXED_JOINTS = NOMINAL.indexed
"""Joints held by a pin at an index position [Morris1996, I.2]; a variant may release them."""

STUDIED_JOINTS = NOMINAL.studied
"""The three joints that the thesis identified."""

OPERATING_POSE = NOMINAL.operating_pose
"""Keyframe at which the joints are excited and the servos are tuned."""

POSES: Mapping[str, tuple[float, ...]] = NOMINAL.poses
"""Joint angles of the keyframes, rad; assumed. The shoulder roll stands at its index position."""

LINKS: Mapping[str, Link] = dict(NOMINAL.links or {})
"""The link that each joint moves; the end effector is fixed to the wrist roll flange behind the force/torque sensor."""

MOTIONS: Mapping[str, Motion] = NOMINAL.motions
"""Range and velocity limit of each joint."""

SERVOS: Mapping[str, Servo] = NOMINAL.servos
"""The servo of each joint. Outer joints are damped more, so that the coupled arm keeps real dominant poles."""

BUS: Mapping[str, BusTerminal] = NOMINAL.bus
"""Bus delay of each measured angle; the analyst identifies nk = 2 on yaw, 1 on shoulder pitch, 2 on elbow."""

ACTUATORS: Mapping[str, Actuator] = {
    joint: drive for joint, drive in NOMINAL.actuators.items() if isinstance(drive, Actuator)
}
"""The actuator of each joint."""

PAYLOADS: Mapping[str, Payload | Load | None] = NOMINAL.payloads
"""Payloads of the end effector by name."""


def joint_index(name: str) -> int:
    """Return the index of a joint in `JOINTS`; raises `TwinError` for an unknown joint."""
    if not isinstance(name, str) or name not in JOINTS:
        raise TwinError(f"unknown joint {shown(name)}, available: {', '.join(JOINTS)}")
    return JOINTS.index(name)
