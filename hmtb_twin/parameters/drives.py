"""Joint drives: hydraulic actuators with their oil and friction, geared electric drives."""

from dataclasses import dataclass, field, replace
from math import exp, inf, log, log10, radians, sqrt

from hmtb_twin.parameters.quantity import quantity

COLDEST, HOTTEST = 0.0, 100.0
"""Temperatures between which the viscosity law is used, degrees Celsius."""

REFERENCE_TEMPERATURE = 40.0
"""Temperature at which drag and leakage are stated, degrees Celsius."""

_KELVIN = 273.15
_VISCOSITIES = ((40.0, 32.0), (100.0, 5.4))
"""Temperature, degrees Celsius, and kinematic viscosity, mm^2/s, of a mineral oil of ISO grade VG 32 (assumed)."""


def kinematic_viscosity(temperature: float) -> float:
    """Return the kinematic viscosity of an ISO VG 32 mineral oil, in mm^2/s.

    Walther's equation, log log (v + 0.7) linear in log T [ASTMD341], through 32 mm^2/s at 40 degrees Celsius, which is
    what the grade means, and 5.4 mm^2/s at 100.

    Args:
        temperature: Of the oil, degrees Celsius.
    """
    # A straight line through two points, with the logarithms of Walther's equation as its coordinates.
    (cool, thick), (hot, thin) = _VISCOSITIES
    upper, lower = log10(log10(thick + 0.7)), log10(log10(thin + 0.7))
    left, right = log(cool + _KELVIN), log(hot + _KELVIN)
    slope = (lower - upper) / (right - left)
    power = upper + slope * (log(temperature + _KELVIN) - left)
    return exp(log(10.0) * 10.0**power) - 0.7


def relative_viscosity(temperature: float) -> float:
    """Return the viscosity at a temperature in degrees Celsius over that at 40: the density hardly changes."""
    return kinematic_viscosity(temperature) / kinematic_viscosity(REFERENCE_TEMPERATURE)


@dataclass(frozen=True)
class DcMotor:
    """L di/dt = v - R i - K w, torque K i: current or load pressure i, voltage or valve flow v.

    Attributes:
        constant: K, torque per current, N m/A, or displacement, cm^3/rad.
        resistance: R, ohm, or flow-pressure gain, cm^3/(s MPa).
        inductance: L, H, or oil compliance, cm^3/MPa.
        largest_input: Largest v that the servo can ask for, V or cm^3/s.
        maximum_torque: Torque at which the drive saturates, N m.
        armature: Inertia that turns with the drive, at the joint, kg m^2.
        brake: Torque of a brake that holds the joint, N m.
    """

    constant: float
    resistance: float
    inductance: float
    largest_input: float
    maximum_torque: float
    armature: float = 0.0
    brake: float = 0.0

    @property
    def holding_torque(self) -> float:
        """Largest torque at rest, N m: that of the largest input against the resistance, if not saturated."""
        return min(self.maximum_torque, self.constant * self.largest_input / self.resistance)

    @property
    def lag(self) -> float:
        """Time constant from commanded to delivered torque, s."""
        return self.inductance / self.resistance


@dataclass(frozen=True)
class Hydraulics:
    """The oil and its supply."""

    supply_pressure: float = quantity(20.7, "MPa", "analogue", "Titan 4 manual, 1500-3000 psi")
    return_pressure: float = quantity(
        0.5, "MPa", "assumed", "0.3 to 0.7 MPa; 500 psi of the Titan 4 manual is a maximum"
    )
    bulk_modulus: float = quantity(700.0, "MPa", "assumed", "other models take 300 (hoses, air) to 1550 (oil)")
    leakage: float = quantity(
        0.015, "1", "assumed", "internal leakage at rated pressure and 40 degrees Celsius, part of the rated flow"
    )
    oil_temperature: float = quantity(40.0, "degC", "assumed", "temperature at which viscosity grades are stated")
    load_flow_slope: float = quantity(
        1.0,
        "1",
        "assumed",
        "slope of the load-flow line over that of the straight line from no-load flow to stall; near the null of a "
        "spool valve it is a few percent",
    )

    @property
    def pressure(self) -> float:
        """Pressure available across an actuator, MPa."""
        return self.supply_pressure - self.return_pressure


RATED_PRESSURE = Hydraulics().pressure
"""Pressure across an actuator at which its flow, leakage and friction are stated, MPa."""


