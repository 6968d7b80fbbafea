"""The test bed's arm as URDF, made from its MJCF: links, joints, limits, and shapes as primitives.

Run as a module it writes `models/hmtb/hmtb.urdf`. A URDF has neither drives nor sites: rotor inertias, hydraulics and
keyframes stay in the MJCF; the tool is a link of its own without mass.
"""

import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from hmtb_twin.arm.rigid_bodies import COLLISION_GROUP
from hmtb_twin.arm_files.rigid_arm import TOOL_SITE
from hmtb_twin.files.atomic_write import write_whole
from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.resources import model_file
from hmtb_twin.parameters.variants import VARIANTS

BASE = "base"
"""Link that stands on the ground."""

DIGITS = 12
"""Significant digits of every number: inertias agree with those of the MJCF to the last of them."""

PLACE = "hmtb/hmtb.urdf"
"""Where the file lies below the folder `models`."""


def urdf_text(model: mujoco.MjModel, arm: ArmDescription) -> str:
    """Return an arm as URDF.

    Args:
        model: The bodies and shapes, of a serial chain of hinges at the origins of their bodies.
        arm: Range, velocity limit, largest torque and friction of each joint.

    Raises:
        TwinError: A joint that is no hinge, or not at the origin of its body, or a shape that URDF does not have.
    """
    robot = ElementTree.Element("robot", name=arm.name if arm.name not in VARIANTS else "hmtb")
    for body in range(model.nbody):
        _add_link(robot, model, body)
        if body:
            _add_joint(robot, model, body, arm)
    tool = model.site(TOOL_SITE).id
    ElementTree.SubElement(robot, "link", name=TOOL_SITE)
    fixed = ElementTree.SubElement(robot, "joint", name=f"{TOOL_SITE}_fixture", type="fixed")
    ElementTree.SubElement(fixed, "parent", link=_link(model, int(model.site_bodyid[tool])))
    ElementTree.SubElement(fixed, "child", link=TOOL_SITE)
    _add_origin(fixed, model.site_pos[tool], model.site_quat[tool])
    ElementTree.indent(robot)
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(robot, encoding="unicode")}\n'


def _link(model: mujoco.MjModel, body: int) -> str:
    return str(model.body(body).name) if body else BASE


def _add_link(robot: ElementTree.Element, model: mujoco.MjModel, body: int) -> None:
    """Add the link of a body, with its inertia and its shapes."""
    link = ElementTree.SubElement(robot, "link", name=_link(model, body))
    if body:
        inertial = ElementTree.SubElement(link, "inertial")
        _add_origin(inertial, model.body_ipos[body], model.body_iquat[body])
        ElementTree.SubElement(inertial, "mass", value=_number(model.body_mass[body]))
        moments = dict(zip(("ixx", "iyy", "izz"), map(_number, model.body_inertia[body]), strict=True))
        ElementTree.SubElement(inertial, "inertia", {**moments, "ixy": "0", "ixz": "0", "iyz": "0"})
    first = int(model.body_geomadr[body])
    for geom in range(first, first + int(model.body_geomnum[body])):
        use = "collision" if model.geom_group[geom] == COLLISION_GROUP else "visual"
        for position, quaternion, tag, size in _shapes(model, geom):
            part = ElementTree.SubElement(link, use)
            _add_origin(part, position, quaternion)
            ElementTree.SubElement(ElementTree.SubElement(part, "geometry"), tag, size)
            if use == "visual":
                _add_colour(part, model, geom)


