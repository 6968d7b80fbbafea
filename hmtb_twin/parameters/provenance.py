"""Provenance table: value, unit, tag and source of every number of the nominal arm and of the arm in orbit.

Run as a module it writes the table of `models/hmtb/README.md`.
"""

import sys
from collections.abc import Mapping
from typing import Any

from hmtb_twin.parameters.drives import (
    ACTUATORS,
    Friction,
    GearFriction,
    Hydraulics,
    RollFriction,
    RollGearFriction,
    YawFriction,
)
from hmtb_twin.parameters.payloads import LATCH, PAYLOADS, SEATS, TOUCH
from hmtb_twin.parameters.quantity import Provenance, provenance
from hmtb_twin.parameters.servo_valve import POWER_UNIT, SERVO_VALVE
from hmtb_twin.parameters.values import BUS, HAND_CONTROLLER, LINKS, MOTIONS, PIN, RECORDER, SERVOS
from hmtb_twin.parameters.variants import FLIGHT_DRIVES, FLIGHT_LINKS, FLIGHT_SERVOS

# Records by the name of their rows: one record, or a table of records by joint, body, payload or seat.
_RECORDS: Mapping[str, Any] = {
    "link": LINKS,
    "payload": PAYLOADS,
    "hydraulics": Hydraulics(),
    "friction": Friction(),
    "shoulder yaw friction": YawFriction(),
    "wrist roll friction": RollFriction(),
    "actuator": ACTUATORS,
    "servo valve": SERVO_VALVE,
    "power unit": POWER_UNIT,
    "servo": SERVOS,
    "motion": MOTIONS,
    "pin": PIN,
    "bus terminal": BUS,
    "hand controller": HAND_CONTROLLER,
    "recorder": RECORDER,
    "seat": SEATS,
    "latch": LATCH,
    "touch": TOUCH,
    "flight link": FLIGHT_LINKS,
    "flight drive": FLIGHT_DRIVES,
    "flight gear friction": GearFriction(),
    "flight wrist roll gear friction": RollGearFriction(),
    "flight servo": FLIGHT_SERVOS,
}


def provenance_table() -> tuple[Provenance, ...]:
    """Return the rows of all tagged parameters: the nominal arm first, then what differs on the arm in orbit."""
    rows: list[Provenance] = []
    for owner, records in _RECORDS.items():
        if not isinstance(records, Mapping):
            rows += provenance(owner, records)
            continue
        for name, record in records.items():
            # The payload "none" has no parameters.
            if record is not None:
                rows += provenance(f"{owner} {name}", record)
    return tuple(rows)


def markdown(row: Provenance) -> str:
    """Return one row of the table as Markdown."""
    components = row.value if isinstance(row.value, tuple) else (row.value,)
    value = " x ".join(f"{component:.5g}" for component in components)
    parameter = row.parameter.replace("_", " ")
    return f"| {row.owner.replace('_', ' ')} | {parameter} | {value} | {row.unit} | {row.tag} | {row.source} |"


if __name__ == "__main__":
    sys.stdout.write("".join(f"{markdown(row)}\n" for row in provenance_table()))
