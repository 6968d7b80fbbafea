"""Linear hydraulics in closed form: one joint on its actuator, the other joints held.

With load pressure P, joint velocity w, valve flow Q at zero load pressure and load torque T,

    V/(4 beta) dP/dt = Q - K_ce P - D w        J dw/dt = D P - B w + T,

where K_ce is the flow-pressure gain with the leakage [Merritt1967, ch. 6]. The simulated actuators are tested against
these results, which do not use the simulation.
"""

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.drives import Actuator, DcMotor
from hmtb_twin.parameters.servo_gains import ServoGains, servo_dynamics


@dataclass(frozen=True)
class LinearHydraulics:
    """A linear rotary actuator with an inertia on its shaft.

    Attributes:
        inertia: J, inertia that the joint sees with the other joints held, kg m^2.
        displacement: D, cm^3/rad; D P is a torque in N m with P in MPa.
        compliance: V/(4 beta), trapped volume over four times the bulk modulus, cm^3/MPa.
        flow_pressure_gain: K_ce, slope of the load-flow line and leakage, cm^3/(s MPa).
        drag: B, viscous friction of the joint, N m s/rad.
        largest_flow: Flow of the fully open valve without load, cm^3/s.
    """

    inertia: float
    displacement: float
    compliance: float
    flow_pressure_gain: float
    drag: float
    largest_flow: float

    def __post_init__(self) -> None:
        for name in ("inertia", "displacement", "compliance", "flow_pressure_gain"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise TwinError(f"linear hydraulics: {name} = {getattr(self, name)} given, expected above 0")

    @property
    def natural_frequency(self) -> float:
        """Hydraulic natural frequency sqrt(4 beta D^2 / (V J)), rad/s: the oil as a spring on the inertia."""
        return self.displacement / sqrt(self.inertia * self.compliance)

    @property
    def damping_ratio(self) -> float:
        """Hydraulic damping ratio (K_ce / D) sqrt(beta J / V) + (B / (4 D)) sqrt(V / (beta J)).

        Above one the joint does not ring: its poles are real.
        """
        stiffness = sqrt(self.inertia / self.compliance)
        return (self.flow_pressure_gain * stiffness + self.drag / stiffness) / (2.0 * self.displacement)

    @property
    def leak_ratio(self) -> float:
        """B K_ce / D^2, the part of the flow that drag presses past the actuator; textbooks neglect it against one."""
        return self.drag * self.flow_pressure_gain / self.displacement**2

    @property
    def poles(self) -> np.ndarray:
        """Roots (2,) of s^2 + 2 zeta_h omega_h s + omega_h^2 (1 + B K_ce / D^2), rad/s, slowest first."""
        omega, zeta = self.natural_frequency, self.damping_ratio
        roots = np.roots([1.0, 2.0 * zeta * omega, omega**2 * (1.0 + self.leak_ratio)])
        return roots[np.argsort(-roots.real, kind="stable")]

    @property
    def velocity_gain(self) -> float:
        """Steady joint velocity over valve flow, 1 / (D (1 + B K_ce / D^2)), rad/cm^3."""
        return 1.0 / (self.displacement * (1.0 + self.leak_ratio))

    @property
    def no_load_speed(self) -> float:
        """Steady joint velocity behind the fully open valve without load torque, Q / D less what drag costs, rad/s."""
        return self.velocity_gain * self.largest_flow

    @property
    def stall_torque(self) -> float:
        """Steady torque of the fully open valve on a standing joint, N m: D P_s less what leaks at that pressure."""
        return self.displacement * self.largest_flow / self.flow_pressure_gain

    def response(self, frequencies: np.ndarray) -> np.ndarray:
        """Return the frequency response to valve flow.

        Args:
            frequencies: Frequencies (n,), Hz.

        Returns:
            Joint velocity, rad/cm^3, and load pressure, MPa s/cm^3, for a flow of one: complex (n, 2).
        """
        s = 2j * pi * np.asarray(frequencies, dtype=float)
        inertia, oil = self.inertia * s + self.drag, self.compliance * s + self.flow_pressure_gain
        denominator = inertia * oil + self.displacement**2
        return np.column_stack([self.displacement / denominator, inertia / denominator])

    def step(self, times: np.ndarray) -> np.ndarray:
        """Return the response from rest to a step of valve flow by one.

        Args:
            times: Instants (n,) since the step, s.

        Returns:
            Joint velocity, rad/cm^3, and load pressure, MPa s/cm^3, at these instants: (n, 2).
        """
        drive = np.array([0.0, 1.0 / self.compliance])
        acceleration = [-self.drag / self.inertia, self.displacement / self.inertia]
        pressure_rate = [-self.displacement / self.compliance, -self.flow_pressure_gain / self.compliance]
        dynamics = np.array([acceleration, pressure_rate])
        # By modes: x(t) = x_steady + sum of w_i exp(lambda_i t) v_i, with x(0) = 0.
        steady = -np.linalg.solve(dynamics, drive)
        values, vectors = np.linalg.eig(dynamics)
        weights = np.linalg.solve(vectors, -steady.astype(complex))
        decay = np.exp(np.multiply.outer(np.asarray(times, dtype=float), values))
        return steady + ((decay * weights) @ vectors.T).real

    def servo_poles(self, gains: ServoGains) -> np.ndarray:
        """Return the poles of the joint under its servo.

        Args:
            gains: Gains of the servo.

        Returns:
            Poles, rad/s, slowest first: (4,) with dynamic pressure feedback, else (3,).
        """
        motor = DcMotor(self.displacement, self.flow_pressure_gain, self.compliance, self.largest_flow, np.inf)
        dynamics = servo_dynamics(self.inertia, self.drag, motor, gains)
        if not gains.dynamic:
            # The filtered load pressure, the last state, acts on nothing.
            dynamics = dynamics[:3, :3]
        roots = np.linalg.eigvals(dynamics).astype(complex)
        return roots[np.argsort(-roots.real, kind="stable")]


def linear_hydraulics(actuator: Actuator, inertia: float) -> LinearHydraulics:
    """Return the linear hydraulics of an actuator, as it is under its oil's pressure and temperature.

    Args:
        actuator: The actuator; behind a closed valve its leakage alone is left of K_ce.
        inertia: Inertia on its shaft, kg m^2.

    Raises:
        TwinError: The inertia is not positive.
    """
    return LinearHydraulics(
        inertia=inertia,
        displacement=actuator.displacement,
        compliance=actuator.compliance,
        flow_pressure_gain=actuator.flow_pressure_gain,
        drag=actuator.drag,
        largest_flow=actuator.largest_flow,
    )
