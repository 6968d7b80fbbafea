"""Servo laws and their gains: the position error asks for a torque, or it opens the valve."""

from math import sqrt
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.drives import Actuator, DcMotor, Drive
from hmtb_twin.parameters.servo_valve import SERVO_VALVE
from hmtb_twin.parameters.values import Servo

ROUNDING = 1e-6
"""Part by which a pole may miss the wanted one."""


class ServoGains(NamedTuple):
    """Gains of a joint's servo, of either law.

    With the position torque u = kp (q_cmd - q) - kd w and the feedforward torque f, both in N m, displacement D and
    flow-pressure gain K of the drive, load pressure P and its low-pass filtered value P_f, the flow asked for is

        Q = feed u / D + K f / D + pressure ((u + f) / D - P) + compensated D w - dynamic (P - P_f).

    The torque law leaves `feed` as None, which marks it: K of the drive takes its place, whatever the oil.

    Attributes:
        kp: Stiffness, N m/rad.
        kd: Damping, N m s/rad.
        feed: Flow per position torque over displacement, cm^3/(s MPa); None: the drive's flow-pressure gain.
        pressure: Gain of the load-pressure loop, cm^3/(s MPa).
        dynamic: Gain of the dynamic pressure feedback, cm^3/(s MPa).
        washout: Time constant of P_f, s.
        compensated: Part of the load flow D w that is fed forward.
    """

    kp: float
    kd: float
    feed: float | None = None
    pressure: float = 0.0
    dynamic: float = 0.0
    washout: float = SERVO_VALVE.washout_time
    compensated: float = 1.0


def servo_dynamics(inertia: float, drag: float, motor: DcMotor, gains: ServoGains) -> np.ndarray:
    """Return the state matrix of a joint with drive and servo: linear, nothing saturated, no dry friction.

    Args:
        inertia: Inertia on its shaft, kg m^2.
        drag: Viscous friction, N m s/rad.
        motor: The drive.
        gains: Gains of its servo.

    Returns:
        Matrix (4, 4) of angle, velocity, load pressure and filtered load pressure, in rad, MPa and s.
    """
    D, K = motor.constant, motor.resistance
    feed = K if gains.feed is None else gains.feed
    # Flow into the drive by angle, velocity, load pressure and its filtered value.
    flow_per_torque = (feed + gains.pressure) / D
    by_velocity = -flow_per_torque * gains.kd + (gains.compensated - 1.0) * D
    by_pressure = -K - gains.pressure - gains.dynamic
    flow = np.array([-flow_per_torque * gains.kp, by_velocity, by_pressure, gains.dynamic])
    acceleration = [0.0, -drag / inertia, D / inertia, 0.0]
    filtered_rate = [0.0, 0.0, 1.0 / gains.washout, -1.0 / gains.washout]
    return np.array([[0.0, 1.0, 0.0, 0.0], acceleration, flow / motor.inductance, filtered_rate])


def servo_gains(inertia: float, servo: Servo, drive: Drive, law: str = "torque") -> ServoGains:
    """Return the gains of one joint's servo, tuned with all other joints held still.

    Args:
        inertia: Inertia J that the joint sees at the operating pose, kg m^2.
        servo: The wanted poles, rad/s, torque lag and damping of the oil.
        drive: The drive.
        law: "torque" or "flow".

    Returns:
        The gains.

    Raises:
        TwinError: The drive is too slow for the wanted poles.
    """
    return flow_gains(inertia, servo, drive) if law == "flow" else torque_gains(inertia, servo, drive)


def torque_gains(inertia: float, servo: Servo, drive: Drive) -> ServoGains:
    """Return the gains that place two poles of a servo whose position error asks for a torque.

    With torque command kp (q_cmd - q) - kd dq/dt and a torque that follows it with the lag T of pressure or current,
    the joint obeys (J s + B) s (T s + 1) + kd s + kp = J T (s - p1) (s - p2) (s - p3); lag and drag B fix the sum of
    the poles, -1/T - B/J.
    Where the oil is slower than the servo's `torque_lag`, a load-pressure loop makes it as fast.

    Args:
        inertia: Inertia J that the joint sees at the operating pose, kg m^2.
        servo: The wanted poles p1 and p2, rad/s, and the lag.
        drive: The drive, whose pressure or current lags.

    Returns:
        The gains.

    Raises:
        TwinError: The lag is too long for the wanted poles: the third one would be unstable.
    """
    motor = drive.motor
    # Fast oil keeps its own lag; slow oil is made as fast as the servo needs.
    lag = min(servo.torque_lag, motor.lag)
    slow, fast = servo.slow_pole, servo.fast_pole
    # The coefficient of s^2: lag and drag fix the sum of the poles, so that two wanted ones leave the third.
    third = -1.0 / lag - drive.drag / inertia - slow - fast
    if max(slow, fast, third) >= 0.0:
        raise TwinError(
            f"wanted poles {slow:g} and {fast:g} rad/s with a lag of {lag:g} s leave the third pole at "
            f"{third:g} rad/s; expected three negative poles, so -(p1 + p2) below {-(third + slow + fast):g} rad/s"
        )
    kp = -inertia * lag * slow * fast * third
    kd = inertia * lag * (slow * fast + slow * third + fast * third) - drive.drag
    return ServoGains(kp, kd, pressure=motor.inductance / lag - motor.resistance)


