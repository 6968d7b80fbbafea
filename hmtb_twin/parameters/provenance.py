"""Provenance table: value, unit, tag and source of every number of the nominal arm and of the arm in orbit.

Run as a module it writes the table of `models/hmtb/README.md`.
"""

import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from hmtb_twin.parameters.drives import Friction, Hydraulics
from hmtb_twin.parameters.quantity import Provenance, provenance
from hmtb_twin.parameters.servo_valve import POWER_UNIT, SERVO_VALVE
from hmtb_twin.parameters.values import HAND_CONTROLLER, PIN, RECORDER
from hmtb_twin.parameters.variants import JOINTS, NUMBERS
from hmtb_twin.parameters.worksite import LATCH, SEATS, TOUCH

# Records by the name of their rows: one record, or a table of records by seat.
_RECORDS: Mapping[str, Any] = {
    "hydraulics": Hydraulics(),
    "servo valve": SERVO_VALVE,
    "power unit": POWER_UNIT,
    "pin": PIN,
    "hand controller": HAND_CONTROLLER,
    "recorder": RECORDER,
    "seat": SEATS,
    "latch": LATCH,
    "touch": TOUCH,
}


def provenance_table() -> tuple[Provenance, ...]:
    """Return the rows of all tagged parameters: the nominal arm first, then the arm in orbit."""
    rows = _shared(NUMBERS["nominal"])
    # An experiment may choose this one number of the friction, so that no arm gives it.
    rows += [row for row in provenance("friction", Friction()) if row.parameter == "presliding"]
    for owner, records in _RECORDS.items():
        if not isinstance(records, Mapping):
            rows += provenance(owner, records)
            continue
        for name, record in records.items():
            rows += provenance(f"{owner} {name}", record)
    # What is equal on both arms stands above.
    flight = [row for row in NUMBERS["flight"] if row not in NUMBERS["nominal"]]
    return (*rows, *(replace(row, owner=f"flight {row.owner}") for row in _shared(flight)))


def _shared(rows: Iterable[Provenance]) -> list[Provenance]:
    """Join the rows of joints that share a number and its source, with the joints as their owner."""
    owners: dict[Provenance, list[str]] = {}
    for row in rows:
        nobody = replace(row, owner="")
        of_joint = row.owner in JOINTS
        owners.setdefault(nobody if of_joint else row, []).append(row.owner)
    joined = []
    for row, names in owners.items():
        owner = "every joint" if set(names) == set(JOINTS) else ", ".join(names)
        joined.append(replace(row, owner=owner))
    return joined


def markdown(row: Provenance) -> str:
    """Return one row of the table as Markdown."""
    components = row.value if isinstance(row.value, tuple) else (row.value,)
    value = " x ".join(f"{component:.5g}" for component in components)
    parameter = row.parameter.replace("_", " ")
    return f"| {row.owner.replace('_', ' ')} | {parameter} | {value} | {row.unit} | {row.tag} | {row.source} |"


if __name__ == "__main__":
    sys.stdout.write("".join(f"{markdown(row)}\n" for row in provenance_table()))
