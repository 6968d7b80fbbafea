"""Rules for what the files of an arm leave out; every number that a rule supplies is tagged `assumed`."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi

from hmtb_twin.arm_files.arm_toml import Given, JointSettings
from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.arm_description import LEAST_VOLUME
from hmtb_twin.parameters.drives import RATED_PRESSURE, Actuator, Drive, ElectricDrive, Friction, GearFriction
from hmtb_twin.parameters.quantity import Provenance
from hmtb_twin.parameters.values import BusTerminal, Motion, Servo

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

    def number(self, name: str, unit: str, rule: float, why: str) -> float:
        """Return a number: the user's, else the file's, else that of the rule, and note where it is from."""
        # Whoever has the arm knows more than its model file, and that more than any rule.
        own: Given | None = getattr(self.given, name)
        if own is not None:
            value, tag, source = own.value, own.tag, own.source
        elif name in self.read:
            value, tag, source = self.read[name], "source", "model file"
        else:
            value, tag, source = rule, "assumed", why
        self.table.append(Provenance(self.joint, name.replace("_", " "), value, unit, tag, source))
        return value


def motion(numbers: Numbers) -> Motion:
    """Range of a joint and velocity limit of its command."""
    lower = numbers.number("lower", "rad", -WIDEST, "half a turn either way: its file gives no range")
    upper = numbers.number("upper", "rad", WIDEST, "half a turn either way: its file gives no range")
    velocity = numbers.number("velocity", "rad/s", SWIFT, "half a turn a second: its file gives no limit")
    return Motion(lower, upper, velocity)


def effort(numbers: Numbers, weight: float) -> float:
    """Largest torque of a joint's drive, N m, from the largest weight on it, N m, where no file gives it."""
    rule = max(RESERVE * weight, LEAST_EFFORT)
    return numbers.number("effort", "N m", rule, f"{RESERVE:g} times the largest weight on it: its file gives no limit")


def electric_drive(numbers: Numbers, torque: float, velocity: float) -> ElectricDrive:
    """Geared motor of a joint that exerts a torque, N m, up to the velocity limit, rad/s."""
    gear = numbers.number("gear_ratio", "1", GEAR, "harmonic drive, a usual ratio")
    current = numbers.number("current", "A", CURRENT, "of any size: it scales with the torque constant")
    armature = numbers.number(
        "armature", "kg m2", torque / ACCELERATION, f"the drive alone accelerates by {ACCELERATION:g} rad/s2"
    )
    lag = numbers.number("electrical_lag", "s", LAG, "inductance over resistance of a servo motor")
    speed = numbers.number("no_load_speed", "rad/s", NO_LOAD * velocity, f"{NO_LOAD:g} times the velocity limit")
    if speed <= velocity:
        raise TwinError(
            f"{numbers.joint}: a speed of {speed:g} rad/s without load given, expected more than the velocity limit "
            f"of {velocity:g} rad/s"
        )
    # The size of the current is arbitrary: only its product with the torque constant shows at the joint.
    constant = torque / current
    voltage = constant * speed
    # At the velocity limit the drive has its largest torque left.
    resistance = (voltage - constant * velocity) / current
    return ElectricDrive(
        torque_constant=constant / gear,
        gear_ratio=gear,
        resistance=resistance,
        electrical_lag=lag,
        rotor_inertia=armature / gear**2,
        largest_current=current,
        bus_voltage=voltage,
        friction=_friction(numbers, GearFriction(), torque, speed),
    )


def hydraulic_drive(numbers: Numbers, torque: float, velocity: float, reach: float) -> Actuator:
    """Hydraulic actuator of a joint that exerts a torque, N m, and moves over a range, rad."""
    displacement = numbers.number("displacement", "cm3/rad", torque / RATED_PRESSURE, "the torque at rated pressure")
    smallest = LEAST_VOLUME * displacement * reach
    # Rounding must not make it smaller than what the joint sweeps.
    volume = numbers.number(
        "trapped_volume", "cm3", smallest * (1.0 + 1e-9), f"{LEAST_VOLUME:g} times displacement times range"
    )
    speed = numbers.number(
        "no_load_speed", "rad/s", HYDRAULIC_NO_LOAD * velocity, f"{HYDRAULIC_NO_LOAD:g} times the velocity limit"
    )
    return Actuator(displacement, volume, speed, friction=_friction(numbers, Friction(), torque, speed))


def _friction(numbers: Numbers, usual: Friction, torque: float, speed: float) -> Friction:
    """Friction of a joint as parts of the largest torque, N m, and the speed without load, rad/s."""
    coulomb = numbers.number(
        "coulomb", "N m", COULOMB * torque, f"{100 * COULOMB:g} % of the largest torque: its file gives none"
    )
    viscous = numbers.number(
        "viscous",
        "N m s/rad",
        VISCOUS * torque / speed,
        f"{100 * VISCOUS:g} % of the largest torque at the speed without load: its file gives none",
    )
    ratio = numbers.number("static_ratio", "1", usual.static_ratio, "breakaway over Coulomb friction")
    stribeck = numbers.number("stribeck_velocity", "rad/s", usual.stribeck_velocity, "about 1 deg/s at the joint")
    if ratio < 1.0:
        raise TwinError(f"{numbers.joint}: static_ratio = {ratio:g} given, expected 1 or more")
    # Damping of the bristles up to which the friction takes energy at every instant [Barahanov2000].
    passive = viscous / (ratio - 1.0) if ratio > 1.0 else float("inf")
    damping = usual.bristle_time
    if coulomb > 0.0:
        damping = min(damping, passive * usual.presliding / coulomb)
    return type(usual)(
        coulomb=coulomb / torque,
        static_ratio=ratio,
        stribeck_velocity=stribeck,
        slip_velocity=0.01,
        presliding=usual.presliding,
        bristle_time=damping,
        viscous=viscous * speed / torque,
    )


def drive(numbers: Numbers, kind: str, torque: float, motion_of_joint: Motion) -> Drive:
    """Drive of a kind of a joint."""
    velocity = motion_of_joint.velocity_limit
    # The range decides how much oil the chambers hold.
    if kind == "hydraulic":
        return hydraulic_drive(numbers, torque, velocity, motion_of_joint.upper - motion_of_joint.lower)
    return electric_drive(numbers, torque, velocity)


def servo(numbers: Numbers) -> Servo:
    """Wanted poles of a joint's position servo."""
    bandwidth = numbers.number("bandwidth", "Hz", BANDWIDTH, "of a position servo; those of robots reach several Hz")
    spread = numbers.number("damping", "1", SPREAD, "faster pole over the slower one: well damped")
    # The slower pole decides the bandwidth; the faster one takes a few percent of it.
    slow = -2.0 * pi * bandwidth
    return Servo(slow_pole=slow, fast_pole=spread * slow)


def bus_terminal(numbers: Numbers) -> BusTerminal:
    """Delay of a joint's measured angle."""
    delay = numbers.number("delay", "samples", float(DELAY), "of a fieldbus between drive and controller")
    if not delay.is_integer() or delay > 100:
        raise TwinError(f"{numbers.joint}: delay = {delay:g} given, expected a whole number from 0 to 100 samples")
    return BusTerminal(int(delay))
