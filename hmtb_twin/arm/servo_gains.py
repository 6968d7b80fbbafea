"""Servo gains from the inertia at the operating point and the wanted poles."""

from hmtb_twin.parameters.electric_drive import Drive
from hmtb_twin.parameters.errors import TwinError
from hmtb_twin.parameters.values import Servo


def servo_gains(inertia: float, servo: Servo, actuator: Drive) -> tuple[float, float]:
    """Place the poles of one joint that is held by its neighbours.

    With torque command kp (q_cmd - q) - kd dq/dt and a torque that follows it with the lag T of pressure or current,
    the joint obeys J s^2 (T s + 1) + kd s + kp = J T (s - p1) (s - p2) (s - p3); the lag fixes p1 + p2 + p3 = -1/T.

    Args:
        inertia: Inertia J that the joint sees at the operating pose, kg m^2.
        servo: The wanted poles p1 and p2, rad/s.
        actuator: The drive, whose pressure or current lags by T.

    Returns:
        kp in N m/rad and kd in N m s/rad.

    Raises:
        TwinError: The lag is too long for the wanted poles: the third one would be unstable.
    """
    lag = actuator.motor.lag
    slow, fast = servo.slow_pole, servo.fast_pole
    third = -1.0 / lag - slow - fast
    if max(slow, fast, third) >= 0.0:
        raise TwinError(
            f"wanted poles {slow:g} and {fast:g} rad/s with a lag of {lag:g} s leave the third pole at "
            f"{third:g} rad/s; expected three negative poles, so -(p1 + p2) below {1.0 / lag:g} rad/s"
        )
    kp = -inertia * lag * slow * fast * third
    kd = inertia * lag * (slow * fast + slow * third + fast * third)
    return kp, kd
