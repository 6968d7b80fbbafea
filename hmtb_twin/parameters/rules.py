"""Rules for what the files of an arm leave out; every number that a rule supplies is tagged `assumed`."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from math import pi

from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.arm_description import LEAST_VOLUME
from hmtb_twin.parameters.arm_toml import (
    BOUNDS,
    RESOLVER_UNITS,
    UNITS,
    ArmSettings,
    Given,
    JointSettings,
    ResolverSettings,
)
from hmtb_twin.parameters.drives import RATED_PRESSURE, Actuator, Drive, ElectricDrive, Friction, GearFriction
from hmtb_twin.parameters.quantity import Provenance
from hmtb_twin.parameters.values import RECORDER, BusTerminal, Motion, Recorder, Servo

WIDEST = pi
"""Range either way of a joint whose file gives none, rad."""

SWIFT = pi
"""Velocity limit of a joint whose file gives none, rad/s."""

RESERVE = 2.5
"""Largest torque over the largest weight in the arm's range, of a drive whose file gives none."""

LEAST_EFFORT = 1.0
"""Least torque of such a drive, N m."""

ACCELERATION = 500.0
"""Largest torque over the inertia of the rotor at the joint, rad/s^2: 0.17 kg m^2 at 87 N m, as of geared arms."""

GEAR, CURRENT, LAG = 100.0, 10.0, 0.002
"""Gear ratio, largest current, A, and inductance over resistance, s, of an electric drive."""

NO_LOAD = 2.0
"""Speed of an electric drive without load over the velocity limit."""

HYDRAULIC_NO_LOAD = 3.5
"""The same of a hydraulic drive."""

COULOMB, VISCOUS = 0.01, 0.03
"""Dry friction, and viscous friction at the speed without load, as parts of the largest torque."""

BANDWIDTH, SPREAD = 2.0, 5.5
"""Wanted bandwidth of a position servo, Hz, and its faster pole over the slower one."""

SLIP = 0.01
"""Velocity below which the bristles of dry friction hardly slip, rad/s: even light joints reverse smoothly."""

DELAY = 1
"""Delay of a measured angle on the bus, samples."""


@dataclass
class Numbers:
    """Numbers of one joint: given by its user, read from its file, or supplied by a rule, with what was assumed.

    Attributes:
        joint: The joint.
        given: What the user gives.
        read: What the model file says, by the name of the setting.
        table: Every number that was asked for, with its source.
    """

    joint: str
    given: JointSettings
    read: Mapping[str, float]
    table: list[Provenance] = field(default_factory=list)

    def number(self, name: str, rule: float, why: str) -> float:
        """Return a number: the user's, else the file's, else that of the rule, and note where it is from."""
        # Whoever has the arm knows more than its model file, and that more than any rule.
        own = self.own(name)
        if own is not None:
            return own
        if name in self.read:
            return self.note(name, self.read[name], "source", "model file")
        return self.note(name, rule, "assumed", why)

    def own(self, name: str) -> float | None:
        """Return the user's number and note where it is from; None if there is none."""
        own: Given | None = getattr(self.given, name)
        return None if own is None else self.note(name, own.value, own.tag, own.source)

    def note(self, name: str, value: float, tag: str, source: str) -> float:
        """Note where a number is from, and return it; raises `TwinError` for one that no machine has."""
        low, high = BOUNDS[name]
        if tag != "assumed" and value != 0.0 and not low <= value <= high:
            raise TwinError(f"{self.joint}: {name} = {value:g} given, expected {low:g} to {high:g}, in {UNITS[name]}")
        self.table.append(Provenance(self.joint, name.replace("_", " "), value, UNITS[name], tag, source))
        return value


@dataclass(frozen=True)
class JointRecords:
    """Records of the joints of an arm, by joint.

    Attributes:
        motions: Ranges and velocity limits.
        efforts: Largest torques, N m.
        drives: Drives.
        servos: Servos.
        bus: Terminals on the bus.
        given_gains: Gains kp, N m/rad, and kd, N m s/rad, of servos whose gains are given.
        numbers: Every number of them with its source.
    """

    motions: Mapping[str, Motion]
    efforts: Mapping[str, float]
    drives: Mapping[str, Drive]
    servos: Mapping[str, Servo]
    bus: Mapping[str, BusTerminal]
    given_gains: Mapping[str, tuple[float, float]]
    numbers: tuple[Provenance, ...]


