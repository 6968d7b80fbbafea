"""Links, payload and gravity of an arm, written into the nominal MJCF for MuJoCo and for the controller."""

from collections.abc import Iterator
from xml.etree import ElementTree

import mujoco
import numpy as np

from hmtb_twin.arm_files.rigid_arm import PAYLOAD_BODY
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.payloads import Load, Payload
from hmtb_twin.parameters.resources import model_file
from hmtb_twin.parameters.specimen import LINK_NAMES, NOMINAL_SPECIMEN, Specimen
from hmtb_twin.parameters.values import Link
from hmtb_twin.parameters.variants import JOINTS, LINKS, PAYLOADS

COLLISION_GROUP = 3
"""Group of the shapes that only collide."""

UNIT = "rpcm"
"""Name of the payload's body."""

SMALLEST_SHAPE = 0.01
"""Least half side of the box that is drawn for a payload, m: a point mass has none."""

BODIES = dict(
    zip(
        (*JOINTS, "end_effector"),
        (
            "shoulder_roll_link",
            "shoulder_yaw_link",
            "upper_arm",
            "forearm",
            "wrist_pitch_link",
            "wrist_yaw_link",
            "wrist_roll_link",
            "end_effector",
        ),
        strict=True,
    )
)
"""The body that is each link."""


def spec_of_test_bed(name: str) -> mujoco.MjSpec:
    """Return a model file of the test bed as the laboratory builds on it.

    The file serves viewers and other tools, too: shapes that collide, a pin as a constraint, keyframes of its own
    drives. The laboratory has its own pin, drives and contact, and needs none of them.

    Args:
        name: Name of the file in `models/hmtb`.
    """
    spec = mujoco.MjSpec.from_file(str(model_file(f"hmtb/{name}")))
    for key in list(spec.keys):
        spec.delete(key)
    # Its pin would hold an arm whose shoulder roll is released, too.
    for constraint in list(spec.equalities):
        spec.delete(constraint)
    for pair in list(spec.excludes):
        spec.delete(pair)
    # Pictures show the others, and contact at the worksite has shapes of its own.
    for shape in list(spec.geoms):
        if shape.group == COLLISION_GROUP:
            spec.delete(shape)
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    return spec


def write_bodies(
    spec: mujoco.MjSpec, variant: ArmDescription, payload: str, specimen: Specimen = NOMINAL_SPECIMEN
) -> None:
    """Write gravity, links and payload into a MuJoCo model that holds the RPCM.

    Args:
        spec: The model of `hmtb.xml` or of a scene around it.
        variant: The arm; entries equal to the nominal arm's stay untouched.
        payload: A payload of the arm, or the text of one.
        specimen: Deviations of links and payload.
    """
    spec.option.gravity = [0.0, 0.0, -variant.gravity]
    held = variant.held(payload)
    if variant.rigid is not None:
        if isinstance(held, Load):
            _load(spec.body(PAYLOAD_BODY), held, specimen.payload_mass)
        return
    for name, link in _other_links(variant):
        body = spec.body(BODIES[name])
        body.mass, body.inertia = link.mass, [link.axial_inertia, link.transverse_inertia, link.transverse_inertia]
    if held is None:
        # The body stays, without mass: MuJoCo changes a simulation's model only for one of equal size.
        empty = spec.body(UNIT)
        empty.mass, empty.inertia = 0.0, [0.0, 0.0, 0.0]
        for shape in list(empty.geoms):
            spec.delete(shape)
    elif isinstance(held, Load):
        # A specimen's factor follows below, as with every payload.
        _load(spec.body(UNIT), held, 1.0)
        _draw_load(spec.body(UNIT), held)
    elif held != PAYLOADS["rpcm"]:
        unit = spec.body(UNIT)
        x, y, z = held.size
        unit.mass, unit.inertia, unit.ipos = held.mass, list(held.inertia), [x / 2, 0.0, 0.0]
        box, marking = unit.geoms[:2]
        box.pos, box.size = [x / 2, 0.0, 0.0], [x / 2, y / 2, z / 2]
        marking.pos, marking.size = [x / 2, 0.0, z / 2], [0.275 * x, 0.3 * y, 0.002]
    _deviate(spec, specimen, held=held is not None)


def _load(body: mujoco.MjsBody, held: Load, factor: float) -> None:
    """Write a payload of any shape, its mass and inertia by a factor, into a body in the frame of the tool."""
    moments, axes = held.principal
    body.mass, body.ipos, body.inertia = factor * held.mass, list(held.centre), list(factor * moments)
    mujoco.mju_mat2Quat(body.iquat, np.ascontiguousarray(axes).ravel())
    body.explicitinertial = True


