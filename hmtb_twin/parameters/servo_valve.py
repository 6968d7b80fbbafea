"""The two-stage servo valve of the `orifice` actuator, its load-pressure amplifier and the power unit: parameters."""

from dataclasses import dataclass
from math import pi

import numpy as np

from hmtb_twin.parameters.drives import Actuator, relative_viscosity
from hmtb_twin.parameters.quantity import quantity


@dataclass(frozen=True)
class ServoValve:
    """A four-way spool valve behind a pilot stage, and the amplifier that closes a load-pressure loop around it.

    The spool follows its command as x'' = w^2 (u - x) - 2 z w x', w = 2 pi frequency, between hard stops at full
    stroke, x = -1 and 1. A land uncovered by s = x + underlap has the opening (s + sqrt(s^2 + clearance^2)) / 2: that
    of its edge when open, of a gap that leaks as 1/length when covered [Eryilmaz2000]. Its flow is
    g opening dp / (dp^2 + transition_pressure^2)^(1/4): the square root of the pressure drop [Merritt1967, ch. 5],
    laminar below the transition pressure.
    """

    frequency: float = quantity(60.0, "Hz", "assumed", "second-order spool; 60 to 150 Hz are plausible")
    damping: float = quantity(0.7, "1", "assumed", "of the spool; a common choice")
    underlap: float = quantity(0.0, "1", "assumed", "part of the stroke; negative for overlap, a dead band")
    clearance: float = quantity(0.01, "1", "assumed", "radial gap as part of the stroke; null leakage half of it")
    transition_pressure: float = quantity(1.0, "MPa", "assumed", "laminar to turbulent, small openings in VG 32 oil")
    relief: float = quantity(1.05, "1", "assumed", "relief valve of a chamber opens at this part of supply pressure")
    check_flow: float = quantity(
        1.0, "1/MPa", "assumed", "relief and anti-cavitation valves, rated flows per MPa; no vacuum in fastest moves"
    )
    loop_gain: float = quantity(
        120.0, "rad/s", "derived", "load-pressure loop above the washout: gain margin over 4 with the 60 Hz spool"
    )
    washout_time: float = quantity(
        0.01, "s", "derived", "of the dynamic pressure feedback; best damping of the coupled arm"
    )
    compensated: float = quantity(
        0.99, "1", "derived", "part of the load flow fed forward; wrist roll as fast as with linear actuators"
    )

    @property
    def angular_frequency(self) -> float:
        """Natural frequency of the spool, rad/s."""
        return 2.0 * pi * self.frequency

    def static_gain(self, actuator: Actuator, kd: float) -> float:
        """Gain that is chosen for a standing load, so that the joint is damped as the servo asks, rad/s.

        With K = D^2 / kd the oil itself damps the joint as the servo should, at once instead of through the spool's
        lag: in K (T/D - P) + D w the servo's - kd w and the flow that the moving joint takes cancel. The whole loop
        gain is the limit, where the servo damps less than the oil would. What hot oil leaks beyond the rating damps
        the joint as well, and is taken off K: else the amplifier, which also feeds the leakage forward, would damp
        twice through a lagging spool.

        Args:
            actuator: The joint's actuator.
            kd: The servo's damping, N m s/rad.

        Returns:
            The gain K / compliance, from 0 to `loop_gain`.
        """
        if kd <= 0.0:
            return self.loop_gain
        # Leakage goes with the inverse of viscosity.
        beyond_rating = actuator.leakage * (1.0 - relative_viscosity(actuator.hydraulics.oil_temperature))
        gain = (actuator.displacement**2 / kd - beyond_rating) / actuator.compliance
        return min(self.loop_gain, max(gain, 0.0))

    def loop(self, frequency: np.ndarray, static: float) -> np.ndarray:
        """Return the open-loop frequency response of the load-pressure loop, joint held.

        Args:
            frequency: Angular frequencies (n,), rad/s.
            static: `static_gain`, rad/s.

        Returns:
            Complex response (n,).
        """
        s = 1j * frequency
        washed = s * self.washout_time / (1.0 + s * self.washout_time)
        w = self.angular_frequency
        # The integrator is the oil of the held joint, the spool its only lag.
        spool = w**2 / (s**2 + 2.0 * self.damping * w * s + w**2)
        return (static + (self.loop_gain - static) * washed) / s * spool

    def margins(self, static: float) -> tuple[float, float]:
        """Return gain margin and phase margin (rad) of the load-pressure loop with the joint held.

        Args:
            static: `static_gain`, rad/s.

        Returns:
            Factor by which the loop gain may grow, and the phase margin.
        """
        # From far below the washout to far above the spool; the unwrapped phase needs a fine grid.
        frequency = np.geomspace(0.1, 10.0 * self.angular_frequency, 20_000)
        response = self.loop(frequency, static)
        phase = np.unwrap(np.angle(response))
        turned = int(np.argmax(phase <= -pi))
        crossed = int(np.argmax(np.abs(response) <= 1.0))
        return float(1.0 / abs(response[turned])), float(pi + phase[crossed])


@dataclass(frozen=True)
class PowerUnit:
    """The pump with its pressure compensator and the accumulator that all joints share.

    capacity dp/dt = droop (set pressure - p), between nothing and the pump's largest flow, less what the valves draw.
    """

    largest_flow: float = quantity(500.0, "cm3/s", "assumed", "30 L/min; all joints at full flow take 25 L/min")
    droop: float = quantity(250.0, "cm3/(s MPa)", "assumed", "full flow 2 MPa below the set pressure")
    capacity: float = quantity(20.0, "cm3/MPa", "assumed", "1 L gas-charged to half the pressure, V/(n p)")


SERVO_VALVE = ServoValve()
POWER_UNIT = PowerUnit()
