"""`arm.toml`: what a user says of an arm beside its model file, read strictly."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from hmtb_twin.files.errors import TwinError, shown
from hmtb_twin.files.toml_text import toml_table
from hmtb_twin.parameters.quantity import TAGS
from hmtb_twin.parameters.real_number import real_number

FILE_NAME = "arm.toml"
"""Name of the file in the folder of an arm."""

DRIVES = ("electric", "hydraulic")
"""Kinds of drives."""

SERVOS = ("torque", "flow")
"""Servo laws."""


@dataclass(frozen=True)
class Given:
    """A number that a user gives, with where it is from.

    Attributes:
        value: The number.
        source: Where it is from.
        tag: One of `TAGS`.
    """

    value: float
    source: str = "arm.toml"
    tag: str = "source"


UNITS: Mapping[str, str] = {
    **dict.fromkeys(("lower", "upper"), "rad"),
    **dict.fromkeys(("velocity", "stribeck_velocity", "no_load_speed"), "rad/s"),
    **dict.fromkeys(("effort", "coulomb"), "N m"),
    **dict.fromkeys(("damping", "gear_ratio", "static_ratio"), "1"),
    **dict.fromkeys(("kd", "viscous"), "N m s/rad"),
    **{"bandwidth": "Hz", "kp": "N m/rad", "delay": "samples", "armature": "kg m2", "current": "A"},
    **{"electrical_lag": "s", "displacement": "cm3/rad", "trapped_volume": "cm3"},
}
"""Units of the numbers of a joint."""

SIGNED = ("lower", "upper")
"""Numbers of a joint that may be below zero."""

MAY_VANISH = ("kd", "delay", "armature", "coulomb", "viscous")
"""Numbers of a joint that may be zero."""


@dataclass(frozen=True)
class JointSettings:
    """What a user says of a joint; None where nothing is said.

    Attributes:
        lower: Lower end of its range.
        upper: Upper end of its range.
        velocity: Velocity limit of its command.
        effort: Largest torque of its drive.
        bandwidth: Wanted bandwidth of its servo.
        damping: Wanted faster pole of its servo over the slower one; the larger, the more it is damped.
        kp: Stiffness of its servo, with `kd` in place of the wanted bandwidth.
        kd: Damping of its servo.
        delay: Delay of its measured angle on the bus.
        armature: Inertia of the rotor at the joint.
        gear_ratio: Gear ratio of an electric drive.
        current: Largest current of an electric drive.
        electrical_lag: Inductance over resistance of its motor.
        coulomb: Dry friction.
        viscous: Viscous friction.
        static_ratio: Breakaway over Coulomb friction.
        stribeck_velocity: Velocity over which friction falls from breakaway to Coulomb friction.
        displacement: Displacement of a hydraulic drive.
        trapped_volume: Oil in both chambers and lines of a hydraulic drive.
        no_load_speed: Speed of the drive without load.
    """

    lower: Given | None = None
    upper: Given | None = None
    velocity: Given | None = None
    effort: Given | None = None
    bandwidth: Given | None = None
    damping: Given | None = None
    kp: Given | None = None
    kd: Given | None = None
    delay: Given | None = None
    armature: Given | None = None
    gear_ratio: Given | None = None
    current: Given | None = None
    electrical_lag: Given | None = None
    coulomb: Given | None = None
    viscous: Given | None = None
    static_ratio: Given | None = None
    stribeck_velocity: Given | None = None
    displacement: Given | None = None
    trapped_volume: Given | None = None
    no_load_speed: Given | None = None


@dataclass(frozen=True)
class PayloadSettings:
    """A payload: mass, kg, centre of mass in the tool frame (3,), m, and inertia about it (6,), kg m^2."""

    mass: float
    centre: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class ArmSettings:
    """What a user says of an arm; empty where nothing is said.

    Attributes:
        title: One line for lists.
        model: Its model file, relative to the folder of the settings, or a file of example-robot-data.
        joints: Its joints from the base outward.
        locked: Where other joints are held, rad or m.
        tool: Body or site at the tool.
        drives: Kind of its drives.
        servo: Servo law; empty for that of the kind of drives.
        sample_rate: Rate of the position loop, Hz.
        poses: Joint angles of its poses, rad.
        operating_pose: The pose at which joints are excited.
        payloads: Its payloads by name.
        every_joint: What is said of all joints.
        joint: What is said of single joints, by name.
    """

    title: str = ""
    model: str = ""
    joints: tuple[str, ...] = ()
    locked: Mapping[str, float] = field(default_factory=dict)
    tool: str = ""
    drives: str = "electric"
    servo: str = ""
    sample_rate: int = 50
    poses: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    operating_pose: str = ""
    payloads: Mapping[str, PayloadSettings] = field(default_factory=dict)
    every_joint: JointSettings = field(default_factory=JointSettings)
    joint: Mapping[str, JointSettings] = field(default_factory=dict)

    def of_joint(self, name: str) -> JointSettings:
        """What is said of a joint: of it alone, else of all."""
        own = self.joint.get(name, JointSettings())
        chosen = {}
        for entry in fields(JointSettings):
            given = getattr(own, entry.name)
            chosen[entry.name] = getattr(self.every_joint, entry.name) if given is None else given
        return JointSettings(**chosen)


SLOWEST, FASTEST = 50, 1000
"""Rates of the position loop, Hz."""


def read_arm_toml(path: Path) -> ArmSettings:
    """Read the settings of an arm.

    Raises:
        TwinError: The file cannot be read, is no TOML, or has a key or a value that is none.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is no text"
        raise TwinError(f"cannot read {str(path)!r}: {reason}") from error
    table = toml_table(text, path.name)
    try:
        return _settings(table)
    except TwinError as error:
        raise TwinError(f"{path.name}: {error}") from error


