"""An arm with servo valves, or a supply, of one's own."""

from copy import copy
from dataclasses import replace

from hmtb_twin.arm.arm import Arm
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.hydraulics.orifice import valve_parameters
from hmtb_twin.parameters.errors import TwinError
from hmtb_twin.parameters.servo_valve import POWER_UNIT, SERVO_VALVE, PowerUnit, ServoValve
from hmtb_twin.parameters.values import JOINTS


def with_valve(arm: Arm, *, valve: ServoValve = SERVO_VALVE, power_unit: PowerUnit = POWER_UNIT) -> Arm:
    """Return an arm with other servo valves, or another supply.

    Args:
        arm: An arm with orifice actuators.
        valve: The servo valve of every joint.
        power_unit: The supply that they share.

    Raises:
        TwinError: The arm has no servo valves.
    """
    if arm.plant.actuator != "orifice":
        raise TwinError(
            f'other servo valves for an arm with actuator = "{arm.plant.actuator}" asked, expected "orifice"'
        )
    model = copy(arm.model)
    for j, name in enumerate(JOINTS):
        parameters = valve_parameters(arm.actuators[name], arm.gains[name], valve, power_unit, joints=len(JOINTS))
        kept = [eq.BRISTLE, eq.BRISTLE_DAMPING]
        parameters[kept] = model.actuator_user[2 * j, kept]
        model.actuator_user[2 * j] = parameters
    return replace(arm, model=model)
