"""Reading of MJCF and URDF files: what MuJoCo compiles, and what only the text of the file says."""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from hmtb_twin.files.errors import TwinError, shown

LARGEST_FILE = 50_000_000
"""Largest model file, bytes: longer ones are none of an arm."""

LEAST_INERTIA = "1e-14"
"""Moment of inertia of a point mass, kg m^2: MuJoCo reads none below 1e-15, and both readings agree to 1e-12."""

NO_INERTIA = 1e-12
"""Moments of inertia up to which a link is a point, kg m^2: what programs write where they have none."""

NUMBERS: Mapping[str, tuple[str, ...]] = {
    "origin": ("xyz", "rpy"),
    "axis": ("xyz",),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
}
"""Attributes of a URDF that are finite numbers, by element."""

ENDINGS = (".xml", ".mjcf", ".urdf")
"""Endings of model files."""


@dataclass(frozen=True)
class JointFacts:
    """What the text of a URDF says of a joint, where it says it.

    Attributes:
        kind: `revolute`, `continuous`, `prismatic`, `floating`, `planar`, ...
        effort: Largest torque, N m.
        velocity: Largest speed, rad/s.
        coulomb: Dry friction, N m.
        viscous: Damping, N m s/rad.
        mimics: Joint that it follows; empty if it follows none.
    """

    kind: str
    effort: float | None = None
    velocity: float | None = None
    coulomb: float | None = None
    viscous: float | None = None
    mimics: str = ""


@dataclass(frozen=True, eq=False)
class ModelFile:
    """A model file that MuJoCo has compiled.

    Attributes:
        path: The file.
        is_urdf: Whether it is URDF; else it is MJCF.
        model: All of it, compiled without meshes that are missing.
        facts: What a URDF says of its joints, by name; empty of MJCF.
        remarks: What was left out, one line each.
        unphysical: Why no body has the inertia that a link of a URDF is given, by the link. Such links may stand still.
    """

    path: Path
    is_urdf: bool
    model: mujoco.MjModel
    facts: dict[str, JointFacts] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    unphysical: Mapping[str, str] = field(default_factory=dict)


def gravity_of(model: mujoco.MjModel) -> np.ndarray:
    """Acceleration of gravity (3,) of a model, m/s^2, which a flag may switch off."""
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY:
        return np.zeros(3)
    return np.array(model.opt.gravity)


def read_model_file(path: Path) -> ModelFile:
    """Read and compile a model file.

    Raises:
        TwinError: It cannot be read, is neither MJCF nor URDF, names a file outside its folder, or does not compile.
    """
    text = _text_of(path)
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise TwinError(f"{path.name}: no XML: {error}") from error
    # The first element tells which of the two languages it is, whatever the ending.
    if root.tag == "robot":
        return _read_urdf(path, root)
    if root.tag == "mujoco":
        return _read_mjcf(path)
    raise TwinError(f"{path.name}: <{shown(root.tag)[1:-1]}> given, expected <mujoco> of MJCF or <robot> of URDF")


def _text_of(path: Path) -> str:
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise TwinError(f"{path.name}: {path.stat().st_size} bytes given, expected at most {LARGEST_FILE}")
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is no text in UTF-8"
        raise TwinError(f"cannot read model file {str(path)!r}: {reason}") from error