def _add_joint(robot: ElementTree.Element, model: mujoco.MjModel, body: int, arm: ArmDescription) -> None:
    """Add the joint by which a body hangs on its parent."""
    moves = int(model.body_jntnum[body])
    number = int(model.body_jntadr[body])
    if moves > 1 or (moves and model.jnt_type[number] != mujoco.mjtJoint.mjJNT_HINGE):
        raise TwinError(f"body {_link(model, body)} with other joints than one hinge given, expected a chain of hinges")
    name = str(model.joint(number).name) if moves else f"{_link(model, body)}_fixture"
    joint = ElementTree.SubElement(robot, "joint", name=name, type="revolute" if moves else "fixed")
    ElementTree.SubElement(joint, "parent", link=_link(model, int(model.body_parentid[body])))
    ElementTree.SubElement(joint, "child", link=_link(model, body))
    _add_origin(joint, model.body_pos[body], model.body_quat[body])
    if not moves:
        return
    if model.jnt_pos[number].any():
        raise TwinError(f"joint {name} beside the origin of its body given, expected it there, as URDF has it")
    ElementTree.SubElement(joint, "axis", xyz=_numbers(model.jnt_axis[number]))
    motion, drive = arm.motions[name], arm.actuators[name]
    limits = {
        "lower": _number(motion.lower),
        "upper": _number(motion.upper),
        "velocity": _number(motion.velocity_limit),
        "effort": _number(drive.motor.maximum_torque),
    }
    ElementTree.SubElement(joint, "limit", limits)
    friction = {"damping": _number(drive.drag), "friction": _number(drive.coulomb_torque)}
    ElementTree.SubElement(joint, "dynamics", friction)


def _shapes(model: mujoco.MjModel, geom: int) -> Iterator[tuple[np.ndarray, np.ndarray, str, dict[str, str]]]:
    """Yield the primitives of a shape: position, quaternion, element and its sizes; a capsule is three of them."""
    shape, size = mujoco.mjtGeom(model.geom_type[geom]), model.geom_size[geom]
    position, quaternion = model.geom_pos[geom], model.geom_quat[geom]
    if shape == mujoco.mjtGeom.mjGEOM_BOX:
        yield position, quaternion, "box", {"size": _numbers(2.0 * size)}
    elif shape == mujoco.mjtGeom.mjGEOM_SPHERE:
        yield position, quaternion, "sphere", {"radius": _number(size[0])}
    elif shape in (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE):
        yield position, quaternion, "cylinder", {"radius": _number(size[0]), "length": _number(2.0 * size[1])}
        if shape == mujoco.mjtGeom.mjGEOM_CAPSULE:
            along = np.empty(3)
            mujoco.mju_rotVecQuat(along, np.array([0.0, 0.0, size[1]]), quaternion)
            for end in (position + along, position - along):
                yield end, quaternion, "sphere", {"radius": _number(size[0])}
    else:
        raise TwinError(f"a shape of type {shape.name} given, expected a box, sphere, cylinder or capsule")


def _add_colour(part: ElementTree.Element, model: mujoco.MjModel, geom: int) -> None:
    number = int(model.geom_matid[geom])
    rgba = model.mat_rgba[number] if number >= 0 else model.geom_rgba[geom]
    name = str(model.material(number).name) if number >= 0 else f"colour_{geom}"
    material = ElementTree.SubElement(part, "material", name=name)
    ElementTree.SubElement(material, "color", rgba=" ".join(f"{value:.4g}" for value in rgba))


def _add_origin(element: ElementTree.Element, position: np.ndarray, quaternion: np.ndarray) -> None:
    """Add a pose; MuJoCo's quaternions have the scalar first, URDF turns about the fixed x, y and z axes in turn."""
    with warnings.catch_warnings():
        # At a pitch of a quarter turn roll and yaw are one: SciPy warns, and sets one of them to zero.
        warnings.simplefilter("ignore", UserWarning)
        turn = Rotation.from_quat(np.roll(quaternion, -1)).as_euler("xyz")
    ElementTree.SubElement(element, "origin", xyz=_numbers(position), rpy=_numbers(turn))


def _number(value: float) -> str:
    # Rounding leaves no minus before a zero.
    text = f"{float(value):.{DIGITS}g}"
    return "0" if text == "-0" or abs(float(value)) < 1e-15 else text


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(map(_number, values))


def hmtb_urdf() -> str:
    """Return the arm of the test bed, which holds the RPCM, as URDF."""
    return urdf_text(mujoco.MjModel.from_xml_path(str(model_file("hmtb/hmtb.xml"))), VARIANTS["nominal"])


def main() -> None:
    """Write the file beside the MJCF that it is made from."""
    write_whole(Path(model_file("hmtb/hmtb.xml")).parent / Path(PLACE).name, hmtb_urdf())


if __name__ == "__main__":
    main()
