"""The arm in a model file: which of its joints are the arm's, and its bodies with all other joints held."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from xml.etree import ElementTree

import mujoco
import numpy as np

from hmtb_twin.arm_files.model_file import ModelFile, gravity_of
from hmtb_twin.files.errors import TwinError, shown
from hmtb_twin.parameters.arm_toml import STRONGEST

GRIPPER = re.compile(r"grip|finger|thumb|knuckle|jaw|claw|hand(?!le)|palm", re.IGNORECASE)
"""Names of joints of a gripper, which is no part of the arm."""

TOOL_NAMES = ("tool", "tcp", "attachment_site", "ee_link", "end_effector", "grasp", "pinch", "hand", "flange", "ee")
"""Parts of the names of sites and bodies at the tool, the likelier ones first."""

VALID_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,63}")
"""Names of joints: files and channels are named after them."""

MOST_JOINTS = 100
"""Most joints of an arm: more are none."""

ROOT_FRAME = "universe"
"""Name of what the controller's model hangs on."""

PAYLOAD_BODY, TOOL_SITE, SENSOR_SITE = "payload", "tool", "wrist_sensor"
"""Names in the MJCF of every arm: the body that carries the payload, and sites in its frame."""


@dataclass(frozen=True, eq=False)
class RigidArm:
    """The arm in a model file.

    Attributes:
        joints: Its joints from the base outward.
        ids: Their numbers in the file's model.
        locked: Angles or displacements at which all other joints are held, rad or m.
        tool: Name of the body or site of the file whose frame is the tool's.
        mjcf: Its bodies, as `RigidModel.mjcf`.
        remarks: What was chosen, one line each.
    """

    joints: tuple[str, ...]
    ids: tuple[int, ...]
    locked: Mapping[str, float]
    tool: str
    mjcf: str
    remarks: tuple[str, ...]


def rigid_arm(
    file: ModelFile, *, joints: Sequence[str] = (), locked: Mapping[str, float] | None = None, tool: str = ""
) -> RigidArm:
    """Find the arm in a model file, and write its bodies.

    Its joints are the hinges on the path from the base to the body that has most of them, without those of a gripper
    and those that follow others. All other joints are held.

    Args:
        file: The model file.
        joints: The arm's joints, from the base outward; chosen when empty.
        locked: Where other joints are held, rad or m; at zero, or the nearest end of their range, by default.
        tool: Body or site at the tool; chosen by its name when empty.

    Raises:
        TwinError: No joint, a joint that is no hinge, a chain that is closed, a link that moves and has no mass, or
            anything else that the arm cannot have.
    """
    model, name = file.model, file.path.name
    ids = _chosen(file, joints, locked or {})
    _check_model(file, ids)
    held = _held(file, ids, locked or {})
    data = _posed(model, held)
    tool_name, tool_pose = _tool(file, data, ids[-1], tool)
    names = tuple(model.joint(i).name for i in ids)
    remarks = list(file.remarks)
    if held:
        angles = ", ".join(f"{joint} at {angle:g}" for joint, angle in held.items())
        remarks.append(f"held, as no joints of the arm: {angles}")
    remarks.append(f"the tool is at {tool_name}")
    return RigidArm(names, ids, held, tool_name, _mjcf(name, model, data, ids, tool_pose), tuple(remarks))