def _settings(table: Mapping[str, Any]) -> ArmSettings:
    known = {entry.name for entry in fields(ArmSettings)}
    _check_keys("arm", table, known)
    values: dict[str, Any] = {}
    for key in ("title", "model", "tool", "drives", "servo", "operating_pose"):
        if key in table:
            values[key] = _text(key, table[key])
    for key, available in (("drives", DRIVES), ("servo", SERVOS)):
        if values.get(key) and values[key] not in available:
            raise TwinError(f"{key} = {shown(values[key])} given, expected {' or '.join(available)}")
    if "joints" in table:
        values["joints"] = tuple(_text("joints", name) for name in _sequence("joints", table["joints"]))
    if "locked" in table:
        locked = _mapping("locked", table["locked"])
        values["locked"] = {name: _finite(f"locked.{name}", value) for name, value in locked.items()}
    if "sample_rate" in table:
        rate = table["sample_rate"]
        if isinstance(rate, bool) or not isinstance(rate, int) or not SLOWEST <= rate <= FASTEST:
            raise TwinError(
                f"sample_rate = {shown(rate)} given, expected a whole number from {SLOWEST} to {FASTEST} Hz"
            )
        values["sample_rate"] = rate
    if "poses" in table:
        poses = _mapping("poses", table["poses"])
        values["poses"] = {name: _numbers(f"poses.{name}", angles) for name, angles in poses.items()}
    if "payloads" in table:
        payloads = _mapping("payloads", table["payloads"])
        values["payloads"] = {name: _payload(f"payloads.{name}", payload) for name, payload in payloads.items()}
    if "every_joint" in table:
        values["every_joint"] = _joint("every_joint", table["every_joint"])
    if "joint" in table:
        joints = _mapping("joint", table["joint"])
        values["joint"] = {name: _joint(f"joint.{name}", settings) for name, settings in joints.items()}
    return ArmSettings(**values)


def _joint(name: str, table: object) -> JointSettings:
    mapping = _mapping(name, table)
    _check_keys(name, mapping, {entry.name for entry in fields(JointSettings)})
    values = {}
    for key, value in mapping.items():
        values[key] = _given(name, key, value)
    settings = JointSettings(**values)
    if settings.lower and settings.upper and not settings.lower.value < settings.upper.value:
        raise TwinError(f"{name}: a range from {settings.lower.value:g} to {settings.upper.value:g} rad given")
    return settings


def _given(joint: str, key: str, value: object) -> Given:
    """A number of a joint, or a table of value, source and tag."""
    name, source, tag = f"{joint}.{key}", Given.source, Given.tag
    if isinstance(value, Mapping):
        _check_keys(name, value, {"value", "source", "tag"})
        if "value" not in value:
            raise TwinError(f"{name}: a table without a value given, expected value, and source and tag if known")
        source = _text(f"{name}.source", value.get("source", source))
        tag = _text(f"{name}.tag", value.get("tag", tag))
        if tag not in TAGS:
            raise TwinError(f"{name}: tag {shown(tag)} given, expected one of {', '.join(TAGS)}")
        value = value["value"]
    number = _finite(name, value)
    if key not in SIGNED and (number < 0.0 or (number == 0.0 and key not in MAY_VANISH)):
        least = "0 or more" if key in MAY_VANISH else "above 0"
        raise TwinError(f"{name} = {shown(value)} given, expected {least}, in {UNITS[key]}")
    return Given(number, source, tag)


def _payload(name: str, table: object) -> PayloadSettings:
    mapping = _mapping(name, table)
    _check_keys(name, mapping, {"mass", "centre", "inertia"})
    mass = _finite(f"{name}.mass", mapping.get("mass"))
    centre = _numbers(f"{name}.centre", mapping.get("centre", (0.0, 0.0, 0.0)))
    inertia = _numbers(f"{name}.inertia", mapping.get("inertia", (0.0,) * 6))
    if len(inertia) == 3:
        # Three are principal moments along the axes of the tool.
        inertia = (*inertia, 0.0, 0.0, 0.0)
    if mass <= 0.0 or len(centre) != 3 or len(inertia) != 6:
        raise TwinError(
            f"{name}: expected a mass above 0 kg, a centre of three numbers in m and an inertia of three or six, kg m2"
        )
    # Their lengths are checked.
    x, y, z = centre
    xx, yy, zz, xy, xz, yz = inertia
    return PayloadSettings(mass, (x, y, z), (xx, yy, zz, xy, xz, yz))


def _check_keys(name: str, table: Mapping[str, Any], known: set[str]) -> None:
    for key in table:
        if key not in known:
            raise TwinError(f"{name}: unknown key {shown(key)}, available: {', '.join(sorted(known))}")


def _text(name: str, value: object) -> str:
    if not isinstance(value, str):
        raise TwinError(f"{name} = {shown(value)} given, expected a text")
    return value


def _mapping(name: str, value: object) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise TwinError(f"{name} = {shown(value)} given, expected a table")
    return value


def _sequence(name: str, value: object) -> Sequence[Any]:
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise TwinError(f"{name} = {shown(value)} given, expected an array")
    return value


def _numbers(name: str, value: object) -> tuple[float, ...]:
    numbers = []
    for i, number in enumerate(_sequence(name, value)):
        numbers.append(_finite(f"{name}[{i}]", number))
    return tuple(numbers)


def _finite(name: str, value: object) -> float:
    number = real_number(value)
    if not abs(number) < float("inf"):
        raise TwinError(f"{name} = {shown(value)} given, expected a finite number")
    return number
