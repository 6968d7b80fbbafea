"""The table of every number of the nominal arm, and of the one in orbit: value, unit, tag, source. A module to run."""

import sys

from hmtb_twin.parameters.electric_drive import GearFriction
from hmtb_twin.parameters.flight_variant import FLIGHT_DRIVES, FLIGHT_LINKS, FLIGHT_SERVOS
from hmtb_twin.parameters.payloads import PAYLOADS
from hmtb_twin.parameters.quantity import Provenance, provenance
from hmtb_twin.parameters.seats import LATCH, SEATS, TOUCH
from hmtb_twin.parameters.servo_valve import POWER_UNIT, SERVO_VALVE
from hmtb_twin.parameters.values import (
    ACTUATORS,
    BUS,
    HAND_CONTROLLER,
    LINKS,
    MOTIONS,
    RECORDER,
    SERVOS,
    Friction,
    Hydraulics,
)


def provenance_table() -> tuple[Provenance, ...]:
    """List every tagged parameter of the nominal arm, then those of the arm in orbit that differ.

    Returns:
        One line per parameter of links, payloads, oil, friction, actuators, valves and pump, servos, motion, bus, hand
        controller, recorder, seats, latch and touch; of links, drives, gears and servos in orbit.
    """
    owners: list[tuple[str, object]] = [(f"link {name}", link) for name, link in LINKS.items()]
    owners += [(f"payload {name}", payload) for name, payload in PAYLOADS.items() if payload is not None]
    owners += [("hydraulics", Hydraulics()), ("friction", Friction())]
    owners += [(f"actuator {name}", actuator) for name, actuator in ACTUATORS.items()]
    owners += [("servo valve", SERVO_VALVE), ("power unit", POWER_UNIT)]
    owners += [(f"servo {name}", servo) for name, servo in SERVOS.items()]
    owners += [(f"motion {name}", motion) for name, motion in MOTIONS.items()]
    owners += [(f"bus terminal {name}", terminal) for name, terminal in BUS.items()]
    owners += [("hand controller", HAND_CONTROLLER), ("recorder", RECORDER)]
    owners += [(f"seat {name}", seat) for name, seat in SEATS.items()]
    owners += [("latch", LATCH), ("touch", TOUCH)]
    owners += [(f"flight link {name}", link) for name, link in FLIGHT_LINKS.items()]
    owners += [(f"flight drive {name}", drive) for name, drive in FLIGHT_DRIVES.items()]
    owners += [("flight gear friction", GearFriction())]
    owners += [(f"flight servo {name}", servo) for name, servo in FLIGHT_SERVOS.items()]
    return tuple(line for owner, record in owners for line in provenance(owner, record))


def markdown(line: Provenance) -> str:
    """Return one line of the table as Markdown."""
    value = " x ".join(f"{v:.5g}" for v in line.value) if isinstance(line.value, tuple) else f"{line.value:.5g}"
    parameter = line.parameter.replace("_", " ")
    return f"| {line.owner.replace('_', ' ')} | {parameter} | {value} | {line.unit} | {line.tag} | {line.source} |"


if __name__ == "__main__":
    sys.stdout.write("".join(f"{markdown(line)}\n" for line in provenance_table()))
