"""Messages between the bench and the process that starts programs: JSON, and pipes that go along."""

import contextlib
import json
import os
import socket
import struct
from collections.abc import Sequence
from typing import Any

SIZE = struct.Struct("<q")
"""How long a message is, in bytes, before it."""


def send(control: socket.socket, message: dict[str, Any], ends: Sequence[int] = ()) -> None:
    """Send a message.

    Args:
        control: Where.
        message: What JSON can say.
        ends: Numbers of pipes that go along.
    """
    text = json.dumps(message).encode("ascii")
    if ends:
        socket.send_fds(control, [SIZE.pack(len(text))], list(ends))
    else:
        control.sendall(SIZE.pack(len(text)))
    control.sendall(text)


def receive(control: socket.socket) -> tuple[dict[str, Any], list[int]]:
    """Wait for a message and the pipes that come along.

    Args:
        control: From where.

    Raises:
        ValueError: There are no more, or it is none.
        OSError: Nothing comes in time.
    """
    head, ends, _, _ = socket.recv_fds(control, SIZE.size, 3)
    with contextlib.ExitStack() as left:
        for end in ends:
            left.callback(os.close, end)
        size = SIZE.unpack(head + _exactly(control, SIZE.size - len(head)))[0]
        message = json.loads(_exactly(control, size))
        left.pop_all()
    return message, ends


def _exactly(control: socket.socket, size: int) -> bytes:
    got = bytearray()
    while len(got) < size:
        more = control.recv(size - len(got))
        if not more:
            raise ValueError("it has ended")
        got += more
    return bytes(got)
