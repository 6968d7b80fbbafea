"""Messages between the bench and the process of an estimator: a JSON head and raw numbers, nothing that runs."""

import json
import os
import struct
from collections.abc import Mapping
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarios.files.errors import ScenarioError

MARK = b"hmtb"
MOST_HEAD = 2**20
"""Bytes of a head, at most."""

MOST_BYTES = 2**28
"""Bytes of the numbers of a message, at most."""

MOST_AXES = 8
"""Axes of an array of a message, at most."""

MOST_ARRAYS = 64
"""Arrays of a message, at most."""

_START = struct.Struct("<4sIQ")


class WireError(ScenarioError):
    """Bytes that are no message."""


def pack(fields: Mapping[str, Any], arrays: Mapping[str, NDArray[np.float64]] | None = None) -> bytes:
    """Make a message.

    Args:
        fields: What JSON can say.
        arrays: Real numbers by name, any shape.
    """
    numbers = {name: np.ascontiguousarray(values, dtype="<f8") for name, values in (arrays or {}).items()}
    shapes = [[name, list(np.shape((arrays or {})[name]))] for name in numbers]
    head = json.dumps({"fields": dict(fields), "arrays": shapes}).encode("ascii")
    body = b"".join(values.tobytes() for values in numbers.values())
    return _START.pack(MARK, len(head), len(body)) + head + body


def whole(message: bytes | bytearray) -> int | None:
    """Bytes that a message has, from its beginning; None while that is too short to tell.

    Raises:
        WireError: It is the beginning of no message.
    """
    if message[: len(MARK)] != MARK[: len(message)]:
        raise WireError(f"{bytes(message[:40])!r} is no message")
    if len(message) < _START.size:
        return None
    _, head, body = _START.unpack_from(message)
    if head > MOST_HEAD or body > MOST_BYTES:
        raise WireError(f"a message of {head} + {body} bytes, expected at most {MOST_HEAD} + {MOST_BYTES}")
    return int(_START.size + head + body)


def complete(message: bytearray) -> bool:
    """Whether all of a message is there.

    Raises:
        WireError: It is none, or something stands behind it.
    """
    size = whole(message)
    if size is not None and len(message) > size:
        raise WireError(f"{len(message) - size} bytes behind a message")
    return size is not None and len(message) == size


def unpack(message: bytes | bytearray) -> tuple[dict[str, Any], dict[str, NDArray[np.float64]]]:
    """Read a whole message.

    Returns:
        Fields and arrays.

    Raises:
        WireError: It is none.
    """
    if whole(message) != len(message):
        raise WireError(f"{len(message)} bytes are no whole message")
    _, size, _ = _START.unpack_from(message)
    at = _START.size + size
    try:
        head = json.loads(bytes(message[_START.size : at]))
        fields, shapes = head["fields"], [(str(name), tuple(shape)) for name, shape in head["arrays"]]
        if not isinstance(fields, dict) or len(shapes) > MOST_ARRAYS or not all(map(_sensible, shapes)):
            raise ValueError("neither fields nor shapes")
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise WireError(f"a message without a head: {error}") from error
    if at + 8 * sum(prod(shape) for _, shape in shapes) != len(message):
        raise WireError("a message whose numbers are not as many as its head says")
    arrays: dict[str, NDArray[np.float64]] = {}
    for name, shape in shapes:
        values = np.frombuffer(message, dtype="<f8", count=prod(shape), offset=at)
        arrays[name] = values.astype(np.float64).reshape(shape)
        at += values.nbytes
    return fields, arrays


def _sensible(named: tuple[str, tuple[Any, ...]]) -> bool:
    """Whether an array can be of a shape: also one of no numbers has a limit to its other axes."""
    _, shape = named
    if len(shape) > MOST_AXES or any(type(n) is not int or not 0 <= n <= MOST_BYTES for n in shape):
        return False
    return 8 * prod(n for n in shape if n) <= MOST_BYTES


def receive(end: int) -> bytes:
    """Wait for a message.

    Args:
        end: Number of a pipe.

    Returns:
        The message; empty where there are no more.

    Raises:
        WireError: Something else came.
    """
    message = bytearray()
    while (size := whole(message)) is None or len(message) < size:
        more = os.read(end, (_START.size if size is None else size) - len(message))
        if not more:
            return b""
        message += more
    return bytes(message)


def send(end: int, fields: Mapping[str, Any], arrays: Mapping[str, NDArray[np.float64]] | None = None) -> None:
    """Send a message.

    Args:
        end: Number of a pipe.
        fields: As in `pack`.
        arrays: As in `pack`.
    """
    rest = memoryview(pack(fields, arrays))
    while rest:
        rest = rest[os.write(end, rest) :]