def joint_records(
    settings: ArmSettings,
    read: Mapping[str, Mapping[str, float]],
    largest_weights: Callable[[Mapping[str, Motion]], Iterable[float]] | None,
) -> JointRecords:
    """Return the records of the joints of an arm.

    Args:
        settings: What its user says of them.
        read: What its model file says of each joint, in their sequence.
        largest_weights: Torques (n,), N m, of the largest weight on each joint over its range; None where no torque of
            a drive may be missing.

    Raises:
        TwinError: A number cannot be, or settings name a joint that is none of the arm's.
    """
    for joint in settings.joint:
        # A misspelt name would silently leave its joint with what a rule assumes.
        if joint not in read:
            raise TwinError(f"joint.{joint}: no joint of the arm, available: {', '.join(read)}")
    numbers = [Numbers(joint, settings.of_joint(joint), values) for joint, values in read.items()]
    motions = {one.joint: motion(one) for one in numbers}
    weights = [None] * len(numbers) if largest_weights is None else [float(w) for w in largest_weights(motions)]
    # In the order in which a reader of the table of numbers asks for them: torque, drive, servo, bus.
    efforts: dict[str, float] = {}
    drives: dict[str, Drive] = {}
    servos: dict[str, Servo] = {}
    bus: dict[str, BusTerminal] = {}
    for one, weight in zip(numbers, weights, strict=True):
        joint = one.joint
        efforts[joint] = effort(one, settings.drives, weight)
        drives[joint] = drive(one, settings.drives, efforts[joint], motions[joint])
        servos[joint] = servo(one, settings.sample_rate)
        bus[joint] = bus_terminal(one)
    table = tuple(chain.from_iterable(one.table for one in numbers))
    return JointRecords(motions, efforts, drives, servos, bus, _given_gains(numbers), table)


def _given_gains(numbers: Iterable[Numbers]) -> dict[str, tuple[float, float]]:
    """Gains kp, N m/rad, and kd, N m s/rad, of the servos whose user gives both."""
    gains = {}
    for one in numbers:
        kp, kd = one.given.kp, one.given.kd
        if (kp is None) != (kd is None):
            raise TwinError(f"joint.{one.joint}: one of kp and kd given, expected both or none")
        if kp is not None and kd is not None:
            gains[one.joint] = (kp.value, kd.value)
    return gains


def check_pose(name: str, angles: Sequence[float], motions: Mapping[str, Motion]) -> None:
    """Raise `TwinError` for a given pose of another number of joints, or beyond their ranges."""
    if len(angles) != len(motions):
        raise TwinError(f"poses.{name}: {len(angles)} angles given, expected {len(motions)}, one for each joint")
    # Commands are clipped to the ranges: an arm at such a pose would jump.
    beyond = joints_beyond(angles, motions)
    if beyond:
        raise TwinError(f"poses.{name}: {', '.join(beyond)} beyond the range, expected angles in rad within it")


def joints_beyond(angles: Sequence[float], motions: Mapping[str, Motion]) -> list[str]:
    """Joints whose angles of a pose (n,), rad, are beyond their ranges."""
    beyond = []
    for (joint, motion_of_joint), angle in zip(motions.items(), angles, strict=True):
        if not motion_of_joint.lower <= angle <= motion_of_joint.upper:
            beyond.append(joint)
    return beyond


def recorder(given: ResolverSettings) -> tuple[Recorder, tuple[Provenance, ...]]:
    """Resolution and noise of the measured angles of an arm, with their sources."""
    rows = []
    for name, usual in (("bits", RECORDER.resolver_bits), ("noise", RECORDER.noise)):
        own: Given | None = getattr(given, name)
        known = Given("as of the test bed", "assumed", usual) if own is None else own
        rows.append(Provenance("resolvers", name, known.value, RESOLVER_UNITS[name], known.tag, known.source))
    bits, noise = (row.value for row in rows)
    return Recorder(int(bits), noise), tuple(rows)


def motion(numbers: Numbers) -> Motion:
    """Range of a joint and velocity limit of its command."""
    lower = numbers.number("lower", -WIDEST, "half a turn either way: its file gives no range")
    upper = numbers.number("upper", WIDEST, "half a turn either way: its file gives no range")
    if not lower < upper:
        raise TwinError(
            f"{numbers.joint}: a range from {lower:g} to {upper:g} rad given, expected a lower end below the upper one"
        )
    velocity = numbers.number("velocity", SWIFT, "half a turn a second: its file gives no limit")
    return Motion(lower, upper, velocity)