def _read_urdf(path: Path, root: ElementTree.Element) -> ModelFile:
    """Compile a URDF without its shapes, which have no part in its dynamics."""
    _check_urdf(path.name, root)
    for element in list(root):
        # What simulators and planners keep in the file, as `gazebo` and `transmission`, is none of the arm.
        if element.tag not in ("link", "joint"):
            root.remove(element)
    facts = dict(_facts_of_joints(path.name, root))
    for link in root.iter("link"):
        # Meshes in forms that MuJoCo does not read would keep it from reading the links.
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    for joint in root.findall("joint"):
        _settle_range(path.name, joint)
    followers = []
    for joint in root.findall("joint"):
        # Links of a gripper's linkage often have no mass, which only a body that stands still may lack.
        if facts[str(joint.get("name"))].mimics or joint.get("type") in ("floating", "planar"):
            joint.set("type", "fixed")
            followers.append(str(joint.get("name")))
    extension = ElementTree.SubElement(root, "mujoco")
    # Fixed links keep their names, one of which may be the tool's.
    ElementTree.SubElement(extension, "compiler", {"fusestatic": "false"})
    remarks = (f"held at zero, as they follow others or float: {', '.join(followers)}",) if followers else ()
    try:
        return ModelFile(path, True, _compiled_urdf(path.name, root), facts, remarks)
    except TwinError:
        # Inertias that no body has keep MuJoCo from reading a robot, also those of links that the arm does not move.
        points = _point_masses(root)
        unphysical = dict(_unphysical_links(root))
        if not unphysical and not points:
            raise
    if points:
        remarks = (*remarks, f"point masses, without an inertia of their own: {', '.join(points)}")
    for link in root.iter("link"):
        if link.get("name") in unphysical:
            _replace_inertia(link)
    return ModelFile(path, True, _compiled_urdf(path.name, root), facts, remarks, unphysical)


def _check_urdf(name: str, root: ElementTree.Element) -> None:
    """Raise `TwinError` for a URDF that is not expanded, links of one name, or numbers that are none."""
    links: set[str] = set()
    for element in root.iter():
        if "wiki/xacro" in str(element.tag):
            raise TwinError(f"{name}: macros of xacro given, expected the URDF that xacro makes of them")
        if element.tag == "link":
            link = str(element.get("name"))
            if link in links:
                raise TwinError(f"{name}: two links with the name {shown(link)} given, expected different names")
            links.add(link)
        if element.tag == "mass" and _number(element, "value", 0.0) < 0.0:
            raise TwinError(f"{name}: a mass of {element.get('value')} kg given, expected 0 or more")
        for attribute in NUMBERS.get(str(element.tag), ()):
            for text in str(element.get(attribute, "")).split():
                try:
                    is_finite = abs(float(text)) < float("inf")
                except ValueError:
                    is_finite = False
                if not is_finite:
                    raise TwinError(
                        f"{name}: <{element.tag} {attribute}={shown(element.get(attribute))}> given, expected finite "
                        "numbers"
                    )


def _settle_range(name: str, joint: ElementTree.Element) -> None:
    """Write both ends of a joint's range, or none; an end that is missing is zero, as URDF has it.

    Raises:
        TwinError: A range whose lower end is not below its upper one, or with one end that is infinite.
    """
    limit = joint.find("limit")
    if limit is None:
        return
    lower, upper = (_number(limit, end, 0.0) for end in ("lower", "upper"))
    # Zero to zero is what programs write who know no range, and so is all there is; a rule supplies it.
    if lower == upper == 0.0 or (lower, upper) == (-float("inf"), float("inf")):
        for end in ("lower", "upper"):
            limit.attrib.pop(end, None)
        if joint.get("type") == "revolute":
            joint.set("type", "continuous")
        return
    if joint.get("type") in ("revolute", "prismatic") and not -float("inf") < lower < upper < float("inf"):
        raise TwinError(
            f"{name}: joint {joint.get('name')} with the range {limit.get('lower', '0')} to {limit.get('upper', '0')} "
            "given, expected a lower end below the upper one"
        )
    limit.set("lower", repr(lower))
    limit.set("upper", repr(upper))


def _compiled_urdf(name: str, root: ElementTree.Element) -> mujoco.MjModel:
    try:
        text = ElementTree.tostring(root, encoding="unicode")
    except RecursionError as error:
        raise TwinError(f"{name}: elements nested too deeply, expected those of a robot") from error
    return _compiled(name, _parsed(name, lambda: mujoco.MjSpec.from_string(text)))


