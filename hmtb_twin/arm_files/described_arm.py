"""Description of an arm from its files: settings, model file, and rules for the rest."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from hmtb_twin.arm_files.model_file import ModelFile, gravity_of, read_model_file
from hmtb_twin.arm_files.rigid_arm import RigidArm, rigid_arm
from hmtb_twin.arm_files.second_reading import check_second_reading
from hmtb_twin.files.errors import TwinError, shown
from hmtb_twin.parameters.arm_description import ArmDescription, RigidModel
from hmtb_twin.parameters.arm_toml import ArmSettings
from hmtb_twin.parameters.drives import Actuator, Drive
from hmtb_twin.parameters.payloads import Load, Payload
from hmtb_twin.parameters.rules import check_pose, joint_records, joints_beyond, recorder
from hmtb_twin.parameters.servo_valve import POWER_UNIT, PowerUnit
from hmtb_twin.parameters.values import Motion

OF_JOINTS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
"""Kinds of transmissions by which an actuator acts on a joint."""

FAVOURITES = ("ready", "home", "standing", "half_sitting", "default", "middle")
"""Names of poses in which joints are preferably excited."""

HOLDING = 0.7
"""Part of its largest torque that a drive may need to hold the arm at the operating pose."""

LIGHT = "light"
"""Name of the pose that a rule finds where the drives hardly hold the arm at its others."""

POSES_TRIED = 2000
"""Poses among which it is found."""

CLEARANCE = 0.2
"""Least distance of the operating pose from the ends of ranges, rad, where they leave so much."""

SAMPLES = 200
"""Random poses among which the largest weight on a joint is sought."""


def described_arm(name: str, path: Path, settings: ArmSettings) -> ArmDescription:
    """Describe the arm in a model file.

    Args:
        name: Name of the arm.
        path: The model file, MJCF or URDF.
        settings: What its user says of it.

    Raises:
        TwinError: The file or the settings are wrong, or no arm follows from them.
    """
    _check_chain_settings(settings)
    file = read_model_file(path)
    arm = rigid_arm(file, joints=settings.joints, locked=settings.locked, tool=settings.tool)
    remarks = (*arm.remarks, *check_second_reading(file, arm), *_unread_actuators(file.model))
    gravity = -float(gravity_of(file.model)[2]) if settings.gravity is None else settings.gravity
    unknown = [joint for joint in settings.studied if joint not in arm.joints]
    if unknown:
        raise TwinError(f"studied: {', '.join(unknown)} given, available: {', '.join(arm.joints)}")
    read = {joint: _read(file, arm, joint) for joint in arm.joints}
    weights = Weights(arm.mjcf, gravity)
    records = joint_records(settings, read, weights.largest)
    resolvers, of_resolvers = recorder(settings.resolver)
    poses, operating, notes = _settled_poses(file, arm, settings, records.motions, records.efforts, weights)
    return ArmDescription(
        name=name,
        description=settings.title or f"{len(arm.joints)} joints of {path.name}, {settings.drives} drives",
        joints=arm.joints,
        motions=records.motions,
        actuators=records.drives,
        servos=records.servos,
        bus=records.bus,
        poses=poses,
        operating_pose=operating,
        payloads=_payloads(settings),
        # Servos are tuned without a load, as a manufacturer would who does not know it.
        tuned_payload=settings.tuned_payload or "none",
        gravity=gravity,
        rigid=RigidModel(arm.mjcf, str(path), arm.locked),
        # A flow servo needs joints that are heavy enough for their oil; one that asks for a torque does not.
        servo=settings.servo or "torque",
        studied=settings.studied,
        sample_rate=settings.sample_rate,
        power_unit=_power_unit(records.drives.values()),
        recorder=resolvers,
        given_gains=records.given_gains,
        numbers=(*records.numbers, *of_resolvers),
        remarks=(*remarks, *notes),
    )


def _check_chain_settings(settings: ArmSettings) -> None:
    """Raise `TwinError` for settings that only the chain of the test bed has."""
    if settings.indexed:
        raise TwinError(
            f"indexed = {shown(list(settings.indexed))} given, which only arms with links have; expected the joints "
            "that do not move in locked, with their angles"
        )
    boxes = [name for name, load in settings.payloads.items() if load.size]
    if boxes:
        raise TwinError(
            f"payloads.{boxes[0]}: size given, which only payloads of arms with links have; expected centre and inertia"
        )


def _payloads(settings: ArmSettings) -> dict[str, Payload | Load | None]:
    """Payloads of an arm by name: none at all, and the user's."""
    payloads: dict[str, Payload | Load | None] = {"none": None}
    for name, load in settings.payloads.items():
        payloads[name] = Load(load.mass, load.centre, load.inertia)
    if settings.tuned_payload and settings.tuned_payload not in payloads:
        raise TwinError(f"tuned_payload = {shown(settings.tuned_payload)} given, available: {', '.join(payloads)}")
    return payloads


