"""Arms that have the chain of the test bed, from their settings alone."""

from dataclasses import fields
from typing import Any

from hmtb_twin.files.errors import TwinError, shown
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.arm_toml import LINK_UNITS, PAYLOAD_UNITS, ArmSettings, ResolverSettings
from hmtb_twin.parameters.payloads import Load, Payload
from hmtb_twin.parameters.quantity import Provenance
from hmtb_twin.parameters.rules import check_pose, joint_records, recorder
from hmtb_twin.parameters.values import Link

MODEL = "hmtb.xml"
"""The model file with the joints, axes and lengths of the chain."""

END = "end_effector"
"""The last link, which no joint moves."""

NO_MEANING = ("tool", "locked")
"""Settings that have no meaning for an arm of this chain."""


def chain_arm(name: str, settings: ArmSettings) -> ArmDescription:
    """Describe an arm whose bodies are those of `hmtb.xml`, with links of its own.

    Args:
        name: Name of the arm.
        settings: What is said of it; it has a link for each joint, and one for the end effector.

    Raises:
        TwinError: The settings are incomplete, or wrong for this chain.
    """
    _check_chain(settings)
    joints = settings.joints
    # The model file tells nothing of drives and ranges, and weighing would take MuJoCo: every torque is given.
    records = joint_records(settings, {joint: {} for joint in joints}, None)
    for pose, angles in settings.poses.items():
        check_pose(pose, angles, records.motions)
    resolvers, of_resolvers = recorder(settings.resolver)
    # Those of the test bed have rows of their own in its table.
    told = of_resolvers if settings.resolver != ResolverSettings() else ()
    # Without a word of it, gravity is that of the ground.
    optional: dict[str, Any] = {} if settings.gravity is None else {"gravity": settings.gravity}
    return ArmDescription(
        name=name,
        description=settings.title,
        joints=joints,
        motions=records.motions,
        actuators=records.drives,
        servos=records.servos,
        bus=records.bus,
        poses=settings.poses,
        operating_pose=settings.operating_pose,
        payloads=_payloads(settings),
        tuned_payload=settings.tuned_payload or "none",
        links=_links(settings),
        servo=settings.servo or "torque",
        indexed=settings.indexed,
        studied=settings.studied,
        sample_rate=settings.sample_rate,
        recorder=resolvers,
        given_gains=records.given_gains,
        numbers=(*_of_links(settings), *records.numbers, *told, *_of_payloads(settings)),
        **optional,
    )


def _check_chain(settings: ArmSettings) -> None:
    """Raise `TwinError` for settings that this chain cannot have."""
    # What would be ignored is refused.
    for key in NO_MEANING:
        if getattr(settings, key):
            raise TwinError(f"{key} = {shown(getattr(settings, key))} given with links, which have {MODEL} as model")
    joints = settings.joints
    if not joints or tuple(settings.link) != (*joints, END):
        raise TwinError(
            f"links {', '.join(settings.link)} given, expected those of {', '.join((*joints, END))}: one of each joint "
            "in joints, in this sequence, and the end effector's"
        )
    for key in ("indexed", "studied"):
        unknown = [joint for joint in getattr(settings, key) if joint not in joints]
        if unknown:
            raise TwinError(f"{key}: {', '.join(unknown)} given, available: {', '.join(joints)}")


def _links(settings: ArmSettings) -> dict[str, Link]:
    links = {}
    for name, link in settings.link.items():
        links[name] = Link(link.length.value, link.mass.value, link.radius.value)
    return links


def _payloads(settings: ArmSettings) -> dict[str, Payload | Load | None]:
    """Payloads by name: the one for which servos are tuned, none at all, and the others."""
    payloads: dict[str, Payload | Load | None] = {}
    for name, load in settings.payloads.items():
        x, y, z = load.size or (0.0, 0.0, 0.0)
        payloads[name] = Payload(load.mass, (x, y, z)) if load.size else Load(load.mass, load.centre, load.inertia)
    tuned = settings.tuned_payload or "none"
    if tuned not in ("none", *payloads):
        raise TwinError(f"tuned_payload = {shown(tuned)} given, available: {', '.join(('none', *payloads))}")
    # Lists and messages name the usual one first.
    first = {tuned: payloads[tuned]} if tuned in payloads else {}
    return {**first, "none": None, **payloads}


def _of_links(settings: ArmSettings) -> list[Provenance]:
    """Numbers of the links, each with its source."""
    rows = []
    for name, link in settings.link.items():
        for entry in fields(link):
            given = getattr(link, entry.name)
            unit = LINK_UNITS[entry.name]
            rows.append(Provenance(f"link {name}", entry.name, given.value, unit, given.tag, given.source))
    return rows


def _of_payloads(settings: ArmSettings) -> list[Provenance]:
    """Mass and size of the payloads, each with its source."""
    rows = []
    for name, load in settings.payloads.items():
        for key, source in load.sources.items():
            value = getattr(load, key)
            rows.append(Provenance(f"payload {name}", key, value, PAYLOAD_UNITS[key], source.tag, source.source))
    return rows
