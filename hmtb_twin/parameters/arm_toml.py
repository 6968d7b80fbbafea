"""`arm.toml`: what is said of an arm beside its model file, read strictly."""

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
class Source:
    """Where a number is from.

    Attributes:
        source: In words.
        tag: One of `TAGS`.
    """

    source: str = FILE_NAME
    tag: str = "source"


@dataclass(frozen=True)
class Given(Source):
    """A number that is given, with where it is from.

    Attributes:
        value: The number.
        source: Where it is from.
        tag: One of `TAGS`.
    """

    value: float = 0.0


UNITS: Mapping[str, str] = {
    **dict.fromkeys(("lower", "upper"), "rad"),
    **dict.fromkeys(("velocity", "stribeck_velocity", "slip_velocity", "no_load_speed"), "rad/s"),
    **dict.fromkeys(("slow_pole", "fast_pole"), "rad/s"),
    **dict.fromkeys(("effort", "coulomb"), "N m"),
    **dict.fromkeys(("damping", "gear_ratio", "static_ratio", "oil_damping"), "1"),
    **dict.fromkeys(("coulomb_part", "viscous_part", "brake_part", "load_loss"), "1"),
    **dict.fromkeys(("kd", "viscous"), "N m s/rad"),
    **dict.fromkeys(("electrical_lag", "torque_lag", "bristle_time"), "s"),
    **dict.fromkeys(("armature", "rotor_inertia"), "kg m2"),
    **{"bandwidth": "Hz", "kp": "N m/rad", "delay": "samples", "current": "A", "torque_constant": "N m/A"},
    **{"resistance": "ohm", "bus_voltage": "V", "displacement": "cm3/rad", "trapped_volume": "cm3"},
}
"""Units of the numbers of a joint."""

LINK_UNITS: Mapping[str, str] = {"length": "m", "mass": "kg", "radius": "m"}
"""Units of the numbers of a link."""

PAYLOAD_UNITS: Mapping[str, str] = {"mass": "kg", "size": "m"}
"""Units of those numbers of a payload that have a source."""

RESOLVER_UNITS: Mapping[str, str] = {"bits": "bit", "noise": "rad"}
"""Units of the numbers of the resolvers."""

RESOLVER_RANGES: Mapping[str, tuple[float, float, str]] = {
    "bits": (8.0, 32.0, "a whole number of bits over one turn, 8 to 32"),
    "noise": (0.0, 0.1, "0 rad to 0.1 rad"),
}
"""Least and largest of these numbers, and both in words."""

SIGNED = ("lower", "upper")
"""Numbers of a joint that may be below zero."""

NEGATIVE = ("slow_pole", "fast_pole")
"""Numbers of a joint that are below zero."""

MAY_VANISH = (
    "kd",
    "delay",
    "armature",
    "coulomb",
    "viscous",
    "coulomb_part",
    "viscous_part",
    "bristle_time",
    "load_loss",
)
"""Numbers of a joint that may be zero."""

BOUNDS: Mapping[str, tuple[float, float]] = {
    **dict.fromkeys(("lower", "upper"), (-1000.0, 1000.0)),
    **dict.fromkeys(("velocity", "no_load_speed", "stribeck_velocity"), (1e-3, 1e4)),
    "slip_velocity": (1e-5, 10.0),
    **dict.fromkeys(("slow_pole", "fast_pole"), (-1e5, -1e-3)),
    **dict.fromkeys(("effort", "coulomb", "viscous"), (1e-6, 1e7)),
    **dict.fromkeys(("kp", "kd"), (1e-6, 1e10)),
    **dict.fromkeys(("coulomb_part", "viscous_part", "load_loss"), (1e-9, 1.0)),
    **dict.fromkeys(("armature", "rotor_inertia"), (1e-12, 1e5)),
    **dict.fromkeys(("electrical_lag", "torque_lag", "bristle_time"), (1e-6, 10.0)),
    **{"bandwidth": (1e-3, 500.0), "damping": (1.0, 1e3), "static_ratio": (1.0, 100.0), "delay": (0.0, 100.0)},
    **{"gear_ratio": (1e-2, 1e5), "current": (1e-4, 1e5), "torque_constant": (1e-6, 1e4), "resistance": (1e-6, 1e6)},
    **{"bus_voltage": (1e-2, 1e5), "brake_part": (1e-3, 100.0), "oil_damping": (1e-3, 10.0)},
    **{"displacement": (1e-4, 1e6), "trapped_volume": (1e-4, 1e8)},
}
"""Least and largest of the numbers of a joint, but for zero where it may be zero: what no machine has is an error in
typing or in units, and would give numbers that are none."""