def _unphysical_links(root: ElementTree.Element) -> Iterator[tuple[str, str]]:
    """Yield links whose inertia no body has, and links that a joint moves and that have no mass, with the reason."""
    links = {str(link.get("name")): link for link in root.iter("link")}
    masses = {name: _mass(link) for name, link in links.items()}
    moved, fixed = set(), dict[str, list[str]]()
    for joint in root.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is None or child is None:
            continue
        if joint.get("type") == "fixed":
            fixed.setdefault(str(parent.get("link")), []).append(str(child.get("link")))
        else:
            moved.add(str(child.get("link")))
    for name, link in links.items():
        # What is fixed to a link moves as one body with it.
        weighs = masses[name] > 0.0 or any(masses.get(child, 0.0) > 0.0 for child in fixed.get(name, ()))
        if name in moved and not weighs:
            yield name, "no mass"
        elif masses[name] > 0.0:
            inertia = link.find("inertial/inertia")
            moments = np.linalg.eigvalsh(_tensor(inertia)) if inertia is not None else np.zeros(3)
            if moments[0] <= 0.0 or moments[0] + moments[1] < moments[2]:
                shown_moments = ", ".join(f"{moment:.3g}" for moment in moments)
                yield name, f"principal moments {shown_moments} kg m2, which no body has"


def _point_masses(root: ElementTree.Element) -> list[str]:
    """Give links with a mass and no inertia the least that MuJoCo reads, and return their names."""
    points = []
    for link in root.iter("link"):
        inertia = link.find("inertial/inertia")
        if inertia is not None and _mass(link) > 0.0 and np.abs(_tensor(inertia)).max() <= NO_INERTIA:
            for axis in ("ixx", "iyy", "izz"):
                inertia.set(axis, LEAST_INERTIA)
            for axes in ("ixy", "ixz", "iyz"):
                inertia.set(axes, "0")
            points.append(str(link.get("name")))
    return points


def _mass(link: ElementTree.Element) -> float:
    mass = link.find("inertial/mass")
    return 0.0 if mass is None else _number(mass, "value", 0.0)


def _tensor(inertia: ElementTree.Element) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = (_number(inertia, f"i{axes}", 0.0) for axes in ("xx", "yy", "zz", "xy", "xz", "yz"))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _replace_inertia(link: ElementTree.Element) -> None:
    """Give a link an inertia that MuJoCo reads: it counts for nothing, as no arm that moves the link is accepted."""
    inertial = link.find("inertial")
    if inertial is not None:
        link.remove(inertial)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "mass", value="1")
    ElementTree.SubElement(inertial, "inertia", ixx="1", iyy="1", izz="1", ixy="0", ixz="0", iyz="0")


def _facts_of_joints(name: str, root: ElementTree.Element) -> Iterator[tuple[str, JointFacts]]:
    """Yield what a URDF says of each joint; raises `TwinError` for a joint without a name."""
    seen: set[str] = set()
    for joint in root.findall("joint"):
        joint_name = joint.get("name")
        if not joint_name:
            raise TwinError(f"{name}: a joint without a name given, expected one name each")
        if joint_name in seen:
            raise TwinError(f"{name}: two joints with the name {shown(joint_name)} given, expected different names")
        seen.add(joint_name)
        limit, dynamics, mimic = (joint.find(tag) for tag in ("limit", "dynamics", "mimic"))
        yield (
            joint_name,
            JointFacts(
                kind=str(joint.get("type", "")),
                effort=_positive(name, joint_name, limit, "effort"),
                velocity=_positive(name, joint_name, limit, "velocity"),
                coulomb=_positive(name, joint_name, dynamics, "friction"),
                viscous=_positive(name, joint_name, dynamics, "damping"),
                mimics="" if mimic is None else str(mimic.get("joint", "")),
            ),
        )


def _number(element: ElementTree.Element, attribute: str, missing: float) -> float:
    try:
        return float(element.get(attribute, missing))
    except ValueError:
        return missing


def _positive(file: str, joint: str, element: ElementTree.Element | None, attribute: str) -> float | None:
    """A number above zero; None where there is none, as zero is written where a number is not known.

    Raises:
        TwinError: It is below zero, or not a number.
    """
    value = 0.0 if element is None else _number(element, attribute, 0.0)
    if not value >= 0.0:
        raise TwinError(f"{file}: {attribute} = {value:g} of joint {joint} given, expected 0 or more")
    return value if 0.0 < value < float("inf") else None