def effort(numbers: Numbers, kind: str, weight: float | None) -> float:
    """Largest torque of a joint's drive, N m, from the largest weight on it, N m, where nothing gives it."""
    given = numbers.given
    # Drives that are described by their parts have the torque that follows from these.
    if kind == "hydraulic" and given.displacement is not None:
        return given.displacement.value * RATED_PRESSURE
    if kind == "electric" and given.torque_constant is not None:
        current = CURRENT if given.current is None else given.current.value
        gear = GEAR if given.gear_ratio is None else given.gear_ratio.value
        return given.torque_constant.value * gear * current
    if weight is None and given.effort is None:
        main = "displacement" if kind == "hydraulic" else "torque_constant"
        raise TwinError(f"joint.{numbers.joint}: no torque of its drive given, expected effort or {main}")
    rule = max(RESERVE * (weight or 0.0), LEAST_EFFORT)
    return numbers.number("effort", rule, f"{RESERVE:g} times the largest weight on it: its file gives no limit")


def electric_drive(numbers: Numbers, torque: float, velocity: float) -> ElectricDrive:
    """Geared motor of a joint that exerts a torque, N m, up to the velocity limit, rad/s."""
    of_motor = numbers.own("torque_constant")
    gear = numbers.number("gear_ratio", GEAR, "harmonic drive, a usual ratio")
    # Without a torque constant the size of the current is arbitrary: only their product shows at the joint.
    current = numbers.number(
        "current", CURRENT, "of any size: it scales with the torque constant" if of_motor is None else "a usual limit"
    )
    constant = torque / current if of_motor is None else of_motor * gear
    rotor = numbers.own("rotor_inertia")
    if rotor is None:
        armature = numbers.number(
            "armature", torque / ACCELERATION, f"the drive alone accelerates by {ACCELERATION:g} rad/s2"
        )
        rotor = armature / gear**2
    lag = numbers.number("electrical_lag", LAG, "inductance over resistance of a servo motor")
    # Voltage and speed without load say the same of a motor.
    voltage = numbers.own("bus_voltage")
    if voltage is None:
        speed = numbers.number("no_load_speed", NO_LOAD * velocity, f"{NO_LOAD:g} times the velocity limit")
        voltage = constant * speed
    else:
        speed = voltage / constant
    if speed <= velocity:
        raise TwinError(
            f"{numbers.joint}: a speed of {speed:g} rad/s without load given, expected more than the velocity limit "
            f"of {velocity:g} rad/s"
        )
    resistance = numbers.own("resistance")
    if resistance is None:
        # At the velocity limit the drive has its largest torque left.
        resistance = (voltage - constant * velocity) / current
    elif resistance * current > voltage:
        raise TwinError(
            f"{numbers.joint}: {resistance:g} ohm at {current:g} A given, which need {resistance * current:.3g} V; "
            f"expected at most the {voltage:.3g} V of the motor"
        )
    # A brake shows only after an emergency shutdown: no rule needs to be told.
    brake = numbers.own("brake_part")
    motor = ElectricDrive(
        torque_constant=constant / gear if of_motor is None else of_motor,
        gear_ratio=gear,
        resistance=resistance,
        electrical_lag=lag,
        rotor_inertia=rotor,
        largest_current=current,
        bus_voltage=voltage,
        friction=_friction(numbers, GearFriction(), torque, speed),
    )
    return motor if brake is None else replace(motor, brake_torque=brake)


def hydraulic_drive(numbers: Numbers, torque: float, velocity: float, reach: float) -> Actuator:
    """Hydraulic actuator of a joint that exerts a torque, N m, and moves over a range, rad."""
    displacement = numbers.number("displacement", torque / RATED_PRESSURE, "the torque at rated pressure")
    smallest = LEAST_VOLUME * displacement * reach
    # Rounding must not make it smaller than what the joint sweeps.
    volume = numbers.number(
        "trapped_volume", smallest * (1.0 + 1e-9), f"{LEAST_VOLUME:g} times displacement times range"
    )
    speed = numbers.number(
        "no_load_speed", HYDRAULIC_NO_LOAD * velocity, f"{HYDRAULIC_NO_LOAD:g} times the velocity limit"
    )
    return Actuator(displacement, volume, speed, friction=_friction(numbers, Friction(), torque, speed))