def _read(file: ModelFile, arm: RigidArm, joint: str) -> dict[str, float]:
    """Numbers of a joint that the model file gives, by the names of settings."""
    model, i = file.model, arm.ids[arm.joints.index(joint)]
    read: dict[str, float] = {}
    if model.jnt_limited[i]:
        read["lower"], read["upper"] = (float(end) for end in model.jnt_range[i])
    dof = int(model.jnt_dofadr[i])
    facts = file.facts.get(joint)
    # A URDF says of a joint what MuJoCo's model of it does not keep.
    if facts is not None:
        values = {
            "effort": facts.effort,
            "velocity": facts.velocity,
            "coulomb": facts.coulomb,
            "viscous": facts.viscous,
        }
        return read | {key: value for key, value in values.items() if value is not None}
    for key, value in (
        ("armature", model.dof_armature[dof]),
        ("coulomb", model.dof_frictionloss[dof]),
        ("viscous", model.dof_damping[dof]),
        ("effort", _torque_limit(model, i)),
    ):
        # Zero is what MJCF has where nothing is written.
        if float(np.max(value)) > 0.0:
            read[key] = float(np.max(value))
    return read


def _unread_actuators(model: mujoco.MjModel) -> Iterator[str]:
    """Say which actuators of an MJCF act on no joint alone, so that nothing is read of them."""
    names = []
    for k in range(model.nu):
        if int(model.actuator_trntype[k]) not in OF_JOINTS:
            names.append(model.actuator(k).name or f"number {k}")
    if names:
        yield f"actuators that act on no joint alone give no torque limit: {', '.join(names)}"


