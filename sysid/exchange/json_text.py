"""Records as JSON that keeps every bit of a number, and is refused where it is not exactly what was written."""

import json
import math
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, fields, is_dataclass
from itertools import chain
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np

from sysid.records.arguments import shown
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

LARGEST_FILE = 2**30  # bytes
LONGEST_WHOLE = 20  # digits, those of 64 bits
KINDS = "biufcU"  # of arrays that JSON can hold
EXPECTED = {float: "a number", int: "a whole number", str: "a text", tuple: "a list", Mapping: "a table"}


def parsed(path: Path) -> Any:
    """Parse a JSON file.

    Raises:
        SysidError: No file, no JSON in UTF-8, NaN, or a key twice.
    """
    if path.exists() and not path.is_file():  # reading a pipe may never end
        raise SysidError(f"cannot read {path}: no ordinary file")
    try:
        if (size := path.stat().st_size) > LARGEST_FILE:
            raise SysidError(f"{size} bytes, expected at most {LARGEST_FILE}")
        text = path.read_bytes().decode("utf-8")
        return json.loads(text, parse_constant=_refused, parse_int=_whole, object_pairs_hook=_without_duplicates)
    except OSError as error:
        raise SysidError(f"cannot read {path}: {error.strerror}") from error
    except ValueError as error:
        raise SysidError(f"no JSON in UTF-8, or cut short: {error}") from error
    except RecursionError as error:
        raise SysidError("brackets are nested too deep, expected three levels of a matrix") from error


def _refused(constant: str) -> None:
    raise SysidError(f"{constant} given, expected finite numbers, or null where a value is not known")


def _whole(digits: str) -> int:
    # Python takes quadratic time for a number of many digits.
    if len(digits) > LONGEST_WHOLE:
        raise SysidError(f"a whole number of {len(digits)} digits, expected at most {LONGEST_WHOLE}")
    return int(digits)


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        keys = [key for key, _ in pairs]
        raise SysidError(f"the key {shown(next(key for key in keys if keys.count(key) > 1))} stands twice in one table")
    return table


def text_of(value: Any, indent: str = "") -> str:
    """A value as JSON: a line for every key and every row of a matrix; floats by their shortest exact decimals."""
    inner = f"{indent} "
    if isinstance(value, dict) and value:
        lines = []
        for key, item in value.items():
            lines.append(f"{inner}{json.dumps(key)}: {text_of(item, inner)}")
    elif isinstance(value, list) and any(isinstance(item, list) for item in value):
        lines = [f"{inner}{text_of(item, inner)}" for item in value]
    else:
        return json.dumps(value, allow_nan=False)
    start, end = "{}" if isinstance(value, dict) else "[]"
    return "\n".join((start, ",\n".join(lines), indent + end))


