"""JSON that keeps every bit of a number, and is refused where it is not exactly what was written."""

import json
import math
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sysid.records.arguments import shortened, shown
from sysid.records.errors import SysidError

LARGEST_FILE = 2**30  # bytes
EXACT_DIGITS = 15  # of whole numbers that float64 holds exactly
KINDS = "biufcU"  # of arrays that JSON can hold


def parsed(path: Path) -> Any:
    """Parse a JSON file.

    Raises:
        SysidError: No file, no UTF-8, no JSON, brackets nested too deep, numbers beyond float64, NaN or a key twice.
    """
    try:
        if (size := path.stat().st_size) > LARGEST_FILE:
            raise SysidError(f"{path.name}: {size} bytes, expected at most {LARGEST_FILE}")
        text = path.read_bytes().decode("utf-8")
        return json.loads(
            text, parse_float=_number, parse_int=_whole, parse_constant=_refused, object_pairs_hook=_without_duplicates
        )
    except OSError as error:
        raise SysidError(f"cannot read {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise SysidError(f"{path.name}: expected JSON in UTF-8, got other bytes at {error.start}") from error
    except json.JSONDecodeError as error:
        raise SysidError(f"{path.name}: no JSON, or cut short: {error}") from error
    except RecursionError as error:
        raise SysidError(f"{path.name}: brackets are nested too deep, expected three levels of a matrix") from error
    except SysidError as error:
        raise SysidError(f"{path.name}: {str(error).removeprefix(f'{path.name}: ')}") from error


def _number(text: str) -> float:
    value = float(text)
    if math.isinf(value):
        raise SysidError(f"the number {shortened(text)} is beyond float64")
    return value


def _whole(text: str) -> int | float:
    return int(text) if len(text) <= EXACT_DIGITS else _number(text)


def _refused(text: str) -> None:
    raise SysidError(f"{text} given, expected finite numbers, or null where a value is not known")


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
        lines = [f"{inner}{json.dumps(key)}: {text_of(entry, inner)}" for key, entry in value.items()]
    elif isinstance(value, list) and any(isinstance(entry, list) for entry in value):
        lines = [f"{inner}{text_of(entry, inner)}" for entry in value]
    else:
        return json.dumps(value, allow_nan=False)
    start, end = "{}" if isinstance(value, dict) else "[]"
    return "\n".join((start, ",\n".join(lines), indent + end))


def encoded(value: Any) -> Any:
    """Turn numbers, texts, arrays, tuples and mappings into what JSON holds; tables with one key say what JSON lacks.

    Raises:
        TypeError: Anything else.
    """
    if isinstance(value, np.ndarray) and value.dtype.kind in KINDS:
        return {"array": encoded(value.tolist()), "shape": list(value.shape)}
    if isinstance(value, np.generic):
        return encoded(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return {"float": str(value)}
    if isinstance(value, complex):
        return {"complex": [encoded(value.real), encoded(value.imag)]}
    if isinstance(value, Mapping):
        return {"mapping": {str(key): encoded(entry) for key, entry in value.items()}}
    if isinstance(value, tuple | list):
        return [encoded(entry) for entry in value]
    if isinstance(value, bool | int | float | str | None):
        return value
    raise TypeError(f"{type(value).__name__} has no form in JSON")


def decoded(where: str, value: Any) -> Any:
    """Inverse of `encoded`; sequences become tuples.

    Raises:
        SysidError: A table that `encoded` does not write.
    """
    if isinstance(value, list):
        return tuple(decoded(where, entry) for entry in value)
    if not isinstance(value, dict):
        return value
    try:
        match value:
            case {"array": list() as entries, "shape": list() as shape, **rest} if not rest:
                array = np.array(decoded(where, entries)).reshape(shape)
                if array.dtype.kind in KINDS:
                    return array
            case {"float": "nan" | "inf" | "-inf" as text, **rest} if not rest:
                return float(text)
            case {"complex": [real, imaginary], **rest} if not rest:
                return complex(decoded(where, real), decoded(where, imaginary))
            case {"mapping": dict() as entries, **rest} if not rest:
                return {key: decoded(where, entry) for key, entry in entries.items()}
    except (TypeError, ValueError) as error:
        raise SysidError(f"{where}: {error}") from error
    raise SysidError(f"{where}: unknown table {shown(value)}, expected one of array, float, complex, mapping")


def table(where: str, value: Any, required: Collection[str], optional: Collection[str] = ()) -> dict[str, Any]:
    """Check that a value is a table with all the required keys, and no others but the optional ones."""
    if not isinstance(value, dict):
        raise SysidError(f"{where}: expected a table, got {shown(value)}")
    for key in value:
        if key not in {*required, *optional}:
            raise SysidError(f"{where}: unknown key {shown(key)}, expected {', '.join((*required, *optional))}")
    if missing := [key for key in required if key not in value]:
        raise SysidError(f"{where}: lacks {', '.join(missing)}")
    return value


def texts(where: str, value: Any) -> tuple[str, ...]:
    """Check that a value is a list of texts."""
    if not isinstance(value, list) or not all(isinstance(entry, str) for entry in value):
        raise SysidError(f"{where}: expected a list of texts, got {shown(value)}")
    return tuple(value)