def _read_mjcf(path: Path) -> ModelFile:
    """Compile an MJCF; meshes that are missing are left out where bodies have inertias of their own."""
    _check_files(path, path, ())
    spec = _parsed(path.name, lambda: mujoco.MjSpec.from_file(str(path)))
    _check_paths(path, spec)
    try:
        model = spec.compile()
        _check_finite(path.name, model)
        return ModelFile(path, False, model)
    except TwinError:
        raise
    except ValueError as error:
        without = mujoco.MjSpec.from_file(str(path))
        missing = [geom for geom in without.geoms if geom.type == mujoco.mjtGeom.mjGEOM_MESH]
        if not missing:
            raise TwinError(f"{path.name}: {_first_lines(error)}") from error
    for geom in missing:
        without.delete(geom)
    for asset in (*without.meshes, *without.textures, *without.materials):
        without.delete(asset)
    remark = f"{len(missing)} meshes are missing or do not load: they are left out"
    model = _compiled(path.name, without)
    _check_finite(path.name, model)
    return ModelFile(path, False, model, remarks=(remark,))


def _check_files(top: Path, path: Path, above: tuple[Path, ...]) -> None:
    """Raise `TwinError` if an MJCF, or one that it includes, names a file outside the folder of the model."""
    try:
        root = ElementTree.fromstring(path.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError, ElementTree.ParseError):
        # MuJoCo says it better.
        return
    for element in root.iter():
        if element.tag not in ("include", "model", "hfield", "skin") or not element.get("file"):
            continue
        place = _inside(top, str(element.get("file")))
        # MuJoCo refuses a file that includes itself.
        if element.tag == "include" and place not in above and place != path.resolve():
            _check_files(top, place, (*above, path.resolve()))


def _check_finite(name: str, model: mujoco.MjModel) -> None:
    """Raise `TwinError` for numbers of a model that are none, or below zero where none can be."""
    for what in ("body_pos", "body_quat", "body_ipos", "body_mass", "body_inertia", "jnt_pos", "jnt_axis", "qpos0"):
        if not np.isfinite(getattr(model, what)).all():
            raise TwinError(f"{name}: {what} of the model has values that are not finite, expected finite numbers")
    if not np.isfinite(model.opt.gravity).all():
        raise TwinError(f"{name}: gravity {model.opt.gravity.tolist()} given, expected finite numbers")
    for what in ("damping", "armature", "frictionloss"):
        values = getattr(model, f"dof_{what}")
        for dof in np.flatnonzero(~((values >= 0.0) & np.isfinite(values))):
            joint = model.joint(int(model.dof_jntid[dof])).name
            raise TwinError(f"{name}: {what} = {values[dof]:g} of joint {joint} given, expected 0 or more")
    for joint in range(model.njnt):
        low, high = model.jnt_range[joint]
        if (low or high) and not -np.inf < low < high < np.inf:
            raise TwinError(
                f"{name}: range {low:g} to {high:g} rad of joint {model.joint(joint).name} given, expected a lower end "
                "below the upper one"
            )


def _check_paths(path: Path, spec: mujoco.MjSpec) -> None:
    """Raise `TwinError` if a mesh or texture lies outside the folder of the model."""
    for directory, assets in ((spec.meshdir, spec.meshes), (spec.texturedir, spec.textures)):
        for asset in assets:
            if asset.file:
                _inside(path, asset.file, directory)


def _inside(model: Path, file: str, directory: str = "") -> Path:
    """Return the place of a file that a model names; raises `TwinError` if it is outside the model's folder."""
    folder = model.parent.resolve()
    place = (folder / directory / file).resolve()
    if not place.is_relative_to(folder):
        raise TwinError(
            f"{model.name}: file {shown(file)} given, which lies outside the folder of the model; expected files "
            "beside the model or below"
        )
    return place


def _parsed(name: str, parse: Callable[[], mujoco.MjSpec]) -> mujoco.MjSpec:
    try:
        return parse()
    except ValueError as error:
        raise TwinError(f"{name}: {_first_lines(error)}") from error


def _compiled(name: str, spec: mujoco.MjSpec) -> mujoco.MjModel:
    try:
        return spec.compile()
    except ValueError as error:
        raise TwinError(f"{name}: {_first_lines(error)}") from error


def _first_lines(error: Exception) -> str:
    """The message of MuJoCo on one line, without what repeats the word error."""
    text = " ".join(str(error).split())
    return re.sub(r"^(XML )?Error: (error )?", "", text)