def _is_limited_motor(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether the control of an actuator is a torque, or that over its gain, and has a range."""
    is_motor = model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_NONE
    has_control = model.actuator_ctrlnum[actuator] > 0
    return bool(is_motor and has_control and model.actuator_ctrllimited[model.actuator_ctrladr[actuator]])


def _torque_limit(model: mujoco.MjModel, joint: int) -> float:
    """Largest torque on a joint both ways that an MJCF allows, N m; 0 where it gives none."""
    in_all = float(np.abs(model.jnt_actfrcrange[joint]).min()) if model.jnt_actfrclimited[joint] else np.inf
    drives = []
    for k in range(model.nu):
        if int(model.actuator_trntype[k]) not in OF_JOINTS or model.actuator_trnid[k, 0] != joint:
            continue
        gear = abs(float(model.actuator_gear[k, 0]))
        # A range that is not the same both ways has its smaller side both ways.
        if model.actuator_forcelimited[k]:
            drives.append(gear * float(np.abs(model.actuator_forcerange[k]).min()))
        elif _is_limited_motor(model, k):
            gain = abs(float(model.actuator_gainprm[k, 0]))
            drives.append(gear * gain * float(np.abs(model.actuator_ctrlrange[model.actuator_ctrladr[k]]).min()))
    # Several actuators of one joint pull together.
    limit = min(in_all, sum(drives) if drives else np.inf)
    return limit if np.isfinite(limit) else 0.0


class Weights:
    """Torques that hold the bodies of an arm.

    Args:
        mjcf: The bodies.
        gravity: Acceleration of gravity, m/s^2.
    """

    def __init__(self, mjcf: str, gravity: float) -> None:
        self._model = mujoco.MjModel.from_xml_string(mjcf)
        self._model.opt.gravity = [0.0, 0.0, -gravity]
        self._data = mujoco.MjData(self._model)

    def at(self, angles: Sequence[float]) -> np.ndarray:
        """Torques (n,), N m, at joint angles (n,), rad."""
        self._data.qpos[:] = angles
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        torques = np.empty(self._model.nv)
        mujoco.mj_rne(self._model, self._data, 0, torques)
        return torques

    def share(self, angles: Sequence[float], efforts: Mapping[str, float]) -> float:
        """Largest torque over that of its drive, N m, at joint angles (n,), rad."""
        return float((np.abs(self.at(angles)) / np.array(list(efforts.values()))).max())

    def largest(self, motions: Mapping[str, Motion]) -> np.ndarray:
        """Largest torque on each joint (n,), N m, over random poses in its range."""
        # The same poses each time: what is assumed must not depend on chance.
        rng = np.random.default_rng(0)
        lower = [motion.lower for motion in motions.values()]
        upper = [motion.upper for motion in motions.values()]
        drawn = rng.uniform(lower, upper, (SAMPLES, len(lower)))
        return np.max([np.abs(self.at(angles)) for angles in drawn], axis=0)


def _settled_poses(
    file: ModelFile,
    arm: RigidArm,
    settings: ArmSettings,
    motions: Mapping[str, Motion],
    efforts: Mapping[str, float],
    weights: Weights,
) -> tuple[dict[str, tuple[float, ...]], str, tuple[str, ...]]:
    """Poses by name, the one at which joints are excited, and what is to be said of it.

    Raises:
        TwinError: A pose of the user beyond a range, an unknown operating pose, or one that the drives cannot hold.
    """
    remarks: tuple[str, ...] = ()
    poses = _poses(file, arm, settings, motions)
    operating = settings.operating_pose or _operating_pose(poses, motions, efforts, weights)
    if not settings.operating_pose and weights.share(poses[operating], efforts) >= HOLDING:
        light = _lightest(motions, efforts, weights)
        if weights.share(light, efforts) < weights.share(poses[operating], efforts):
            poses, operating = {**poses, LIGHT: light}, LIGHT
            remarks = (*remarks, f"the pose {LIGHT} is a rule's: at others the drives hardly hold the arm")
    if operating not in poses:
        raise TwinError(f"operating_pose = {operating!r} given, available: {', '.join(poses)}")
    remarks = (*remarks, *_load_remarks(arm.joints, poses[operating], operating, efforts, weights))
    return poses, operating, remarks


def _poses(
    file: ModelFile, arm: RigidArm, settings: ArmSettings, motions: Mapping[str, Motion]
) -> dict[str, tuple[float, ...]]:
    """Poses by name: the user's, keyframes and group states of the files, the middle of the ranges, and zero."""
    poses: dict[str, tuple[float, ...]] = {}
    # The user's stand first: a pose of the same name in the files does not replace them.
    for name, angles in settings.poses.items():
        check_pose(name, angles, motions)
        poses[name] = angles
    model = file.model
    addresses = [int(model.jnt_qposadr[i]) for i in arm.ids]
    for key in range(model.nkey):
        poses.setdefault(model.key(key).name or f"key_{key}", tuple(float(model.key_qpos[key][a]) for a in addresses))
    for name, state in _group_states(file.path).items():
        if all(joint in state for joint in arm.joints):
            poses.setdefault(name, tuple(state[joint] for joint in arm.joints))
    middle = {joint: 0.5 * (motion.lower + motion.upper) for joint, motion in motions.items()}
    poses.setdefault("middle", tuple(middle.values()))
    poses.setdefault("zero", (0.0,) * len(arm.joints))
    inside = {}
    for name, angles in poses.items():
        # A pose of the files that settings have put out of range, or zero where the range leaves it out, is none.
        if not joints_beyond(angles, motions):
            inside[name] = angles
    return inside


def _group_states(path: Path) -> dict[str, dict[str, float]]:
    """Joint angles by name of the group states of an SRDF beside a URDF, as MoveIt has them."""
    states: dict[str, dict[str, float]] = {}
    for folder in (path.parent, path.parent.parent / "srdf"):
        candidate = folder / f"{path.stem.removesuffix('_robot')}.srdf"
        if not candidate.is_file():
            continue
        try:
            root = ElementTree.fromstring(candidate.read_text(encoding="utf-8-sig"))
        except (OSError, UnicodeDecodeError, ElementTree.ParseError):
            # A pose is a convenience: a file beside the model that cannot be read is none.
            continue
        for state in root.iter("group_state"):
            angles = states.setdefault(str(state.get("name")), {})
            for joint in state.iter("joint"):
                try:
                    angles[str(joint.get("name"))] = float(str(joint.get("value")))
                except ValueError:
                    continue
    return states


def _operating_pose(
    poses: Mapping[str, tuple[float, ...]],
    motions: Mapping[str, Motion],
    efforts: Mapping[str, float],
    weights: Weights,
) -> str:
    """The pose at which joints are excited: clear of the ends of ranges, and held with torque to spare."""
    ratios = {name: weights.share(angles, efforts) for name, angles in poses.items()}

    def is_clear(name: str) -> bool:
        for motion, angle in zip(motions.values(), poses[name], strict=True):
            distance = min(CLEARANCE, 0.25 * (motion.upper - motion.lower))
            if not motion.lower + distance <= angle <= motion.upper - distance:
                return False
        return True

    clear = [name for name in poses if is_clear(name)]
    # Most files have none of these names; then the first pose that the drives hold easily will do.
    favourites = [name for name in FAVOURITES if name in clear]
    for name in (*favourites, *clear):
        if ratios[name] < HOLDING:
            return name
    # A weak arm is excited where it is least loaded.
    return min(clear or poses, key=lambda name: ratios[name])


def _lightest(motions: Mapping[str, Motion], efforts: Mapping[str, float], weights: Weights) -> tuple[float, ...]:
    """The pose, of many clear of the ends of ranges, at which the weight takes the least part of the drives' torque."""
    # The same poses each time: what is assumed must not depend on chance.
    rng = np.random.default_rng(1)
    lower, upper = (np.array([getattr(motion, end) for motion in motions.values()]) for end in ("lower", "upper"))
    room = np.minimum(CLEARANCE, 0.25 * (upper - lower))
    tried = rng.uniform(lower + room, upper - room, (POSES_TRIED, len(lower)))
    best = min(tried, key=lambda angles: weights.share(angles, efforts))
    # Three digits can be typed.
    return tuple(round(float(angle), 3) for angle in best)


def _load_remarks(
    joints: Sequence[str], angles: Sequence[float], pose: str, efforts: Mapping[str, float], weights: Weights
) -> Iterator[str]:
    """Say which drives hardly hold the arm at its operating pose.

    Raises:
        TwinError: A drive cannot hold it.
    """
    shares = np.abs(weights.at(angles)) / np.array(list(efforts.values()))
    for joint, share in zip(joints, shares, strict=True):
        if share >= 1.0:
            raise TwinError(
                f"at the pose {pose} the drive of {joint} would need {100 * share:.0f} % of its largest torque to hold "
                "the arm, expected a pose in arm.toml, or an effort, that it can hold"
            )
        if share >= HOLDING:
            yield (
                f"at the pose {pose} the weight takes {100 * share:.0f} % of the torque of {joint}: little is left to "
                "move it, and its answer is no linear one"
            )


def _power_unit(drives: Iterable[Drive]) -> PowerUnit:
    """A pump that feeds all valves of an arm at once, with the droop and the accumulator that go with its size."""
    # A fifth to spare, as the pump of the test bed has it.
    flow = 1.2 * sum(drive.rated_flow for drive in drives if isinstance(drive, Actuator))
    size = max(flow / POWER_UNIT.largest_flow, 1.0)
    return PowerUnit(size * POWER_UNIT.largest_flow, size * POWER_UNIT.droop, size * POWER_UNIT.capacity)