OF_ONE_KIND: Mapping[str, tuple[str, ...]] = {
    "electric": (
        "armature", "rotor_inertia", "gear_ratio", "current", "electrical_lag", "torque_constant", "resistance",
        "bus_voltage", "brake_part",
    ),
    "hydraulic": ("displacement", "trapped_volume", "oil_damping"),
}  # fmt: skip
"""Numbers of a joint that only drives of one kind have."""

RIVALS = (
    ("bandwidth", "slow_pole"),
    ("damping", "fast_pole"),
    ("coulomb", "coulomb_part"),
    ("viscous", "viscous_part"),
    ("armature", "rotor_inertia"),
    ("no_load_speed", "bus_voltage"),
    ("effort", "torque_constant"),
    ("effort", "displacement"),
    ("bandwidth", "kp"),
    ("damping", "kp"),
)
"""Pairs of numbers of a joint that say the same: one of them is given."""


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
        slow_pole: Wanted slower pole of its servo, in place of `bandwidth`.
        fast_pole: Wanted faster pole, in place of `damping`.
        torque_lag: Longest lag of the torque behind its command for which the servo is tuned.
        oil_damping: Damping ratio of the oil's resonance at which a flow servo aims.
        coulomb_part: Dry friction as a part of the largest torque, in place of `coulomb`.
        viscous_part: Viscous friction at the speed without load as a part of the largest torque, in place of `viscous`.
        slip_velocity: Velocity below which the bristles of dry friction hardly slip.
        bristle_time: Damping of the bristles over their stiffness.
        load_loss: Dry friction that goes with the load, as a part of the torque that the drive exerts.
        torque_constant: Torque per current of the motor of an electric drive before its gear, in place of `effort`.
        resistance: Resistance of its winding.
        rotor_inertia: Inertia of its rotor before the gear, in place of `armature`.
        bus_voltage: Largest voltage of the motor, in place of `no_load_speed`.
        brake_part: Torque of the brake that holds without power, as a part of the largest torque.
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
    slow_pole: Given | None = None
    fast_pole: Given | None = None
    torque_lag: Given | None = None
    oil_damping: Given | None = None
    coulomb_part: Given | None = None
    viscous_part: Given | None = None
    slip_velocity: Given | None = None
    bristle_time: Given | None = None
    load_loss: Given | None = None
    torque_constant: Given | None = None
    resistance: Given | None = None
    rotor_inertia: Given | None = None
    bus_voltage: Given | None = None
    brake_part: Given | None = None


@dataclass(frozen=True)
class LinkSettings:
    """A link of the test bed's chain as a uniform solid cylinder along its own x axis.

    Attributes:
        length: Its length, m.
        mass: Its mass, kg.
        radius: Its radius, m.
    """

    length: Given
    mass: Given
    radius: Given


@dataclass(frozen=True)
class PayloadSettings:
    """A payload.

    Attributes:
        mass: Its mass, kg.
        centre: Its centre of mass in the tool frame (3,), m.
        inertia: Its inertia about the centre (6,), kg m^2.
        size: Sides (3,), m, of a uniform box that begins at the tool, in place of centre and inertia; empty without.
        sources: Where mass and size are from.
    """

    mass: float
    centre: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]
    size: tuple[float, ...] = ()
    sources: Mapping[str, Source] = field(default_factory=dict)