def _chosen(file: ModelFile, wanted: Sequence[str], locked: Mapping[str, float]) -> tuple[int, ...]:
    """Numbers of the arm's joints from the base outward."""
    model, name = file.model, file.path.name
    names = [model.joint(i).name for i in range(model.njnt)]
    for joint in (*wanted, *locked):
        if joint not in names:
            raise TwinError(f"{name}: unknown joint {shown(joint)}, available: {', '.join(names) or 'none'}")
        if joint in wanted and joint in locked:
            raise TwinError(f"{name}: joint {joint} given in joints and in locked, expected one of them")
    followers = _followers(file)
    if wanted:
        ids = [names.index(joint) for joint in wanted]
        for i in ids:
            _check_kind(file, i, followers)
    else:
        ids = _longest_chain(file, followers, locked)
        if not ids:
            kinds = ", ".join(f"{names[i]} {_kind(model, i)}" for i in range(model.njnt))
            raise TwinError(f"{name}: no hinge of an arm found, expected one or more; joints: {kinds or 'none'}")
    if len(ids) > MOST_JOINTS:
        raise TwinError(f"{name}: an arm of {len(ids)} joints given, expected at most {MOST_JOINTS}")
    for i in ids:
        if not VALID_NAME.fullmatch(names[i]):
            raise TwinError(
                f"{name}: joint name {shown(names[i])} given, expected letters, digits, '_', '.', '-' or '+', at most "
                "64: files are named after it"
            )
        if names[i] == ROOT_FRAME:
            raise TwinError(f"{name}: joint name {ROOT_FRAME} given, expected another: the controller's model has it")
    # MuJoCo numbers joints from the base outward.
    ordered = sorted(ids)
    if list(ids) != ordered or len(set(ids)) < len(ids):
        expected = ", ".join(names[i] for i in sorted(set(ids)))
        raise TwinError(f"{name}: joints {', '.join(wanted)} given, expected them from the base outward: {expected}")
    for inner, outer in pairwise(ids):
        if model.jnt_bodyid[inner] not in _ancestors(model, int(model.jnt_bodyid[outer])):
            raise TwinError(
                f"{name}: {names[outer]} is not moved by {names[inner]}, expected joints of one serial chain"
            )
    return tuple(ids)


def _kind(model: mujoco.MjModel, joint: int) -> str:
    """Kind of a joint in words."""
    kinds = {
        mujoco.mjtJoint.mjJNT_HINGE: "hinge",
        mujoco.mjtJoint.mjJNT_SLIDE: "slide",
        mujoco.mjtJoint.mjJNT_BALL: "ball",
        mujoco.mjtJoint.mjJNT_FREE: "free",
    }
    return kinds[mujoco.mjtJoint(model.jnt_type[joint])]


def _check_kind(file: ModelFile, joint: int, followers: Mapping[int, str]) -> None:
    """Raise `TwinError` unless a joint is a hinge that follows no other."""
    name, kind = file.model.joint(joint).name, _kind(file.model, joint)
    if kind != "hinge":
        raise TwinError(f"{file.path.name}: joint {name} is a {kind}, expected hinges")
    if joint in followers:
        raise TwinError(
            f"{file.path.name}: joint {name} follows {followers[joint]}, expected joints with drives of their own"
        )


def _followers(file: ModelFile) -> dict[int, str]:
    """Joints that follow another one, or are fixed, by an equality of MJCF, with what they follow."""
    model = file.model
    followers = {}
    for k in range(model.neq):
        if model.eq_type[k] != mujoco.mjtEq.mjEQ_JOINT or not model.eq_active0[k]:
            continue
        leader = int(model.eq_obj2id[k])
        followers[int(model.eq_obj1id[k])] = model.joint(leader).name if leader >= 0 else "a fixed angle"
    return followers


def _fixed_angles(model: mujoco.MjModel) -> dict[int, float]:
    """Angles or displacements at which equalities of MJCF fix joints without a leader, rad or m."""
    angles = {}
    for k in range(model.neq):
        is_fixed = model.eq_type[k] == mujoco.mjtEq.mjEQ_JOINT and model.eq_obj2id[k] < 0 and model.eq_active0[k]
        if is_fixed:
            joint = int(model.eq_obj1id[k])
            # The polynomial gives the distance from the reference angle.
            angles[joint] = float(model.eq_data[k, 0] + model.qpos0[model.jnt_qposadr[joint]])
    return angles


def _longest_chain(file: ModelFile, followers: Mapping[int, str], locked: Mapping[str, float]) -> list[int]:
    """The joints on the path from the base to the body with most of them; the first of several paths."""
    model = file.model
    candidates: dict[int, list[int]] = {}
    for i in range(model.njnt):
        name = model.joint(i).name
        is_of_arm = _kind(model, i) == "hinge" and i not in followers and name not in locked
        if is_of_arm and not GRIPPER.search(name):
            candidates.setdefault(int(model.jnt_bodyid[i]), []).append(i)
    best: list[int] = []
    for body in range(1, model.nbody):
        path: list[int] = []
        # From the base outward: MuJoCo numbers joints in this sequence too.
        for ancestor in reversed(_ancestors(model, body)):
            path += candidates.get(ancestor, [])
        if len(path) > len(best):
            best = path
    return best