def flow_gains(inertia: float, servo: Servo, drive: Drive) -> ServoGains:
    """Return the gains that place the slow pole and damp the oil's resonance, where the error opens the valve.

    Q = D Kv (q_cmd - q): a hydraulic position servo [Merritt1967, ch. 8], with Kv = kp K / D^2. Dynamic pressure
    feedback raises the damping ratio of the resonance of oil and inertia towards `oil_damping` where leakage and
    load-flow line damp it less: the light roll joints reach 0.4 to 0.5 of 0.7. The faster poles are those that oil and
    inertia make.

    Args:
        inertia: Inertia J that the joint sees at the operating pose, kg m^2.
        servo: The wanted slow pole, rad/s, and damping of the oil.
        drive: The drive.

    Returns:
        The gains.

    Raises:
        TwinError: The oil is too slow for the wanted pole: the error would have to open the valve the wrong way, or
            another pole would be slower.
    """
    motor, s = drive.motor, servo.slow_pole
    D, K, compliance = motor.constant, motor.resistance, motor.inductance
    # Two radians of the resonance: the feedback passes four fifths of its damping there, and little at slow motion.
    washout = 2.0 * sqrt(compliance * inertia) / D
    # 1.25 makes up for the fifth that does not pass; nothing is needed where the drive itself damps enough.
    dynamic = 1.25 * max(2.0 * servo.oil_damping * D * sqrt(compliance / inertia) - K, 0.0)
    washed = s * washout / (1.0 + s * washout)
    # The characteristic equation at the wanted pole, solved for kp.
    oil, joint = compliance * s + K + dynamic * washed, inertia * s + drive.drag
    kp = -(oil * joint + D**2) * s / K
    if not kp > 0.0:
        raise TwinError(f"wanted slow pole {s:g} rad/s asks for kp = {kp:g} N m/rad of a flow servo, expected above 0")
    gains = ServoGains(kp, 0.0, feed=K, dynamic=dynamic, washout=washout, compensated=0.0)
    slowest = float(np.linalg.eigvals(servo_dynamics(inertia, drive.drag, motor, gains)).real.max())
    # Beyond a fastest one that the oil allows, a servo with the wanted pole has another one that is slower.
    if slowest > (1.0 - ROUNDING) * s:
        raise TwinError(
            f"wanted slow pole {s:g} rad/s: the flow servo that has it has another one at {slowest:.3g} rad/s, as the "
            "oil is too slow for it; expected a slower wanted pole, a larger displacement, or the torque servo"
        )
    return gains


def gains_for_slope(gains: ServoGains, inertia: float, actuator: Actuator, slope: float) -> ServoGains:
    """Return the gains of a flow servo whose valve loses less flow to a load than the straight load-flow line.

    More dynamic pressure feedback damps the oil in place of the line: above the inverse of its washout the joint is
    damped as before, at rest it no longer yields to a load. kp keeps the frequency at which the joint's gain is 0.707.

    Args:
        gains: The gains for the straight line, by `flow_gains`.
        inertia: Inertia J that the joint sees at the operating pose, kg m^2.
        actuator: The drive with the straight line.
        slope: Slope of the valve's line over that of the straight one, 0 to 1.
    """
    if slope == 1.0:
        return gains
    lost = (1.0 - slope) * actuator.rated_flow / actuator.hydraulics.pressure

    def open_loop(angular_frequency: float, flow_pressure_gain: float, dynamic: float) -> complex:
        """The denominator of the joint without position loop, at s = j w."""
        s = 1j * angular_frequency
        washed = dynamic * gains.washout * s / (1.0 + gains.washout * s)
        oil = actuator.compliance * s + flow_pressure_gain + washed
        return complex(s * (oil * (inertia * s + actuator.drag) + actuator.displacement**2))

    flow_per_angle = gains.kp * (gains.feed or 0.0)

    def above_half_power(log_frequency: float) -> float:
        without = open_loop(float(np.exp(log_frequency)), actuator.flow_pressure_gain, gains.dynamic)
        return abs(flow_per_angle / (flow_per_angle + without)) - sqrt(0.5)

    # From a thousandth of the velocity gain, where the joint follows, to a thousand times, where nothing is left.
    velocity_gain = flow_per_angle / actuator.displacement**2
    ends = np.log(1e-3 * velocity_gain), np.log(1e3 * velocity_gain)
    bandwidth = float(np.exp(brentq(above_half_power, *ends)))
    dynamic = gains.dynamic + lost
    without = open_loop(bandwidth, actuator.flow_pressure_gain - lost, dynamic)
    # |x / (x + q)|^2 = 1/2 at this frequency, for x = F kp.
    ratio = (without.real + abs(complex(without.real, abs(without)))) / flow_per_angle
    return gains._replace(kp=ratio * gains.kp, dynamic=dynamic)
