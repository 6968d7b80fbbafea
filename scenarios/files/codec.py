"""Frozen dataclasses to and from TOML and JSON: read strictly, written such that they read back equal."""

import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

from cattrs import Converter
from cattrs.errors import ClassValidationError, ForbiddenExtraKeysError, IterableValidationError, IterableValidationNote
from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn

from hmtb_twin.files.errors import shown
from scenarios.files.errors import ScenarioError, unknown

Record = TypeVar("Record")

Extended = Annotated[float, "also unknown or infinite"]
"""A number that may be NaN, null in a file, or infinite, there the text inf or -inf."""

NAMES: Mapping[Any, str] = {
    bool: "true or false",
    int: "whole number",
    float: "finite number",
    str: "text",
    Extended: "number",
}
"""Types of values in messages."""


def structure(kind: type[Record], value: object, where: str = "") -> Record:
    """Build a record, or a value of any type that a record can hold, from parsed TOML or JSON.

    Args:
        kind: A dataclass, whose missing fields keep their defaults; or a type of its fields.
        value: The parsed table or value. Values of `kind` itself stay as they are.
        where: Place of the value in the file, for messages.

    Raises:
        ScenarioError: A key is unknown or missing, or a value has another type or is out of range. The message names
            the place and, for unknown keys, the nearest one.
    """
    try:
        return _CONVERTER.structure(value, kind)
    except RecursionError as error:
        raise ScenarioError(f"{where or 'it'}: values nested too deeply") from error
    except (ExceptionGroup, ValueError, OverflowError) as error:
        raise ScenarioError(next(_problems(error, where))) from error


def unstructure(record: object) -> dict[str, Any]:
    """Write a record as a table of plain values; `structure` reads it back. Fields that are None are left out."""
    table: dict[str, Any] = _CONVERTER.unstructure(record)
    return table