def _ancestors(model: mujoco.MjModel, body: int) -> list[int]:
    """A body and all bodies that it hangs on, outermost first, without the world."""
    found = []
    while body:
        found.append(body)
        body = int(model.body_parentid[body])
    return found


def _check_model(file: ModelFile, ids: Sequence[int]) -> None:
    """Raise `TwinError` for what neither the laboratory's drives nor the controller's model would know of."""
    model, name = file.model, file.path.name
    for k in range(model.neq):
        kind = mujoco.mjtEq(model.eq_type[k])
        if kind in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD) and model.eq_active0[k]:
            raise TwinError(
                f"{name}: a constraint between two bodies closes a chain, expected an arm whose bodies are a tree"
            )
        if kind == mujoco.mjtEq.mjEQ_TENDON and model.eq_active0[k]:
            raise TwinError(
                f"{name}: a constraint between tendons given, expected none: joints have drives of their own"
            )
    for tendon in range(model.ntendon):
        for what in ("stiffness", "damping", "frictionloss", "armature", "stiffnesspoly", "dampingpoly"):
            if np.any(getattr(model, f"tendon_{what}")[tendon]):
                raise TwinError(
                    f"{name}: tendon {model.tendon(tendon).name or tendon} has {what.removesuffix('poly')}, expected "
                    "none: the drives act on joints alone"
                )
    for i in ids:
        joint = model.joint(i).name
        if model.jnt_stiffness[i] or np.any(model.jnt_stiffnesspoly[i]):
            raise TwinError(f"{name}: joint {joint} has a spring, expected none: the servo's model does not know it")
        if np.any(model.dof_dampingpoly[model.jnt_dofadr[i]]):
            raise TwinError(f"{name}: joint {joint} has damping that grows with its speed, expected a constant one")
        shares_body = int(model.body_jntnum[model.jnt_bodyid[i]]) > 1
        # The axis of the outer one would turn with the angle at which the inner one is drawn.
        if shares_body and model.qpos0[model.jnt_qposadr[i]]:
            raise TwinError(
                f"{name}: joint {joint} has a reference angle and shares its body with another joint, expected a "
                "body for each"
            )
    moving = {int(model.jnt_bodyid[i]) for i in ids}
    for body in range(model.nbody):
        link = model.body(body).name
        if link in file.unphysical and moving & set(_ancestors(model, body)):
            raise TwinError(f"{name}: the arm moves the link {link}, which is given {file.unphysical[link]}")
    gravity = gravity_of(model)
    if gravity[0] or gravity[1] or not -STRONGEST <= gravity[2] <= 0.0:
        shown_gravity = " ".join(f"{value:g}" for value in gravity)
        raise TwinError(f"{name}: gravity {shown_gravity} given, expected one along -z of at most {STRONGEST:g} m/s2")
    if model.opt.density or model.opt.viscosity:
        raise TwinError(f"{name}: a medium with density or viscosity given, expected none")
    if (model.body_gravcomp != 0.0).any():
        raise TwinError(f"{name}: bodies with gravity compensation given, expected none: the controller does it")


def _held(file: ModelFile, ids: Sequence[int], locked: Mapping[str, float]) -> dict[str, float]:
    """Where joints are held that are none of the arm's; a floating base stays where it is."""
    model, fixed = file.model, _fixed_angles(file.model)
    held: dict[str, float] = {}
    for i in range(model.njnt):
        # A floating base stays where the file puts it.
        if i in ids or _kind(model, i) in ("free", "ball"):
            continue
        name = model.joint(i).name
        low, high = model.jnt_range[i] if model.jnt_limited[i] else (-np.inf, np.inf)
        angle = float(np.clip(fixed.get(i, 0.0), low, high))
        if name in locked:
            angle = float(locked[name])
            if not low <= angle <= high:
                raise TwinError(
                    f"{file.path.name}: joint {name} locked at {angle:g} given, expected {low:g} to {high:g}, its range"
                )
        if not name and angle:
            raise TwinError(
                f"{file.path.name}: a joint without a name has to be held at {angle:g}, expected a name of its own"
            )
        if name or not held.get(name):
            held[name] = angle
    return held


