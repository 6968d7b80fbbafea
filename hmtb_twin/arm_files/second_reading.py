"""A second reading of an arm's file, by Pinocchio, against that by MuJoCo: inertia, weight and kinematics."""

from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin

from hmtb_twin.arm_files.model_file import ModelFile, gravity_of
from hmtb_twin.arm_files.rigid_arm import TOOL_SITE, RigidArm
from hmtb_twin.files.errors import TwinError

JOINT = " (joint)"
"""Ending by which a joint is told from a link of its name."""

POSES = 5
"""Random poses at which both are compared."""

AGREEMENT = 1e-12
"""Largest difference of the readings, relative to the largest value."""


def check_second_reading(file: ModelFile, arm: RigidArm) -> tuple[str, ...]:
    """Compare inertia matrix, weight and tool of an arm by MuJoCo with those that Pinocchio reads from the same file.

    Returns:
        A remark where Pinocchio does not read the file and the bodies alone were compared; else none.

    Raises:
        TwinError: They differ by more than `AGREEMENT`; the message says in what.
    """
    remarks: tuple[str, ...] = ()
    try:
        peer = _reduced(file, arm)
    except (RuntimeError, ValueError, IndexError, KeyError) as error:
        reason = " ".join(str(error).split())[:120]
        remarks = (f"Pinocchio does not read the file ({reason}): it was compared with MuJoCo on the links alone",)
        peer = _from_mjcf(arm.mjcf)
    # What a file says of rotors is part of the drives, not of the links.
    peer.armature[:] = 0.0
    peer.gravity.linear = gravity_of(file.model)
    model = mujoco.MjModel.from_xml_string(arm.mjcf)
    model.opt.gravity = gravity_of(file.model)
    data, scratch = mujoco.MjData(model), peer.createData()
    frame = _frame(peer, TOOL_SITE if remarks else arm.tool)
    # Far from zero, where wrong axes or frames would not show.
    rng = np.random.default_rng(0)
    for _ in range(POSES):
        angles = rng.uniform(-1.5, 1.5, len(arm.joints))
        data.qpos[:] = angles
        mujoco.mj_forward(model, data)
        q = _configuration(peer, angles)
        mass = np.empty((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        upper = np.triu(pin.crba(peer, scratch, q))
        _compare(file, "inertia", mass, upper + np.triu(upper, 1).T)
        _compare(file, "weight", data.qfrc_bias, pin.computeGeneralizedGravity(peer, scratch, q))
        if frame is not None:
            pin.forwardKinematics(peer, scratch, q)
            placement = pin.updateFramePlacement(peer, scratch, frame)
            _compare(file, "position of the tool", data.site(TOOL_SITE).xpos, placement.translation)
            _compare(file, "rotation of the tool", data.site(TOOL_SITE).xmat.reshape(3, 3), placement.rotation)
    return remarks


def _frame(model: pin.Model, name: str) -> int | None:
    """Number of the frame of a body or site; None if there is none, joints may have the same names."""
    for kind in (pin.FrameType.BODY, pin.FrameType.OP_FRAME):
        if model.existFrame(name, kind):
            return int(model.getFrameId(name, kind))
    return None


def _compare(file: ModelFile, what: str, ours: np.ndarray, theirs: np.ndarray) -> None:
    """Raise `TwinError` if two readings of a quantity differ."""
    difference = float(np.abs(ours - theirs).max())
    size = float(np.abs(theirs).max())
    # An arm that turns about vertical axes alone has no weight on its joints but for rounding.
    if difference > AGREEMENT * max(size, 1.0):
        raise TwinError(
            f"{file.path.name}: MuJoCo and Pinocchio read another {what} of the arm, {difference:.1e} apart at "
            f"{size:.1e}; expected equal readings: the file has something that only one of them knows"
        )


def _reduced(file: ModelFile, arm: RigidArm) -> pin.Model:
    """The arm as Pinocchio reads it from the file itself, all other joints held."""
    whole = pin.buildModelFromXML(_unambiguous(file)) if file.is_urdf else pin.buildModelFromMJCF(str(file.path))
    q = pin.neutral(whole)
    _set_floating(whole, q, file.model)
    locked = []
    for k in range(1, whole.njoints):
        name = whole.names[k].removesuffix(JOINT)
        if name in arm.joints:
            continue
        locked.append(k)
        if name in arm.locked:
            _set_angle(whole, q, k, arm.locked[name])
    # Joints that are held make their links one, as in our own reading.
    reduced = pin.buildReducedModel(whole, locked, q)
    names = tuple(name.removesuffix(JOINT) for name in reduced.names[1:])
    if names != arm.joints:
        raise ValueError(f"its joints are {', '.join(names)}")
    return reduced


def _unambiguous(file: ModelFile) -> str:
    """Text of a URDF in which no joint has the name of a link: Pinocchio could not reduce such a model."""
    root = ElementTree.fromstring(file.path.read_text(encoding="utf-8-sig"))
    links = {link.get("name") for link in root.iter("link")}
    for joint in root.findall("joint"):
        if joint.get("name") in links:
            joint.set("name", f"{joint.get('name')}{JOINT}")
        for mimic in joint.findall("mimic"):
            # A joint that follows another one is held all the same.
            joint.remove(mimic)
    return ElementTree.tostring(root, encoding="unicode")


def _set_floating(whole: pin.Model, q: np.ndarray, model: mujoco.MjModel) -> None:
    """Set what floats where the file puts it: Pinocchio's neutral configuration has it at the origin."""
    floating = [k for k in range(1, whole.njoints) if whole.nqs[k] == 7]
    free = [i for i in range(model.njnt) if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_FREE]
    for k, i in zip(floating, free, strict=False):
        first, start = whole.idx_qs[k], model.jnt_qposadr[i]
        position, quaternion = model.qpos0[start : start + 3], model.qpos0[start + 3 : start + 7]
        # MuJoCo's quaternions have the scalar first, Pinocchio's last.
        q[first : first + 7] = np.concatenate([position, np.roll(quaternion, -1)])


def _set_angle(model: pin.Model, q: np.ndarray, joint: int, *angles: float) -> None:
    """Set the angles of a joint in a configuration; one without limits is held as cosine and sine."""
    first, numbers = model.idx_qs[joint], model.nqs[joint]
    if numbers == model.nvs[joint]:
        # Two hinges of one body are one joint to Pinocchio.
        q[first : first + numbers] = angles
    elif numbers == 2:
        (angle,) = angles
        q[first : first + 2] = np.cos(angle), np.sin(angle)


def _configuration(model: pin.Model, angles: np.ndarray) -> np.ndarray:
    """Configuration of a model for the angles (n,), rad, of its joints."""
    q = pin.neutral(model)
    for joint in range(1, model.njoints):
        first = model.idx_vs[joint]
        _set_angle(model, q, joint, *map(float, angles[first : first + model.nvs[joint]]))
    return q


def _from_mjcf(mjcf: str) -> pin.Model:
    with TemporaryDirectory() as folder:
        path = Path(folder, "arm.xml")
        path.write_text(mjcf, encoding="utf-8")
        return pin.buildModelFromMJCF(str(path))