def encoded(value: Any) -> Any:
    """Turn a field into JSON: records into tables of their fields, arrays into rows with null for NaN.

    Entries of mappings may be anything: `tagged`; those that JSON cannot hold are left out.
    """
    if is_dataclass(value):
        return {field.name: encoded(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, np.ndarray):
        rows = value.astype(object)
        rows[np.isnan(value)] = None
        return rows.tolist()
    if isinstance(value, Mapping):
        table = {}
        for key, item in value.items():
            with suppress(TypeError):
                table[str(key)] = tagged(item)
        return table
    return [encoded(item) for item in value] if isinstance(value, tuple) else value


def decoded(where: str, value: Any, kind: Any) -> Any:
    """Inverse of `encoded` for a field of some type.

    Raises:
        SysidError: Another type, or keys that are missing or unknown.
    """
    origin = get_origin(kind)
    if isinstance(kind, type) and is_dataclass(kind):
        return kind(**decoded_fields(where, value, kind))
    if origin is np.ndarray:
        return _array(where, value)
    if origin is Mapping and isinstance(value, dict):
        return {key: untagged(f"{where}.{key}", item) for key, item in value.items()}
    if origin is tuple and isinstance(value, list):
        return tuple(decoded(where, item, get_args(kind)[0]) for item in value)
    if type(None) in get_args(kind):
        return None if value is None else decoded(where, value, get_args(kind)[0])
    # JSON writes a float without decimals as a whole number.
    accepted = int | float if kind is float else kind
    if kind in EXPECTED and isinstance(value, accepted) and not isinstance(value, bool):
        return kind(value)
    raise SysidError(f"{where}: expected {EXPECTED[origin or kind]}, got {shown(value)}")


def decoded_fields(where: str, value: Any, kind: type, **instead: Sequence[str]) -> dict[str, Any]:
    """Fields of a record by name; a table may have some keys instead of a field, and lack fields with a default."""
    read = [field for field in fields(kind) if field.name not in instead]
    required = [field.name for field in read if field.default is MISSING]
    optional = [field.name for field in read if field.default is not MISSING]
    checked_keys(where, value, required, (*optional, *chain.from_iterable(instead.values())))
    hints = get_type_hints(kind)
    decoded_values = {}
    for name in (field.name for field in read):
        if name in value:
            decoded_values[name] = decoded(f"{where}.{name}", value[name], hints[name])
    return decoded_values


def checked_keys(where: str, value: Any, required: Collection[str], optional: Collection[str] = ()) -> None:
    """Check that a value is a table with all the required keys, and no others but the optional ones."""
    if not isinstance(value, dict):
        raise SysidError(f"{where}: expected a table, got {shown(value)}")
    for key in value:
        if key not in (*required, *optional):
            raise SysidError(f"{where}: unknown key {shown(key)}, expected {', '.join((*required, *optional))}")
    if missing := [key for key in required if key not in value]:
        raise SysidError(f"{where}: lacks {', '.join(missing)}")


def _array(where: str, value: Any) -> FloatArray:
    """Array from nested lists of numbers; null becomes NaN."""

    def with_nan(item: Any) -> Any:
        if isinstance(item, list):
            return [with_nan(inner) for inner in item]
        return np.nan if item is None else item

    try:
        array = np.array(with_nan(value))
    except ValueError as error:
        raise SysidError(f"{where}: expected rows of equal length") from error
    if array.dtype.kind not in "if" or not array.ndim or np.isinf(array).any():
        raise SysidError(f"{where}: expected numbers of 64 bits in lists, got {shown(value)}")
    return array.astype(np.float64)


def tagged(value: Any) -> Any:
    """Turn numbers, texts, arrays, tuples and mappings into what JSON holds; tables with one key say what JSON lacks.

    Raises:
        TypeError: Anything else.
    """
    if isinstance(value, np.ndarray) and value.dtype.kind in KINDS:
        return {"array": tagged(value.tolist()), "shape": list(value.shape)}
    if isinstance(value, np.generic):
        return tagged(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return {"float": str(value)}
    if isinstance(value, complex):
        return {"complex": [tagged(value.real), tagged(value.imag)]}
    if isinstance(value, Mapping):
        return {"mapping": {str(key): tagged(item) for key, item in value.items()}}
    if isinstance(value, tuple | list):
        return [tagged(item) for item in value]
    if isinstance(value, bool | int | float | str | None):
        return value
    raise TypeError(f"{type(value).__name__} has no form in JSON")


def untagged(where: str, value: Any) -> Any:
    """Inverse of `tagged`; sequences become tuples.

    Raises:
        SysidError: A table that `tagged` does not write.
    """
    if isinstance(value, list):
        return tuple(untagged(where, item) for item in value)
    if not isinstance(value, dict):
        return value
    try:
        match value:
            case {"array": list() as items, "shape": list() as shape, **rest} if not rest:
                array = np.array(untagged(where, items)).reshape(shape)
                if array.dtype.kind in KINDS:
                    return array
            case {"float": "nan" | "inf" | "-inf" as number, **rest} if not rest:
                return float(number)
            case {"complex": [real, imaginary], **rest} if not rest:
                return complex(untagged(where, real), untagged(where, imaginary))
            case {"mapping": dict() as items, **rest} if not rest:
                return {key: untagged(where, item) for key, item in items.items()}
    except (TypeError, ValueError) as error:
        raise SysidError(f"{where}: {error}") from error
    raise SysidError(f"{where}: unknown table {shown(value)}, expected one of array, float, complex, mapping")
