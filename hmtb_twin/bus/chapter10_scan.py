"""Search for every message in the bytes of a Chapter 10 file, however damaged the rest of it is."""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO

import numpy as np

from hmtb_twin.bus.chapter10 import BUS, SETUP, pychapter10
from hmtb_twin.bus.messages import INTRA_PACKET_HEADER
from hmtb_twin.bus.words import MESSAGES

SYNC = b"\x25\xeb"
"""The first two bytes of every packet."""

HEADER = 24
"""Bytes of a packet header."""


@dataclass(frozen=True)
class Scan:
    """Contents of a file.

    Attributes:
        offsets: Offsets of messages, in bytes from the beginning of the file (M,).
        setups: Texts of the set-up records.
        packets: Number of whole packets.
        damaged: Number of parts of the file that are in no whole packet.
        cut: Whether the file ends inside a packet.
    """

    offsets: np.ndarray
    setups: tuple[str, ...]
    packets: int
    damaged: int
    cut: bool


def scan(data: bytes) -> Scan:
    """Read the packets of a file; search damaged parts for the messages themselves.

    In whole packets all messages are listed, in damaged parts all offsets with length and command word of a known
    message; its own checksum decides later whether it is one.
    """
    offsets: list[int] = []
    setups: list[str] = []
    packets = damaged = 0
    done = 0
    for begin, end, data_type, body_end in _packets(data):
        if begin > done:
            damaged += 1
            offsets += _search(data, done, begin)
        packets += 1
        done = end
        # The channel-specific word, of 4 bytes, comes before the content.
        content = begin + HEADER + 4
        if data_type == BUS:
            offsets += _walk(data, content, body_end)
        elif data_type == SETUP:
            setups.append(data[content:body_end].decode("ascii", errors="replace"))
    cut = done < len(data)
    if cut:
        damaged += 1
        offsets += _search(data, done, len(data))
    # Equal set-up records count once; two different ones are those of two recordings.
    different_setups = tuple(dict.fromkeys(setups))
    return Scan(np.array(offsets, dtype=np.int64), different_setups, packets, damaged, cut)


def _packets(data: bytes) -> Iterator[tuple[int, int, int, int]]:
    """Yield the whole packets with right checksums: begin, end, data type, end of the body."""
    library = pychapter10().packet
    position = data.find(SYNC)
    while 0 <= position <= len(data) - HEADER:
        length = int.from_bytes(data[position + 4 : position + 8], "little")
        # The library checks the header again; this check first keeps the search of large damaged files fast.
        *words, total = struct.unpack_from("<12H", data, position)
        if sum(words) & 0xFFFF == total and HEADER + 4 <= length <= len(data) - position:
            raw = data[position : position + length]
            try:
                packet = library.Packet(BytesIO(raw))
            except (library.InvalidPacket, EOFError, ValueError):
                packet = None
            if packet is not None and not packet.secondary_header and _sound(raw, packet):
                yield position, position + length, packet.data_type, position + HEADER + packet.data_length
                position += length
                if data[position : position + 2] == SYNC:
                    continue
        # Go on behind a sync that begins no packet, or at once where a whole packet is followed by something else.
        if data[position : position + 2] == SYNC:
            position += 1
        position = data.find(SYNC, position)


def _sound(raw: bytes, packet: object) -> bool:
    """Return whether the body fits into the packet and matches its checksum."""
    # Code 0 to 3: none, or a sum of bytes, of 16-bit or of 32-bit words [IRIG2015, 10.6.1].
    size = (0, 1, 2, 4)[packet.data_checksum]  # type: ignore[attr-defined]
    end = len(raw) - size
    if HEADER + packet.data_length > end or (end - HEADER) % max(size, 1):  # type: ignore[attr-defined]
        return False
    if size == 0:
        return True
    total = int(np.frombuffer(raw, f"<u{size}", (end - HEADER) // size, HEADER).sum(dtype=np.uint64))
    return total % 256**size == int.from_bytes(raw[end:], "little")


def _walk(data: bytes, position: int, end: int) -> Iterator[int]:
    """Yield the offsets of the messages of a whole packet."""
    while position + INTRA_PACKET_HEADER <= end:
        yield position
        (length,) = struct.unpack_from("<H", data, position + INTRA_PACKET_HEADER - 2)
        # A message of odd length is followed by a filler byte.
        position += INTRA_PACKET_HEADER + length + length % 2


_SIGNATURE = re.compile(b"|".join(re.escape(struct.pack("<HH", m.length, m.command)) for m in MESSAGES))
"""Length and command word of a message, which are adjacent."""


def _search(data: bytes, begin: int, end: int) -> Iterator[int]:
    """Yield the offsets in a damaged part at which a message may begin."""
    position = begin
    while (match := _SIGNATURE.search(data, position, end)) is not None:
        # Only one byte on: a chance match must not hide a message that overlaps it.
        position = match.start() + 1
        start = match.start() - (INTRA_PACKET_HEADER - 2)
        if start >= begin:
            yield start
