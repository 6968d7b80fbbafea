"""MuJoCo against Pinocchio: a second implementation of the rigid-body dynamics."""

import re
import xml.etree.ElementTree as ET
from importlib.metadata import distribution
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

from hmtb_twin.resources import model_file

STATES = 100
RELATIVE = 1e-12


def agree(model: mujoco.MjModel, peer: "pin.Model") -> None:
    data, scratch = mujoco.MjData(model), peer.createData()
    rng = np.random.default_rng(0)
    n = model.nv
    # Joint constraints (an indexed joint, coupled fingers) are no part of the rigid-body dynamics.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    for _ in range(STATES):
        q, v, a = rng.uniform(-2, 2, n), rng.uniform(-2, 2, n), rng.uniform(-5, 5, n)
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mass = np.empty((n, n))
        for i, unit in enumerate(np.eye(n)):
            column = np.empty(n)
            mujoco.mj_mulM(model, data, column, unit)
            mass[:, i] = column
        upper = np.triu(pin.crba(peer, scratch, q))
        close(mass, upper + np.triu(upper, 1).T)
        close(data.qfrc_bias, pin.nonLinearEffects(peer, scratch, q, v))
        torque = np.empty(n)
        mujoco.mj_rne(model, data, 1, torque)
        close(torque + model.dof_armature * a, pin.rnea(peer, scratch, q, v, a))


def close(ours: np.ndarray, theirs: np.ndarray) -> None:
    assert np.abs(ours - theirs).max() <= RELATIVE * np.abs(theirs).max()


def test_hmtb():
    path = str(model_file("hmtb/hmtb.xml"))
    agree(mujoco.MjModel.from_xml_path(path), pin.buildModelFromMJCF(path))


def test_panda(tmp_path):
    path = panda(tmp_path)
    model, peer = mujoco.MjModel.from_xml_path(str(path)), pin.buildModelFromUrdf(str(path))
    names = [model.joint(i).name for i in range(model.njnt)]
    assert names == list(peer.names)[1:]
    assert model.nv >= 7
    agree(model, peer)


def panda(folder: Path) -> Path:
    """The Panda of example-robot-data without its meshes, which the dynamics do not need."""
    files = distribution("example-robot-data").files or []
    urdf = next(Path(str(file.locate())) for file in files if str(file).endswith("panda_description/urdf/panda.urdf"))
    tree = ET.fromstring(re.sub(r"<\?xml[^>]*\?>", "", urdf.read_text()))
    for link in tree.iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    mujoco_options = ET.SubElement(tree, "mujoco")
    ET.SubElement(mujoco_options, "compiler", fusestatic="false", balanceinertia="false")
    path = folder / "panda.urdf"
    path.write_bytes(ET.tostring(tree))
    return path