def _posed(model: mujoco.MjModel, held: Mapping[str, float]) -> mujoco.MjData:
    """The model with joints of the arm at zero and all others where they are held."""
    data = mujoco.MjData(model)
    for i in range(model.njnt):
        if _kind(model, i) in ("hinge", "slide"):
            data.qpos[model.jnt_qposadr[i]] = held.get(model.joint(i).name, 0.0)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


Pose = tuple[np.ndarray, np.ndarray]
"""Position (3,), m, and rotation (3, 3)."""


def _tool(file: ModelFile, data: mujoco.MjData, last_joint: int, wanted: str) -> tuple[str, Pose]:
    """Name and pose in the world of the frame at the tool."""
    model = file.model
    last_body = int(model.jnt_bodyid[last_joint])
    frames: dict[str, Pose] = {}
    for body in range(1, model.nbody):
        if last_body in _ancestors(model, body):
            frames[model.body(body).name] = (data.xpos[body].copy(), data.xmat[body].reshape(3, 3).copy())
    for site in range(model.nsite):
        if last_body in _ancestors(model, int(model.site_bodyid[site])):
            frames[model.site(site).name] = (data.site_xpos[site].copy(), data.site_xmat[site].reshape(3, 3).copy())
    frames.pop("", None)
    if wanted:
        if wanted not in frames:
            raise TwinError(
                f"{file.path.name}: unknown tool {shown(wanted)}, available on the last link: {', '.join(frames)}"
            )
        return wanted, frames[wanted]
    # A file that names a tool, a flange or an attachment means it.
    for part in TOOL_NAMES:
        for name in frames:
            # A gripper's fingers hang on the hand, which is the tool.
            if part in name.lower() and not GRIPPER.search(name):
                return name, frames[name]
    # The body furthest from the base that is fixed to the last link, else the last link itself.
    # MuJoCo numbers all bodies that no joint parts with the first of them.
    (fixed,) = np.nonzero(model.body_weldid == model.body_weldid[last_body])
    outermost = int(max(fixed, key=lambda body: len(_ancestors(model, int(body)))))
    return (
        model.body(outermost).name or f"body {outermost}",
        (data.xpos[outermost].copy(), data.xmat[outermost].reshape(3, 3).copy()),
    )


def _mjcf(name: str, model: mujoco.MjModel, data: mujoco.MjData, ids: Sequence[int], tool: Pose) -> str:
    """Write the links of the arm, each with all bodies that are fixed to it, as MJCF."""
    root = ElementTree.Element("mujoco", {"model": name})
    ElementTree.SubElement(root, "compiler", {"angle": "radian", "autolimits": "true", "inertiafromgeom": "false"})
    option = ElementTree.SubElement(root, "option", {"integrator": "implicitfast", "jacobian": "dense"})
    # Nothing of the arm collides; a state that diverges stays as it is, so that it can be reported.
    ElementTree.SubElement(option, "flag", {"contact": "disable", "island": "disable", "autoreset": "disable"})
    parent = ElementTree.SubElement(root, "worldbody")
    links = list(dict.fromkeys(int(model.jnt_bodyid[i]) for i in ids))
    origin: Pose = (np.zeros(3), np.eye(3))
    # Bodies that no joint of the arm parts become one link; those that stand still are the ground.
    for place, (link, link_name) in enumerate(zip(links, _link_names(model, links), strict=True)):
        frame = (data.xpos[link], data.xmat[link].reshape(3, 3))
        parent = _add_body(parent, link_name, origin, frame)
        fixed = _moved_by(model, link, links[place + 1 :])
        _add_inertia(name, link_name, parent, model, data, fixed, frame)
        for i in ids:
            if model.jnt_bodyid[i] == link:
                _add_joint(parent, model, i)
        origin = frame
    payload = _add_body(parent, PAYLOAD_BODY, origin, tool)
    # Without a payload the body stays: MuJoCo changes a simulation's model only for one of equal size.
    ElementTree.SubElement(payload, "inertial", {"pos": "0 0 0", "mass": "0", "diaginertia": "0 0 0"})
    for site in (TOOL_SITE, SENSOR_SITE):
        ElementTree.SubElement(payload, "site", {"name": site})
    sensor = ElementTree.SubElement(root, "sensor")
    ElementTree.SubElement(sensor, "force", {"name": "wrist_force", "site": SENSOR_SITE})
    ElementTree.SubElement(sensor, "torque", {"name": "wrist_torque", "site": SENSOR_SITE})
    return ElementTree.tostring(root, encoding="unicode")


