"""A dataclass field that carries its unit, its provenance tag and its source beside its value."""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any

TAGS = ("source", "analogue", "derived", "assumed")
"""What a number may claim: a document of this machine, of a similar one, computed from others, or assumed."""


def quantity(default: Any, unit: str, tag: str, source: str) -> Any:
    """Declare a physical parameter as a dataclass field.

    Args:
        default: The value, in the unit given.
        unit: Its unit, as printed in the provenance table.
        tag: One of `TAGS`.
        source: Where the value comes from, or why it was assumed.

    Returns:
        A dataclass field with that metadata.

    Raises:
        ValueError: The tag is none of `TAGS`.
    """
    if tag not in TAGS:
        raise ValueError(f"provenance tag {tag!r} given, expected one of {', '.join(TAGS)}")
    return field(default=default, metadata={"unit": unit, "tag": tag, "source": source})


@dataclass(frozen=True)
class Provenance:
    """One line of the provenance table."""

    owner: str
    parameter: str
    value: Any
    unit: str
    tag: str
    source: str


def provenance(owner: str, record: Any) -> Iterator[Provenance]:
    """List the tagged parameters of a record.

    Args:
        owner: Name under which the record's parameters appear in the table.
        record: A dataclass whose parameters are declared with `quantity`.

    Yields:
        One `Provenance` for each tagged field, in order of declaration.
    """
    for item in fields(record):
        if "tag" in item.metadata:
            value = getattr(record, item.name)
            yield Provenance(
                owner, item.name, value, item.metadata["unit"], item.metadata["tag"], item.metadata["source"]
            )
