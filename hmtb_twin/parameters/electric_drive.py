"""A geared electric drive, in the place of a hydraulic actuator."""

from dataclasses import dataclass, field, replace

from hmtb_twin.parameters.dc_motor import DcMotor
from hmtb_twin.parameters.quantity import quantity
from hmtb_twin.parameters.values import Actuator, Friction


@dataclass(frozen=True)
class GearFriction(Friction):
    """Friction of a harmonic drive as parts of the rated torque: LuGre or Coulomb, and the lubricant's drag."""

    coulomb: float = quantity(0.02, "1", "assumed", "part of rated torque; harmonic drives lose several percent")
    static_ratio: float = quantity(1.3, "1", "assumed", "breakaway over Coulomb torque of a greased gear")
    stribeck_velocity: float = quantity(0.02, "rad/s", "assumed", "about 1 deg/s at the joint")
    presliding: float = quantity(1e-3, "rad", "assumed", "deflection of gear and bearings at Coulomb torque")
    viscous: float = quantity(0.03, "1", "assumed", "grease: drag at no-load speed, part of rated torque")


@dataclass(frozen=True)
class ElectricDrive:
    """A brushless motor with its current loop, seen as a DC motor behind a gear, and a brake that power releases.

    With V the bus voltage, N the gear ratio and k the motor's torque constant the joint's torque is N k i, and
    L di/dt = v - R i - N k w with v within V. The rotor turns N times as fast as the joint and weighs N^2 J there.
    """

    torque_constant: float = quantity(0.1, "N m/A", "assumed", "of the motor; frameless motors of 60 to 100 mm")
    gear_ratio: float = quantity(160.0, "1", "assumed", "harmonic drive, a usual ratio")
    resistance: float = quantity(1.0, "ohm", "assumed", "of a winding for the bus voltage")
    electrical_lag: float = quantity(0.002, "s", "assumed", "inductance over resistance")
    rotor_inertia: float = quantity(5e-5, "kg m2", "assumed", "of rotor and wave generator")
    largest_current: float = quantity(8.0, "A", "assumed", "limit of the drive's electronics")
    bus_voltage: float = quantity(28.0, "V", "analogue", "direct-current bus of the Space Shuttle Orbiter")
    brake_torque: float = quantity(1.5, "1", "assumed", "of the brake that holds without power, part of rated torque")
    friction: Friction | None = field(default_factory=GearFriction)
    powered: bool = True

    @property
    def rated_torque(self) -> float:
        """Torque at the joint at the largest current, N m; what friction, brake and process noise are parts of."""
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
    def drag(self) -> float:
        """Viscous friction, N m s/rad."""
        return self.friction.viscous * self.rated_torque / self.no_load_speed if self.friction else 0.0

    @property
    def motor(self) -> DcMotor:
        """The drive at the joint; without power its windings are shorted and its brake holds."""
        return DcMotor(
            constant=self.torque_constant * self.gear_ratio,
            resistance=self.resistance,
            inductance=self.electrical_lag * self.resistance,
            largest_input=self.bus_voltage if self.powered else 1e-12 * self.bus_voltage,
            maximum_torque=self.maximum_torque,
            armature=self.rotor_inertia * self.gear_ratio**2,
            brake=0.0 if self.powered else self.brake_torque * self.rated_torque,
        )

    @property
    def unpowered(self) -> "ElectricDrive":
        """The drive after an emergency shutdown."""
        return replace(self, powered=False)


Drive = Actuator | ElectricDrive
"""What moves a joint."""