@dataclass(frozen=True)
class Friction:
    """Friction as parts of the rated torque: dry friction of the seals [Canudas1995], and the oil's drag."""

    coulomb: float = quantity(
        0.001,
        "1",
        "assumed",
        "part of maximum torque; manipulators lose 0.1 to 10 %, printed pitch DC gains near one allow little",
    )
    static_ratio: float = quantity(1.5, "1", "assumed", "breakaway over Coulomb torque of lip seals")
    stribeck_velocity: float = quantity(radians(1.5), "rad/s", "assumed", "1 to 2 deg/s")
    slip_velocity: float = quantity(
        0.002, "rad/s", "assumed", "below it the bristles hardly slip: a smooth reversal, far below Stribeck's velocity"
    )
    presliding: float = quantity(1e-3, "rad", "assumed", "bristle deflection at Coulomb torque: 30 um at the rack")
    bristle_time: float = quantity(0.0004, "s", "assumed", "bristle damping over stiffness; passive by a wide margin")
    viscous: float = quantity(
        0.01, "1", "assumed", "the oil's drag at no-load speed and 40 degrees Celsius, part of maximum torque"
    )
    load_loss: float = quantity(
        0.0, "1", "assumed", "dry friction that goes with the load, part of the torque exerted; gears lose 0 to 10 %"
    )

    def bristles(self, coulomb: float, drag: float) -> tuple[float, float]:
        """Return stiffness, N m/rad, and damping, N m s/rad, of the bristles of a joint.

        The damping is at most drag Fc / (Fs - Fc): up to there the friction takes energy at every instant
        [Barahanov2000].

        Args:
            coulomb: Coulomb torque Fc of the joint, N m, with what a half load adds; see `bristle_torque`.
            drag: Its viscous friction, N m s/rad.
        """
        stiffness = coulomb / self.presliding
        # Without Stribeck's peak the friction takes energy whatever the damping.
        passive = drag / (self.static_ratio - 1.0) if self.static_ratio > 1.0 else inf
        return stiffness, min(stiffness * self.bristle_time, passive)


@dataclass(frozen=True)
class Actuator:
    """A rack-and-pinion actuator with its servo valve, linear between no-load flow and stall.

    In cm^3, MPa and s the load-pressure equation V/(4 beta) dP/dt = Q - (K + C) P - D w has coefficients of order one,
    and D P is a torque in N m. K is `load_flow_slope` times the slope of the straight line from no-load flow at zero
    load pressure to stall at full pressure [Merritt1967, ch. 5 and 6]; C is the internal leakage.

    Attributes:
        displacement: D, cm^3/rad.
        trapped_volume: V, the oil in both chambers and lines, cm^3.
        no_load_speed: Speed without load at the rated pressure, rad/s.
        hydraulics: The oil and its supply.
        friction: Friction of its seals and of the oil; None for none.
        valve_open: Whether the valve lets oil through.
    """

    displacement: float
    trapped_volume: float
    no_load_speed: float
    hydraulics: Hydraulics = field(default_factory=Hydraulics)
    friction: Friction | None = field(default_factory=Friction)
    valve_open: bool = True

    @property
    def maximum_torque(self) -> float:
        """Stall torque at the pressure between supply and return, N m."""
        return self.displacement * self.hydraulics.pressure

    @property
    def rated_torque(self) -> float:
        """Stall torque at the rated pressure, N m; friction and process noise are fractions of it."""
        return self.displacement * RATED_PRESSURE

    @property
    def coulomb_torque(self) -> float:
        """Coulomb friction, N m."""
        return self.friction.coulomb * self.rated_torque if self.friction else 0.0

    @property
    def breakaway_torque(self) -> float:
        """Largest dry friction at rest without load, N m."""
        return self.friction.static_ratio * self.coulomb_torque if self.friction else 0.0

    @property
    def bristle_torque(self) -> float:
        """Friction that the bristles carry at their deflection, N m: Coulomb's, and that of half the rated load."""
        # Half: stiff enough for a heavy load, soft enough for the physics step without one.
        lost = 0.5 * self.friction.load_loss * self.rated_torque if self.friction else 0.0
        return self.coulomb_torque + lost

    @property
    def drag(self) -> float:
        """Viscous friction at the oil's temperature, N m s/rad."""
        if self.friction is None:
            return 0.0
        # Drag in a film of oil goes with its viscosity.
        thickness = relative_viscosity(self.hydraulics.oil_temperature)
        return self.friction.viscous * self.rated_torque / self.no_load_speed * thickness

    @property
    def rated_flow(self) -> float:
        """Flow of the fully open valve without load, cm^3/s: the hydraulic velocity limit times the displacement.

        No-load speed is stated at the rated pressure; flow through an orifice goes with the root of pressure.
        """
        # The valve is built for the rating; a plant with another supply has the same valve.
        return self.displacement * self.no_load_speed * sqrt(self.hydraulics.pressure / RATED_PRESSURE)

    @property
    def leakage(self) -> float:
        """Internal leakage C, laminar and so the larger the thinner the oil, cm^3/(s MPa)."""
        # Laminar flow through a gap: proportional to the pressure, inversely to the viscosity.
        at_rating = self.hydraulics.leakage * self.displacement * self.no_load_speed / RATED_PRESSURE
        return at_rating / relative_viscosity(self.hydraulics.oil_temperature)

    @property
    def compliance(self) -> float:
        """Oil compressibility V/(4 beta), cm^3/MPa."""
        return self.trapped_volume / (4.0 * self.hydraulics.bulk_modulus)

    @property
    def flow_pressure_gain(self) -> float:
        """Flow lost per load pressure, cm^3/(s MPa): K + C, or only the leakage C behind a closed valve."""
        # The straight line from no-load flow at zero load pressure to stall at full pressure, or a flatter one.
        slope = self.hydraulics.load_flow_slope * self.rated_flow / self.hydraulics.pressure
        return self.valve_open * slope + self.leakage

    @property
    def largest_flow(self) -> float:
        """Largest flow that the servo can command, cm^3/s; negligible for a closed valve."""
        return self.rated_flow if self.valve_open else 1e-12 * self.rated_flow

    @property
    def motor(self) -> DcMotor:
        """The actuator as a `dcmotor`: load pressure for current, flow for voltage."""
        return DcMotor(
            constant=self.displacement,
            resistance=self.flow_pressure_gain,
            inductance=self.compliance,
            largest_input=self.largest_flow,
            maximum_torque=self.maximum_torque,
        )

    @property
    def unpowered(self) -> "Actuator":
        """The actuator after an emergency shutdown: no flow through the valve, the oil trapped but for the leakage."""
        return replace(self, valve_open=False)


