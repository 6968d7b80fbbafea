"""A scene about an arm from files: its shapes, or simple links where they do not load, floor, lamps and cameras."""

import os
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from hmtb_twin.arm.arm import Arm
from hmtb_twin.arm_files.rigid_arm import PAYLOAD_BODY
from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.arm_description import RigidModel

DRAWABLE = (".stl", ".obj", ".msh")
"""Endings of meshes that MuJoCo reads."""

LINK_COLOUR, JOINT_COLOUR = [0.86, 0.87, 0.88, 1.0], [0.25, 0.45, 0.70, 1.0]
"""Colours of simple links and of their joints."""

SLENDER = 0.045
"""Radius of a simple link over the reach of the arm."""

VIEWS = {
    "overview": (1.0, -1.0, 0.45),
    "front": (1.0, 0.0, 0.15),
    "side": (0.0, -1.0, 0.15),
    "top": (0.001, 0.0, 1.0),
}
"""Cameras by name: where each stands from the middle of the arm."""

FIELD = 42.0
"""Field of view of the cameras, degrees."""


def arm_scene(arm: Arm) -> mujoco.MjModel:
    """Return the scene of an arm that is described by files; its joints have their names."""
    rigid = arm.description.rigid
    if rigid is None:
        raise TwinError(f"{arm.variant}: no files of its own given, expected an arm from an MJCF or a URDF")
    spec = _shapes_of_file(rigid)
    # Without shapes that load the arm is drawn from its joints alone.
    if spec is None:
        spec = _simple_links(rigid)
    for key in list(spec.keys):
        spec.delete(key)
    lowest, middle, extent = _extent(spec, arm)
    _furnish(spec, lowest, middle, extent)
    return spec.compile()


def _shapes_of_file(rigid: RigidModel) -> mujoco.MjSpec | None:
    """The model file with its shapes; None where they do not load, or hardly any link has one."""
    path = Path(rigid.picture)
    try:
        if path.suffix == ".urdf":
            spec = mujoco.MjSpec.from_string(_urdf_with_shapes(path))
        else:
            spec = mujoco.MjSpec.from_file(str(path))
        model = spec.compile()
    except (ValueError, OSError, ElementTree.ParseError):
        # Pictures are a convenience: the arm itself was read without its shapes.
        return None
    moving = {int(model.jnt_bodyid[i]) for i in range(model.njnt)}
    shaped = {int(model.body_weldid[body]) for body in model.geom_bodyid}
    return spec if 2 * len(moving & shaped) > len(moving) else None


def _urdf_with_shapes(path: Path) -> str:
    """Text of a URDF whose links have those of their shapes that MuJoCo draws, by the whole path of their meshes."""
    root = ElementTree.fromstring(path.read_text(encoding="utf-8-sig"))
    folder = _package_folder(path)
    for link in root.iter("link"):
        drawn = 0
        # Collision shapes stand for those to look at where these have a form that is not read.
        for kind in ("visual", "collision"):
            for shape in link.findall(kind):
                is_seen = kind == "collision" and drawn > 0
                if is_seen or not _is_drawable(shape, path, folder):
                    link.remove(shape)
                else:
                    drawn += kind == "visual"
    for extension in root.findall("mujoco"):
        root.remove(extension)
    extension = ElementTree.SubElement(root, "mujoco")
    settings = {"fusestatic": "false", "discardvisual": "false", "strippath": "false"}
    ElementTree.SubElement(extension, "compiler", settings)
    return ElementTree.tostring(root, encoding="unicode")


def _package_folder(path: Path) -> Path:
    """Folder of the packages that a URDF names: the nearest one above it with a `package.xml`, else its own."""
    for folder in path.parents:
        if (folder / "package.xml").is_file():
            return folder
    return path.parent


def _is_drawable(shape: ElementTree.Element, path: Path, folder: Path) -> bool:
    """Whether a shape is a primitive, or a mesh inside the folder; the mesh gets its whole path."""
    mesh = shape.find("geometry/mesh")
    if mesh is None:
        return shape.find("geometry") is not None
    name = str(mesh.get("filename", "")).removeprefix("file://")
    if not name.lower().endswith(DRAWABLE):
        return False
    # `package://NAME/rest` starts from the folder of the package of that name.
    package, _, rest = name.removeprefix("package://").partition("/")
    candidates = [folder / rest, folder.parent / package / rest] if name.startswith("package://") else []
    candidates.append(path.parent / name)
    for candidate in candidates:
        inside = candidate.resolve().is_relative_to(folder.resolve())
        if inside and candidate.is_file():
            mesh.set("filename", os.fspath(candidate.resolve()))
            return True
    return False


