"""Dataclass field of a physical parameter, with unit, provenance tag and source beside the value."""

from dataclasses import dataclass, field, fields
from typing import Any

TAGS = ("source", "analogue", "derived", "assumed")
"""Provenance tags: documented for this machine, for a similar one, computed from other numbers, or assumed."""


def quantity(default: Any, unit: str, tag: str, source: str) -> Any:
    """Declare a physical parameter as a dataclass field.

    Args:
        default: The value, in `unit`.
        unit: Its unit, as printed in the provenance table.
        tag: One of `TAGS`.
        source: Where the value comes from, or why it was assumed.

    Returns:
        A dataclass field with that metadata.

    Raises:
        ValueError: The tag is not one of `TAGS`.
    """
    if tag not in TAGS:
        raise ValueError(f"provenance tag {tag!r} given, expected one of {', '.join(TAGS)}")
    return field(default=default, metadata={"unit": unit, "tag": tag, "source": source})


@dataclass(frozen=True)
class Provenance:
    """One row of the provenance table."""

    owner: str
    parameter: str
    value: Any
    unit: str
    tag: str
    source: str


def provenance(owner: str, record: Any) -> tuple[Provenance, ...]:
    """Return one row for each parameter of a record that is declared with `quantity`, in order of declaration."""
    rows = []
    for parameter in fields(record):
        if "tag" in parameter.metadata:
            rows.append(Provenance(owner, parameter.name, getattr(record, parameter.name), **parameter.metadata))
    return tuple(rows)