def _draw_load(body: mujoco.MjsBody, held: Load) -> None:
    """Give the shapes of the unit the size of the uniform box that has the mass and inertia of a payload."""
    moments, axes = held.principal
    # Of a box with the sides a, b and c: Ixx = m (b^2 + c^2) / 12, and so on.
    squares = 6.0 * (moments.sum() - 2.0 * moments) / held.mass
    half = np.maximum(np.sqrt(np.maximum(squares, 0.0)) / 2.0, SMALLEST_SHAPE)
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(axes).ravel())
    box, marking = body.geoms[:2]
    box.pos, box.size, box.quat = list(held.centre), list(half), quaternion
    marking.pos, marking.size, marking.quat = list(held.centre), list(half / 2.0), quaternion


def _deviate(spec: mujoco.MjSpec, specimen: Specimen, *, held: bool) -> None:
    """Write the deviating bodies of a specimen; all others keep their bits."""
    names = specimen.deviating
    if names:
        links = [spec.body(BODIES[name]) for name in LINK_NAMES]
        masses, centres, inertias = specimen.bodies(
            np.array([link.mass for link in links]),
            np.array([link.ipos for link in links]),
            np.array([link.inertia for link in links]),
        )
        moments, axes = np.linalg.eigh(inertias)
        # Eigenvectors may be left-handed, which no quaternion is.
        axes[np.linalg.det(axes) < 0.0, :, 0] *= -1.0
        for i in map(LINK_NAMES.index, names):
            links[i].mass, links[i].ipos = masses[i], centres[i]
            if not inertias[i][np.triu_indices(3, 1)].any():
                # The principal axes are still those of the body.
                links[i].inertia = np.diag(inertias[i])
                continue
            links[i].inertia = moments[i]
            mujoco.mju_mat2Quat(links[i].iquat, axes[i].ravel())
    if held and specimen.payload_mass != 1.0:
        unit = spec.body(UNIT)
        unit.mass, unit.inertia = specimen.payload_mass * unit.mass, specimen.payload_mass * unit.inertia


def write_controller_bodies(root: ElementTree.Element, variant: ArmDescription, payload: str) -> None:
    """Write links, payload and rotor inertias of an arm into the tree of its MJCF for the controller's model."""
    bodies = {str(body.get("name")): body for body in root.iter("body")}
    for joint in root.iter("joint"):
        # Defaults and the pin are <joint> too.
        if joint.get("name") in variant.joints:
            joint.set("armature", repr(variant.actuators[str(joint.get("name"))].motor.armature))
    held = variant.held(payload)
    if variant.rigid is not None:
        if isinstance(held, Load):
            _write_load(bodies[PAYLOAD_BODY], held)
        return
    for name, link in _other_links(variant):
        _write_inertia(bodies[BODIES[name]], link.mass, link.length / 2, link)
    if held is None:
        bodies["end_effector"].remove(bodies[UNIT])
    elif isinstance(held, Load):
        _write_load(bodies[UNIT], held)
    elif held != PAYLOADS["rpcm"]:
        _write_inertia(bodies[UNIT], held.mass, held.size[0] / 2, held)


def _other_links(variant: ArmDescription) -> Iterator[tuple[str, Link]]:
    """Yield the links that are not the nominal arm's."""
    for name, link in (variant.links or LINKS).items():
        if link != LINKS[name]:
            yield name, link


def _write_load(body: ElementTree.Element, held: Load) -> None:
    moments, axes = held.principal
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(axes).ravel())
    inertial = _inertial(body)
    inertial.set("mass", repr(held.mass))
    for key, values in (("pos", held.centre), ("quat", quaternion), ("diaginertia", moments)):
        inertial.set(key, " ".join(repr(float(value)) for value in values))


def _inertial(body: ElementTree.Element) -> ElementTree.Element:
    inertial = body.find("inertial")
    if inertial is None:
        raise ValueError(f"body {body.get('name')!r} of the MJCF has no <inertial>")
    return inertial


def _write_inertia(body: ElementTree.Element, mass: float, centre: float, shape: Link | Payload) -> None:
    if isinstance(shape, Payload):
        moments = shape.inertia
    else:
        moments = (shape.axial_inertia, shape.transverse_inertia, shape.transverse_inertia)
    inertial = _inertial(body)
    # All digits: the controller must know exactly the bodies that MuJoCo simulates.
    inertial.set("mass", repr(mass))
    inertial.set("pos", f"{centre!r} 0 0")
    inertial.set("diaginertia", " ".join(map(repr, moments)))