@dataclass(frozen=True)
class GearFriction(Friction):
    """Friction of a harmonic drive as parts of the rated torque: LuGre or Coulomb, and the lubricant's drag."""

    coulomb: float = quantity(0.01, "1", "assumed", "part of rated torque; harmonic drives lose several percent")
    static_ratio: float = quantity(1.3, "1", "assumed", "breakaway over Coulomb torque of a greased gear")
    stribeck_velocity: float = quantity(0.02, "rad/s", "assumed", "about 1 deg/s at the joint")
    presliding: float = quantity(1e-3, "rad", "assumed", "deflection of gear and bearings at Coulomb torque")
    viscous: float = quantity(0.03, "1", "assumed", "grease: drag at no-load speed, part of rated torque")


BRAKE_PART = 1.5
"""Torque of a brake that holds without power, as a part of the rated torque of its drive; assumed."""


@dataclass(frozen=True)
class ElectricDrive:
    """A brushless motor with its current loop, seen as a DC motor behind a gear, and a brake that power releases.

    With V the bus voltage, N the gear ratio and k the motor's torque constant the joint's torque is N k i, and
    L di/dt = v - R i - N k w with v within V. The rotor turns N times as fast as the joint and weighs N^2 J there.

    Attributes:
        torque_constant: k, N m/A.
        gear_ratio: N.
        resistance: R, of the winding, ohm.
        electrical_lag: L / R, s.
        rotor_inertia: J, of what turns before the gear, kg m^2.
        largest_current: Limit of the drive's electronics, A.
        bus_voltage: V, of the bus, V.
        brake_torque: Torque of the brake that holds without power, as a part of the rated torque.
        friction: Friction of gear and bearings; None for none.
        powered: Whether it has power.
    """

    torque_constant: float
    gear_ratio: float
    resistance: float
    electrical_lag: float
    rotor_inertia: float
    largest_current: float
    bus_voltage: float
    brake_torque: float = BRAKE_PART
    friction: Friction | None = field(default_factory=GearFriction)
    powered: bool = True

    @property
    def rated_torque(self) -> float:
        """Torque at the joint at the largest current, N m; friction, brake and process noise are fractions of it."""
        return self.torque_constant * self.gear_ratio * self.largest_current

    @property
    def maximum_torque(self) -> float:
        """Largest torque at the joint, N m: the rated one."""
        return self.rated_torque

    @property
    def no_load_speed(self) -> float:
        """Speed of the joint at the bus voltage without load, rad/s."""
        return self.bus_voltage / (self.torque_constant * self.gear_ratio)

    @property
    def coulomb_torque(self) -> float:
        """Coulomb friction, N m."""
        return self.friction.coulomb * self.rated_torque if self.friction else 0.0

    @property
    def breakaway_torque(self) -> float:
        """Largest dry friction at rest without load, N m."""
        return self.friction.static_ratio * self.coulomb_torque if self.friction else 0.0

    @property
    def bristle_torque(self) -> float:
        """Friction that the bristles carry at their deflection, N m: Coulomb's, and that of half the rated load."""
        lost = 0.5 * self.friction.load_loss * self.rated_torque if self.friction else 0.0
        return self.coulomb_torque + lost

    @property
    def drag(self) -> float:
        """Viscous friction, N m s/rad."""
        return self.friction.viscous * self.rated_torque / self.no_load_speed if self.friction else 0.0

    @property
    def motor(self) -> DcMotor:
        """The drive at the joint; without power its windings are shorted and its brake holds."""
        largest_input = self.bus_voltage if self.powered else 1e-12 * self.bus_voltage
        brake = 0.0 if self.powered else self.brake_torque * self.rated_torque
        return DcMotor(
            constant=self.torque_constant * self.gear_ratio,
            resistance=self.resistance,
            inductance=self.electrical_lag * self.resistance,
            largest_input=largest_input,
            maximum_torque=self.maximum_torque,
            armature=self.rotor_inertia * self.gear_ratio**2,
            brake=brake,
        )

    @property
    def unpowered(self) -> "ElectricDrive":
        """The drive after an emergency shutdown."""
        return replace(self, powered=False)


Drive = Actuator | ElectricDrive
"""Drive of a joint."""
