"""A second reading of an arm's file, by Pinocchio, against that by MuJoCo: inertia, weight and kinematics."""

from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin

from hmtb_twin.arm_files.model_file import ModelFile
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
    peer.gravity.linear = np.array(file.model.opt.gravity)
    model = mujoco.MjModel.from_xml_string(arm.mjcf)
    model.opt.gravity = file.model.opt.gravity
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


def _set_angle(model: pin.Model, q: np.ndarray, joint: int, angle: float) -> None:
    """Set the angle of a joint in a configuration; one without limits is held as cosine and sine."""
    first, numbers = model.idx_qs[joint], model.nqs[joint]
    if numbers == 1:
        q[first] = angle
    elif numbers == 2:
        q[first : first + 2] = np.cos(angle), np.sin(angle)


def _configuration(model: pin.Model, angles: np.ndarray) -> np.ndarray:
    """Configuration of a model for the angles (n,), rad, of its joints."""
    q = pin.neutral(model)
    for joint, angle in enumerate(angles, start=1):
        _set_angle(model, q, joint, float(angle))
    return q


def _from_mjcf(mjcf: str) -> pin.Model:
    with TemporaryDirectory() as folder:
        path = Path(folder, "arm.xml")
        path.write_text(mjcf, encoding="utf-8")
        return pin.buildModelFromMJCF(str(path))
