"""Values of a TOML file: checked against a type when read, written such that they read back equal."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from numbers import Integral, Real
from typing import Any, TypeVar, get_type_hints

import numpy as np

from scenarios.files.errors import ScenarioError, unknown

Record = TypeVar("Record")


def record(kind: type[Record], key: str, table: object) -> Record:
    """Build a flat dataclass from a TOML table; what the table leaves out keeps its default.

    Args:
        kind: The dataclass; its fields are numbers, texts and truth values.
        key: Name of the table, for messages.
        table: The parsed table.

    Returns:
        The record.

    Raises:
        ScenarioError: No table, an unknown key, a value of another type, or a missing one.
    """
    if not isinstance(table, Mapping):
        raise ScenarioError(f"{key} must be a table, given {table!r}")
    hints = get_type_hints(kind)
    for entry in table:
        if entry not in hints:
            raise ScenarioError(f"{key}: {unknown('key', entry, hints)}")
    required = [f.name for f in fields(kind) if f.default is MISSING and f.default_factory is MISSING]  # type: ignore[arg-type]
    missing = [name for name in required if name not in table]
    if missing:
        raise ScenarioError(f"{key} needs {', '.join(missing)}; it takes {', '.join(hints)}")
    return kind(**{entry: typed(f"{key}.{entry}", value, hints[entry]) for entry, value in table.items()})


def typed(key: str, value: object, expected: object) -> Any:
    """Check a TOML value against a type; only whole numbers pass for float."""
    checks: Mapping[object, tuple[Callable[[object], bool], Callable[[Any], object], str]] = {
        bool: (lambda v: isinstance(v, bool), bool, "true or false"),
        int: (lambda v: isinstance(v, int) and not isinstance(v, bool), int, "a whole number"),
        float: (
            _is_number,
            float,
            "a finite number",
        ),
        str: (lambda v: isinstance(v, str), str, "a text"),
        tuple[float, ...]: (
            lambda v: isinstance(v, list | tuple) and all(_is_number(entry) for entry in v),
            lambda v: tuple(float(entry) for entry in v),
            "a list of finite numbers",
        ),
        tuple[str, ...]: (
            lambda v: isinstance(v, list | tuple) and all(isinstance(entry, str) for entry in v),
            tuple,
            "a list of texts",
        ),
    }
    passes, convert, wanted = checks[expected]
    if not passes(value):
        raise ScenarioError(f"{key} must be {wanted}, given {value!r}")
    return convert(value)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < sys.float_info.max


def written(value: object) -> str:
    """Write a value as TOML."""
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    # NumPy's numbers show their types.
    if isinstance(value, Integral):
        return repr(int(value))
    if isinstance(value, Real):
        return repr(float(value))
    if isinstance(value, tuple):
        return "[" + ", ".join(written(entry) for entry in value) + "]"
    return '"' + "".join(_escape(character) for character in str(value)) + '"'


def _escape(character: str) -> str:
    if character in '"\\':
        return "\\" + character
    # TOML basic strings hold no control characters; everything else may stand as it is.
    return character if ord(character) >= 0x20 and ord(character) != 0x7F else f"\\u{ord(character):04X}"