def plain_numbers(value: Any) -> Any:
    """Replace NumPy's numbers and arrays by Python's, NaN by None, and infinities by the texts inf and -inf."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    if isinstance(value, Mapping):
        return {str(key): plain_numbers(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain_numbers(item) for item in value]
    return value


def changes(record: object, nominal: object) -> dict[str, Any]:
    """Write those fields of a record that differ from those of another record of its type."""
    table = unstructure(record)
    return {key: value for key, value in table.items() if getattr(record, key) != getattr(nominal, key)}


def register(kind: type[Record], read: Callable[[object], Record], write: Callable[[Record], object]) -> None:
    """Read and write a class by functions of its own, wherever it is a field.

    Args:
        kind: The class.
        read: From a parsed value; it raises `ScenarioError`.
        write: To plain values.
    """

    def read_unless_built(value: object, _: type) -> Record:
        return value if isinstance(value, kind) else read(value)

    _CONVERTER.register_structure_hook(kind, read_unless_built)
    _CONVERTER.register_unstructure_hook(kind, write)


def from_json(kind: type[Record], text: str | bytes, source: str) -> Record:
    """Read a record from JSON; `source` names the file in errors, which are those of `structure`."""
    try:
        return structure(kind, json.loads(text))
    except ScenarioError as error:
        raise ScenarioError(f"{source}: {error}") from error
    except (ValueError, RecursionError) as error:
        raise ScenarioError(f"{source}: not a JSON file ({error})") from error


def to_toml(table: Mapping[str, Any], path: tuple[str, ...] = ()) -> str:
    """Write plain values as TOML: values first, then tables, then arrays of tables.

    tomli-w writes every array over several lines; a line for each keeps waveforms of a hundred points readable, and the
    text that records carry as their provenance keeps its bytes.

    Args:
        table: Texts, numbers, truth values, lists and tables of them.
        path: Names of the tables around it.
    """
    values, tables, arrays = [], [], []
    for key, value in table.items():
        name = ".".join((*path, key))
        if isinstance(value, Mapping):
            tables.append(f"[{name}]\n{to_toml(value, (*path, key))}")
        elif _has_tables(value):
            arrays += [f"[[{name}]]\n{to_toml(row, (*path, key))}" for row in value]
        else:
            values.append(f"{key} = {_toml(value)}\n")
    # A value behind the head of a table would belong to that table.
    paragraphs = ["".join(values), *tables, *arrays]
    return "\n".join(paragraph for paragraph in paragraphs if paragraph)


def _has_tables(value: object) -> bool:
    """Whether a value is a list of tables."""
    return isinstance(value, list | tuple) and bool(value) and isinstance(value[0], Mapping)


def _toml(value: object) -> str:
    # JSON's texts, finite numbers and lists are TOML's, but for one control character.
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")


class _WrongValueError(ValueError):
    """A value of another type; its message continues a sentence that begins with the place."""


def _scalar(kind: type, passes: Callable[[Any], bool]) -> None:
    """Read values of a plain type only if they pass: `int(True)` and `float("1")` would hide a slip."""
    expected = NAMES[bool] if kind is bool else f"a {NAMES[kind]}"

    def read(value: Any, _: type) -> Any:
        if not passes(value):
            raise _WrongValueError(f"must be {expected}, given {shown(value)}")
        return kind(value)

    _CONVERTER.register_structure_hook(kind, read)
    _CONVERTER.register_unstructure_hook(kind, kind)  # numbers and texts of NumPy become Python's


def _extended(value: Any, _: Any) -> float:
    if not (value is None or type(value) in (int, float) or value in ("inf", "-inf")):
        raise _WrongValueError(f"must be a number, inf, -inf or null, given {shown(value)}")
    return math.nan if value is None else float(value)


def _sequence_hook(kind: Any) -> Callable[[Any, Any], tuple[Any, ...]]:
    types = get_args(kind)
    length = None if types[1:] == (...,) else len(types)
    described = f"{NAMES.get(types[0], 'table')}s"
    if length is not None:
        described = f"{length} {described}"

    def read(value: Any, _: Any) -> tuple[Any, ...]:
        if not isinstance(value, list | tuple) or length not in (None, len(value)):
            raise _WrongValueError(f"must be a list of {described}, given {shown(value)}")
        result = []
        for index, item in enumerate(value):
            item_type = types[0] if length is None else types[index]
            try:
                result.append(_CONVERTER.structure(item, item_type))
            except (ExceptionGroup, _WrongValueError) as error:
                # From this note `_problems` takes the place of the value.
                error.add_note(IterableValidationNote("", index, types[0]))
                raise IterableValidationError("", [error], kind) from error
        return tuple(result)

    return read


def _table_hook(kind: Any) -> Callable[[Any, Any], Any]:
    read_table = make_dict_structure_fn(kind, _CONVERTER, _cattrs_forbid_extra_keys=True)

    def read(value: Any, _: Any) -> Any:
        if isinstance(value, kind):
            return value
        if not isinstance(value, Mapping):
            raise _WrongValueError(f"must be a table, given {shown(value)}")
        return read_table(value, kind)

    return read


def _plain_hook(kind: Any) -> Callable[[Any], dict[str, Any]]:
    write = make_dict_unstructure_fn(kind, _CONVERTER)
    return lambda record: {key: value for key, value in write(record).items() if value is not None}


def _problems(error: BaseException, where: str) -> Iterator[str]:
    """One line for each problem, unknown keys first: a misspelt key is why another one is missing."""
    if isinstance(error, ClassValidationError):
        yield from _table_problems(error, where)
    elif isinstance(error, IterableValidationError):
        ((item_error, note), *_), _ = error.group_exceptions()
        place = f"{where}.{note.index}" if isinstance(note.index, str) else f"{where}[{note.index}]"
        yield from _problems(item_error, place)
    elif isinstance(error, ForbiddenExtraKeysError):
        keys = [field.name for field in fields(error.cl)]
        for key in sorted(map(str, error.extra_fields)):
            yield f"{_before(where)}{unknown('key', key, keys)}"
    elif isinstance(error, _WrongValueError):
        yield f"{where or 'it'} {error}"
    else:
        yield str(error)  # of a record that refuses its values, whose message names it


def _table_problems(error: ClassValidationError, where: str) -> Iterator[str]:
    of_fields, of_the_table = error.group_exceptions()
    for problem in sorted(of_the_table, key=lambda problem: not isinstance(problem, ForbiddenExtraKeysError)):
        yield from _problems(problem, where)
    missing = [note.name for problem, note in of_fields if isinstance(problem, KeyError)]
    if missing:
        yield f"{_before(where)}missing {', '.join(missing)}; it takes {', '.join(get_type_hints(error.cl))}"
    for problem, note in of_fields:
        if not isinstance(problem, KeyError):
            place = f"{where}.{note.name}" if where else note.name
            yield from _problems(problem, place)


def _before(where: str) -> str:
    return f"{where}: " if where else ""


_CONVERTER = Converter(forbid_extra_keys=True)
_CONVERTER.register_structure_hook_factory(lambda kind: get_origin(kind) is tuple, _sequence_hook)
_CONVERTER.register_structure_hook_factory(lambda kind: isinstance(kind, type) and is_dataclass(kind), _table_hook)
_CONVERTER.register_unstructure_hook_factory(lambda kind: isinstance(kind, type) and is_dataclass(kind), _plain_hook)
_scalar(bool, lambda value: isinstance(value, bool))
_scalar(int, lambda value: isinstance(value, int) and not isinstance(value, bool))
_scalar(float, lambda value: isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= 1e308)
_scalar(str, lambda value: isinstance(value, str))
_CONVERTER.register_structure_hook_factory(lambda kind: kind == Extended, lambda _: _extended)