def _friction(numbers: Numbers, usual: Friction, torque: float, speed: float) -> Friction:
    """Friction of a joint as parts of the largest torque, N m, and the speed without load, rad/s."""
    dry = numbers.own("coulomb_part")
    if dry is None:
        rule = f"{100 * COULOMB:g} % of the largest torque: its file gives none"
        coulomb = numbers.number("coulomb", COULOMB * torque, rule)
        dry = coulomb / torque
    else:
        coulomb = dry * torque
    drag = numbers.own("viscous_part")
    if drag is None:
        rule = f"{100 * VISCOUS:g} % of the largest torque at the speed without load: its file gives none"
        viscous = numbers.number("viscous", VISCOUS * torque / speed, rule)
        drag = viscous * speed / torque
    else:
        viscous = drag * torque / speed
    ratio = numbers.number("static_ratio", usual.static_ratio, "breakaway over Coulomb friction")
    stribeck = numbers.number("stribeck_velocity", usual.stribeck_velocity, "about 1 deg/s at the joint")
    slip = numbers.own("slip_velocity")
    damping, load_loss = numbers.own("bristle_time"), numbers.own("load_loss") or 0.0
    # Bristles of a joint without load would have no friction to carry.
    if coulomb >= torque:
        raise TwinError(
            f"{numbers.joint}: coulomb = {coulomb:g} N m given, expected less than the largest torque of {torque:g} N m"
        )
    if load_loss > 0.0 and coulomb == 0.0:
        raise TwinError(f"{numbers.joint}: load_loss = {load_loss:g} without Coulomb friction given, expected some")
    if load_loss >= 1.0:
        raise TwinError(f"{numbers.joint}: load_loss = {load_loss:g} given, expected less than 1, a part of the load")
    if ratio < 1.0:
        raise TwinError(f"{numbers.joint}: static_ratio = {ratio:g} given, expected 1 or more")
    if damping is None:
        damping = usual.bristle_time
        if coulomb > 0.0 and ratio > 1.0:
            # Damping of the bristles up to which the friction takes energy at every instant [Barahanov2000].
            passive = viscous / (ratio - 1.0)
            damping = min(damping, passive * usual.presliding / (coulomb + 0.5 * load_loss * torque))
    return type(usual)(
        coulomb=dry,
        static_ratio=ratio,
        stribeck_velocity=stribeck,
        slip_velocity=SLIP if slip is None else slip,
        presliding=usual.presliding,
        bristle_time=damping,
        viscous=drag,
        load_loss=load_loss,
    )


def drive(numbers: Numbers, kind: str, torque: float, motion_of_joint: Motion) -> Drive:
    """Drive of a kind of a joint."""
    velocity = motion_of_joint.velocity_limit
    # The range decides how much oil the chambers hold.
    if kind == "hydraulic":
        return hydraulic_drive(numbers, torque, velocity, motion_of_joint.upper - motion_of_joint.lower)
    return electric_drive(numbers, torque, velocity)


def servo(numbers: Numbers, sample_rate: int) -> Servo:
    """Wanted poles of a joint's position servo at a rate in Hz."""
    slow, fast = numbers.own("slow_pole"), numbers.own("fast_pole")
    if slow is None:
        bandwidth = numbers.number("bandwidth", BANDWIDTH, "of a position servo; those of robots reach several Hz")
        # The slower pole decides the bandwidth; the faster one takes a few percent of it.
        slow = -2.0 * pi * bandwidth
    if fast is None:
        fast = numbers.number("damping", SPREAD, "faster pole over the slower one: well damped") * slow
    if -slow > pi * sample_rate:
        raise TwinError(
            f"{numbers.joint}: a servo of {-slow / (2.0 * pi):.3g} Hz given, expected at most {sample_rate / 2:g} Hz, "
            "half the rate of the position loop: no record would show it"
        )
    # Exchanged poles are a slip of the pen: the slower one decides the bandwidth.
    if fast > slow:
        raise TwinError(f"{numbers.joint}: a faster pole of {fast:g} rad/s given, expected one below {slow:g}")
    wanted = Servo(slow_pole=slow, fast_pole=fast)
    lag, oil = numbers.own("torque_lag"), numbers.own("oil_damping")
    if lag is not None:
        wanted = replace(wanted, torque_lag=lag)
    return wanted if oil is None else replace(wanted, oil_damping=oil)


def bus_terminal(numbers: Numbers) -> BusTerminal:
    """Delay of a joint's measured angle."""
    delay = numbers.number("delay", float(DELAY), "of a fieldbus between drive and controller")
    if not delay.is_integer() or delay > 100:
        raise TwinError(f"{numbers.joint}: delay = {delay:g} given, expected a whole number from 0 to 100 samples")
    return BusTerminal(int(delay))