def _simple_links(rigid: RigidModel) -> mujoco.MjSpec:
    """The links of an arm as capsules from joint to joint."""
    spec = mujoco.MjSpec.from_string(rigid.mjcf)
    for sensor in list(spec.sensors):
        spec.delete(sensor)
    bodies = [body for body in spec.bodies if body.name != "world"]
    steps = [float(np.linalg.norm(body.pos)) for body in bodies]
    radius = SLENDER * max(sum(steps), 0.1)
    # The chain is serial: each body hangs on the one before it.
    for parent, child, length in zip([spec.worldbody, *bodies[:-1]], bodies, steps, strict=True):
        if length > 0.3 * radius:
            parent.add_geom(
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=[0.0, 0.0, 0.0, *child.pos],
                size=[0.75 * radius, 0.0, 0.0],
                rgba=LINK_COLOUR,
                mass=0.0,
            )
        if child.name != PAYLOAD_BODY:
            child.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0.0, 0.0], rgba=JOINT_COLOUR, mass=0.0)
    return spec


def _extent(spec: mujoco.MjSpec, arm: Arm) -> tuple[float, np.ndarray, float]:
    """Height of the lowest point, middle (3,) and radius of an arm at its operating pose, m."""
    model = spec.compile()
    data = mujoco.MjData(model)
    pose_scene(model, data, arm, arm.pose(arm.description.operating_pose))
    # Shapes reach beyond the frames of their bodies.
    points = data.geom_xpos if model.ngeom else data.xpos
    sizes = model.geom_rbound if model.ngeom else np.zeros(model.nbody)
    lowest = float((points[:, 2] - sizes).min())
    low, high = (points - sizes[:, None]).min(axis=0), (points + sizes[:, None]).max(axis=0)
    return lowest, 0.5 * (low + high), float(0.5 * np.linalg.norm(high - low))


def _furnish(spec: mujoco.MjSpec, lowest: float, middle: np.ndarray, extent: float) -> None:
    """Add sky, floor, lamps and cameras about an arm of a middle (3,), m, and a radius, m."""
    # Light from the viewer keeps the shadows of the lamps from being black.
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.36] * 3, [0.40] * 3
    # Small arms are seen from near: what is closer than a centimetre is cut off.
    spec.visual.map.znear, spec.visual.map.zfar = 0.01, 50.0
    spec.stat.extent, spec.stat.center = max(2.0 * extent, 0.1), list(middle)
    _add_sky_and_floor(spec, lowest, middle, extent)
    for number, offset in enumerate(((1.5, -2.0, 3.0), (-1.0, 2.5, 2.5))):
        position = middle + extent * np.array(offset)
        spec.worldbody.add_light(
            name=f"scene_lamp_{number}",
            pos=list(position),
            dir=list(middle - position),
            diffuse=[0.6 - 0.25 * number] * 3,
            # Two shadows of every link would confuse the eye.
            castshadow=number == 0,
        )
    # A sphere about the arm fills four fifths of the picture's height.
    distance = 1.25 * extent / np.tan(0.5 * np.radians(FIELD))
    for name, direction in VIEWS.items():
        towards = np.array(direction) / np.linalg.norm(direction)
        right = np.cross([0.0, 0.0, 1.0], towards)
        right /= np.linalg.norm(right)
        # A camera looks along its own -z, its x to the right.
        axes = np.column_stack((right, np.cross(towards, right), towards))
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, axes.ravel())
        position = middle + distance * towards
        spec.worldbody.add_camera(name=name, pos=list(position), quat=list(quaternion), fovy=FIELD)


def _add_sky_and_floor(spec: mujoco.MjSpec, lowest: float, middle: np.ndarray, extent: float) -> None:
    """Add a sky, and a chequered floor at the height of the lowest point, m, or at zero above it."""
    gradient, checker = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, mujoco.mjtBuiltin.mjBUILTIN_CHECKER
    skybox, flat = mujoco.mjtTexture.mjTEXTURE_SKYBOX, mujoco.mjtTexture.mjTEXTURE_2D
    # Greys, so that arms of any colour stand out.
    for name, kind, pattern, first, second in (
        ("scene_sky", skybox, gradient, [0.62, 0.67, 0.73], [0.30, 0.34, 0.40]),
        ("scene_floor", flat, checker, [0.47, 0.49, 0.51], [0.43, 0.45, 0.47]),
    ):
        spec.add_texture(name=name, type=kind, builtin=pattern, rgb1=first, rgb2=second, width=256, height=256)
    floor = spec.add_material(name="scene_floor", texrepeat=[8, 8], specular=0.1)
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "scene_floor"
    side = max(6.0 * extent, 1.0)
    # A base that reaches below zero stands on a floor of its own height.
    height = min(lowest, 0.0)
    spec.worldbody.add_geom(
        name="scene_floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[side, side, 0.1],
        pos=[middle[0], middle[1], height],
        material="scene_floor",
        contype=0,
        conaffinity=0,
    )


def pose_scene(model: mujoco.MjModel, data: mujoco.MjData, arm: Arm, angles: np.ndarray) -> None:
    """Set the joints of a scene to angles (n,), rad, and all others where they are held; compute its bodies."""
    rigid = arm.description.rigid
    held = rigid.locked if rigid is not None else {}
    places = {name: float(angle) for name, angle in zip(arm.joints, angles, strict=True)} | dict(held)
    for i in range(model.njnt):
        name = model.joint(i).name
        if name in places:
            data.qpos[model.jnt_qposadr[i]] = places[name]
    mujoco.mj_kinematics(model, data)