def _link_names(model: mujoco.MjModel, links: Sequence[int]) -> list[str]:
    """Names of the links of the arm: those of the file, where nothing else has them."""
    names: list[str] = []
    taken = {PAYLOAD_BODY, TOOL_SITE, SENSOR_SITE, ROOT_FRAME, *(model.body(link).name for link in links)}
    for place, link in enumerate(links, start=1):
        name = model.body(link).name
        if not name or name in (PAYLOAD_BODY, TOOL_SITE, SENSOR_SITE, ROOT_FRAME):
            name = f"link_{place}"
            while name in taken:
                name += "_"
        taken.add(name)
        names.append(name)
    return names


def _moved_by(model: mujoco.MjModel, link: int, later: Sequence[int]) -> list[int]:
    """Bodies that move with a link of the arm and with none of the later ones, itself the first."""
    bodies = []
    for body in range(link, model.nbody):
        ancestors = _ancestors(model, body)
        if link in ancestors and not set(later) & set(ancestors):
            bodies.append(body)
    return bodies


def _add_body(parent: ElementTree.Element, name: str, origin: Pose, frame: Pose) -> ElementTree.Element:
    """Add a body at a frame, given as the frame of its parent is, in the world."""
    position = origin[1].T @ (frame[0] - origin[0])
    attributes = {"name": name, "pos": _digits(position), "quat": _digits(_quaternion(origin[1].T @ frame[1]))}
    return ElementTree.SubElement(parent, "body", attributes)


def _add_inertia(
    file: str,
    link: str,
    element: ElementTree.Element,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    bodies: Sequence[int],
    frame: Pose,
) -> None:
    """Write mass, centre and inertia of bodies that move as one, in a frame given in the world."""
    masses = model.body_mass[bodies]
    mass = float(masses.sum())
    if mass <= 0.0:
        raise TwinError(f"{file}: link {link} moves and has no mass, expected a mass above 0 kg")
    centres = (data.xipos[bodies] - frame[0]) @ frame[1]
    centre = masses @ centres / mass
    inertia = np.zeros((3, 3))
    for body, of_body, at in zip(bodies, masses, centres, strict=True):
        axes = frame[1].T @ data.ximat[body].reshape(3, 3)
        offset = at - centre
        inertia += axes @ np.diag(model.body_inertia[body]) @ axes.T
        inertia += of_body * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    moments, axes = np.linalg.eigh(0.5 * (inertia + inertia.T))
    if moments[0] <= 0.0:
        raise TwinError(f"{file}: link {link} moves and has no inertia, expected moments of inertia above 0 kg m2")
    # Eigenvectors may be left-handed, which no quaternion is.
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    attributes = {
        "pos": _digits(centre),
        "quat": _digits(_quaternion(axes)),
        "mass": repr(mass),
        "diaginertia": _digits(moments),
    }
    ElementTree.SubElement(element, "inertial", attributes)


def _add_joint(element: ElementTree.Element, model: mujoco.MjModel, joint: int) -> None:
    """Write a hinge with its axis, its anchor and its range, if it has one."""
    attributes = {
        "name": model.joint(joint).name,
        "pos": _digits(model.jnt_pos[joint]),
        "axis": _digits(model.jnt_axis[joint]),
    }
    if model.jnt_limited[joint]:
        attributes["range"] = _digits(model.jnt_range[joint])
    ElementTree.SubElement(element, "joint", attributes)


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation).ravel())
    return quaternion


def _digits(values: np.ndarray) -> str:
    """Numbers with all their digits: the controller must know exactly the bodies that MuJoCo simulates."""
    return " ".join(repr(float(value)) for value in values)