@dataclass(frozen=True)
class ResolverSettings:
    """What a user says of the resolvers or encoders of an arm; None where nothing is said.

    Attributes:
        bits: Their resolution over one turn of the joint.
        noise: Standard deviation of their noise, rad.
    """

    bits: Given | None = None
    noise: Given | None = None


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
        resolver: Resolution and noise of the measured angles.
        gravity: Acceleration of gravity, m/s^2; None for that of the model file.
        indexed: Joints that a pin holds, of an arm with `link`.
        studied: Joints on which linear models are compared with simulation; all when empty.
        poses: Joint angles of its poses, rad.
        operating_pose: The pose at which joints are excited.
        payloads: Its payloads by name.
        tuned_payload: The one for which servos are tuned; empty for none.
        every_joint: What is said of all joints.
        joint: What is said of single joints, by name.
        link: Links of an arm that has the chain of the test bed, by the joint that moves them.
    """

    title: str = ""
    model: str = ""
    joints: tuple[str, ...] = ()
    locked: Mapping[str, float] = field(default_factory=dict)
    tool: str = ""
    drives: str = "electric"
    servo: str = ""
    sample_rate: int = 50
    resolver: ResolverSettings = field(default_factory=ResolverSettings)
    gravity: float | None = None
    indexed: tuple[str, ...] = ()
    studied: tuple[str, ...] = ()
    poses: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    operating_pose: str = ""
    payloads: Mapping[str, PayloadSettings] = field(default_factory=dict)
    tuned_payload: str = ""
    every_joint: JointSettings = field(default_factory=JointSettings)
    joint: Mapping[str, JointSettings] = field(default_factory=dict)
    link: Mapping[str, LinkSettings] = field(default_factory=dict)

    def of_joint(self, name: str) -> JointSettings:
        """What is said of a joint: of it alone, else of all."""
        own = self.joint.get(name, JointSettings())
        chosen = {}
        for entry in fields(JointSettings):
            given = getattr(own, entry.name)
            if given is None and not any(getattr(own, rival) for rival in _rivals(entry.name)):
                given = getattr(self.every_joint, entry.name)
            chosen[entry.name] = given
        return JointSettings(**chosen)


STRONGEST = 1000.0
"""Largest acceleration of gravity, m/s^2."""

SLOWEST, FASTEST = 50, 1000
"""Rates of the position loop, Hz."""


def read_arm_toml(path: Path) -> ArmSettings:
    """Read the settings of an arm.

    Raises:
        TwinError: The file, or the one that it names as its base, cannot be read, is no TOML, or has a key or a value
            that is none.
    """
    table = _table(path, ())
    try:
        return _settings(table)
    except TwinError as error:
        raise TwinError(f"{path.name}: {error}") from error


def _table(path: Path, above: tuple[Path, ...]) -> dict[str, Any]:
    """Table of a file, laid over that of its base."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is no text"
        raise TwinError(f"cannot read {str(path)!r}: {reason}") from error
    table = toml_table(text, path.name)
    if "base" not in table:
        return table
    # Arms of one machine share most of their numbers.
    name = table.pop("base")
    base = path.parent / str(name)
    # A name that leads out of the folder, or that a number only looks like, is none.
    if not isinstance(name, str) or base.resolve().parent != path.resolve().parent or not base.is_file():
        raise TwinError(f"{path.name}: base = {shown(name)} given, expected the name of another file of its folder")
    if base.resolve() in (path.resolve(), *above):
        raise TwinError(f"{path.name}: base = {shown(name)} given, which has this file as its own base")
    return _laid_over(_table(base, (path.resolve(), *above)), table)


def _laid_over(base: Mapping[str, Any], table: Mapping[str, Any]) -> dict[str, Any]:
    """One table over another one: tables within are joined, all else is replaced, a number with its source whole."""
    joined = dict(base)
    for key, value in table.items():
        beneath = base.get(key)
        if isinstance(beneath, Mapping) and isinstance(value, Mapping) and not _is_number(beneath, value):
            value = _laid_over(beneath, value)
        joined[key] = value
    return joined


def _is_number(*tables: Mapping[str, Any]) -> bool:
    """Whether one of some tables is a number with its source, or a source: one thing, which is replaced whole."""
    return any(key in table for table in tables for key in ("value", "source"))


def _rivals(name: str) -> list[str]:
    """Numbers of a joint that say the same as another one."""
    return [other for pair in RIVALS for other in pair if name in pair and other != name]


def _settings(table: Mapping[str, Any]) -> ArmSettings:
    known = {entry.name for entry in fields(ArmSettings)} | {"base", "sources"}
    _check_keys("arm", table, known)
    sources = _sources(table.get("sources", {}))
    values = _plain_settings(table)
    kind = values.get("drives", ArmSettings.drives)
    if "resolver" in table:
        values["resolver"] = _resolver(table["resolver"])
    if "payloads" in table:
        payloads = _mapping("payloads", table["payloads"])
        values["payloads"] = {
            name: _payload(f"payloads.{name}", payload, sources["payload"]) for name, payload in payloads.items()
        }
    if "every_joint" in table:
        values["every_joint"] = _joint("every_joint", table["every_joint"], sources["joint"], kind)
    if "joint" in table:
        joints = _mapping("joint", table["joint"])
        values["joint"] = {
            name: _joint(f"joint.{name}", settings, sources["joint"], kind) for name, settings in joints.items()
        }
    if "link" in table:
        links = _mapping("link", table["link"])
        values["link"] = {name: _link(f"link.{name}", link, sources["link"]) for name, link in links.items()}
    return ArmSettings(**values)


