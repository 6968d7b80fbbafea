"""What MuJoCo's `dcmotor` knows of a drive, hydraulic or electric: the equations are the same."""

from dataclasses import dataclass


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
        """Largest torque that it holds at rest, N m: largest input less what the resistance takes, if not saturated."""
        return min(self.maximum_torque, self.constant * self.largest_input / self.resistance)

    @property
    def lag(self) -> float:
        """Time constant from commanded to delivered torque, s."""
        return self.inductance / self.resistance