def _plain_settings(table: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of the arm itself that are texts, numbers, or lists and tables of them."""
    values: dict[str, Any] = {}
    for key in ("title", "model", "tool", "drives", "servo", "operating_pose", "tuned_payload"):
        if key in table:
            values[key] = _text(key, table[key])
    for key, available in (("drives", DRIVES), ("servo", SERVOS)):
        if values.get(key) and values[key] not in available:
            raise TwinError(f"{key} = {shown(values[key])} given, expected {' or '.join(available)}")
    if values.get("servo") == "flow" and values.get("drives", ArmSettings.drives) != "hydraulic":
        raise TwinError("servo = 'flow' given, which opens a valve, but electric drives have none; expected torque")
    for key in ("joints", "indexed", "studied"):
        if key in table:
            values[key] = tuple(_text(key, name) for name in _sequence(key, table[key]))
    if "gravity" in table:
        values["gravity"] = _finite("gravity", table["gravity"])
        if not 0.0 <= values["gravity"] <= STRONGEST:
            raise TwinError(f"gravity = {shown(table['gravity'])} given, expected 0 to {STRONGEST:g} m/s2, downward")
    if "locked" in table:
        locked = _mapping("locked", table["locked"])
        values["locked"] = {name: _finite(f"locked.{name}", value) for name, value in locked.items()}
    if "sample_rate" in table:
        rate = table["sample_rate"]
        # `True` is a whole number to Python.
        if isinstance(rate, bool) or not isinstance(rate, int) or not SLOWEST <= rate <= FASTEST:
            raise TwinError(
                f"sample_rate = {shown(rate)} given, expected a whole number from {SLOWEST} to {FASTEST} Hz"
            )
        values["sample_rate"] = rate
    if "poses" in table:
        poses = _mapping("poses", table["poses"])
        values["poses"] = {name: _numbers(f"poses.{name}", angles) for name, angles in poses.items()}
    return values


def _sources(table: object) -> dict[str, dict[str, Source]]:
    """Where plain numbers are from, by what they are of and by their names."""
    units = {"joint": UNITS, "link": LINK_UNITS, "payload": PAYLOAD_UNITS}
    mapping = _mapping("sources", table)
    _check_keys("sources", mapping, set(units))
    sources: dict[str, dict[str, Source]] = {}
    for kind, known in units.items():
        entries = _mapping(f"sources.{kind}", mapping.get(kind, {}))
        _check_keys(f"sources.{kind}", entries, set(known))
        sources[kind] = {}
        for name, entry in entries.items():
            where = f"sources.{kind}.{name}"
            # A text alone is the source of a number that somebody knows.
            pair = {"source": entry} if isinstance(entry, str) else _mapping(where, entry)
            _check_keys(where, pair, {"source", "tag"})
            sources[kind][name] = _source(where, pair, Source())
    return sources


def _source(name: str, table: Mapping[str, Any], usual: Source) -> Source:
    """The source and the tag in a table, else the usual ones."""
    source = _text(f"{name}.source", table.get("source", usual.source))
    tag = _text(f"{name}.tag", table.get("tag", usual.tag))
    if tag not in TAGS:
        raise TwinError(f"{name}: tag {shown(tag)} given, expected one of {', '.join(TAGS)}")
    return Source(source, tag)


def _with_source(name: str, value: object, usual: Source) -> tuple[object, Source]:
    """A plain value, or that of a table of value, source and tag, and where it is from."""
    if not isinstance(value, Mapping):
        return value, usual
    _check_keys(name, value, {"value", "source", "tag"})
    if "value" not in value:
        raise TwinError(f"{name}: a table without a value given, expected value, and source and tag if known")
    return value["value"], _source(name, value, usual)


def _joint(name: str, table: object, sources: Mapping[str, Source], kind: str) -> JointSettings:
    mapping = _mapping(name, table)
    known = {entry.name for entry in fields(JointSettings)}
    _check_keys(name, mapping, known)
    # A number that the drive does not have would silently change nothing.
    for other, numbers in OF_ONE_KIND.items():
        foreign = [key for key in mapping if other != kind and key in numbers]
        if foreign:
            raise TwinError(
                f"{name}: {foreign[0]} of {other} drives given, but drives = {kind!r}; available: "
                f"{', '.join(sorted(known - set(numbers)))}"
            )
    for pair in RIVALS:
        if all(key in mapping for key in pair):
            raise TwinError(f"{name}: {pair[0]} and {pair[1]} given, which say the same; expected one of them")
    values = {}
    for key, value in mapping.items():
        values[key] = _given(name, key, value, sources.get(key, Source()))
    settings = JointSettings(**values)
    if settings.lower and settings.upper and not settings.lower.value < settings.upper.value:
        raise TwinError(f"{name}: a range from {settings.lower.value:g} to {settings.upper.value:g} rad given")
    return settings


def _given(joint: str, key: str, value: object, usual: Source) -> Given:
    """A number of a joint, or a table of value, source and tag."""
    name = f"{joint}.{key}"
    value, source = _with_source(name, value, usual)
    number = _finite(name, value)
    expected = ""
    if key in NEGATIVE:
        expected = "" if number < 0.0 else "below 0"
    elif key in MAY_VANISH:
        expected = "" if number >= 0.0 else "0 or more"
    elif key not in SIGNED:
        expected = "" if number > 0.0 else "above 0"
    if expected:
        raise TwinError(f"{name} = {shown(value)} given, expected {expected}, in {UNITS[key]}")
    return Given(source.source, source.tag, number)


def _resolver(table: object) -> ResolverSettings:
    mapping = _mapping("resolver", table)
    _check_keys("resolver", mapping, set(RESOLVER_UNITS))
    numbers = {}
    for key, value in mapping.items():
        value, source = _with_source(f"resolver.{key}", value, Source())
        number = _finite(f"resolver.{key}", value)
        low, high, expected = RESOLVER_RANGES[key]
        if not low <= number <= high or (key == "bits" and not number.is_integer()):
            raise TwinError(f"resolver.{key} = {shown(value)} given, expected {expected}")
        numbers[key] = Given(source.source, source.tag, number)
    return ResolverSettings(**numbers)


def _link(name: str, table: object, sources: Mapping[str, Source]) -> LinkSettings:
    mapping = _mapping(name, table)
    _check_keys(name, mapping, set(LINK_UNITS))
    numbers = {}
    for key, unit in LINK_UNITS.items():
        if key not in mapping:
            raise TwinError(f"{name}: no {key} given, expected {', '.join(LINK_UNITS)}")
        value, source = _with_source(f"{name}.{key}", mapping[key], sources.get(key, Source()))
        number = _finite(f"{name}.{key}", value)
        if number <= 0.0:
            raise TwinError(f"{name}.{key} = {shown(value)} given, expected above 0, in {unit}")
        numbers[key] = Given(source.source, source.tag, number)
    return LinkSettings(**numbers)


def _payload(name: str, table: object, sources: Mapping[str, Source]) -> PayloadSettings:
    mapping = _mapping(name, table)
    own_name = name.removeprefix("payloads.")
    # The one is an empty end effector, the other begins the text of a payload on the command line.
    if own_name == "none" or own_name.startswith("mass="):
        raise TwinError(f"{name}: expected another name than none, and none that begins with mass=")
    _check_keys(name, mapping, {"mass", "centre", "inertia", "size"})
    if "mass" not in mapping:
        raise TwinError(f"{name}: no mass given, expected one, in kg")
    # A number of a scale and the guess of a size have different sources.
    own = {}
    value, own["mass"] = _with_source(f"{name}.mass", mapping.get("mass"), sources.get("mass", Source()))
    mass = _finite(f"{name}.mass", value)
    size: tuple[float, ...] = ()
    if "size" in mapping:
        value, own["size"] = _with_source(f"{name}.size", mapping["size"], sources.get("size", Source()))
        size = _numbers(f"{name}.size", value)
        if len(size) != 3 or min(size) <= 0.0 or {"centre", "inertia"} & set(mapping):
            raise TwinError(
                f"{name}: expected the size of a box, three numbers above 0 in m, in place of centre and inertia"
            )
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
    return PayloadSettings(mass, (x, y, z), (xx, yy, zz, xy, xz, yz), size, own)


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
