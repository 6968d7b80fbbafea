"""IRIG 106 Chapter 10 recordings of the bus: set-up record, time packets, 1553 packets of format 1."""

from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from types import ModuleType
from typing import Any

import numpy as np

from hmtb_twin.bus.messages import FRAME
from hmtb_twin.bus.tmats import BUS_CHANNEL, TIME_CHANNEL
from hmtb_twin.bus.words import CLOCK, MESSAGES
from hmtb_twin.parameters.errors import TwinError
from hmtb_twin.parameters.values import SAMPLE_RATE

SETUP, TIME, BUS = 0x01, 0x11, 0x19
"""Data types: computer-generated data of format 1, time data of format 1, MIL-STD-1553 of format 1."""

VERSION_2015 = 0x0B
"""Chapter 10 of 106-15 in the set-up record's channel-specific word."""

SETUP_VERSION, DATA_VERSION = 0x07, 0x06
"""Versions of the data types in the packet headers."""

CHECKSUM_32 = 3
"""Packet flag: a 32-bit sum of the body stands at its end."""

FIRST_BIT_OF_FIRST_WORD = 1
"""What the time stamps of the messages mark."""

INTERNAL_CLOCK, REAL_TIME_CLOCK, MONTH_AND_YEAR = 0, 3, 1
"""Source, format and date format of the time packets."""

_FIRST_BYTES = np.cumsum([0, *(FRAME[message.name].itemsize for message in MESSAGES[:-1])])
"""Where the messages of a tick begin; of each that the recorder has, it has the first byte."""

TICKS_PER_PACKET = 5
"""A packet must hold less than 100 ms of data: five ticks, whose last message ends at 82 ms."""


def pychapter10() -> ModuleType:
    """Import the library that reads and writes Chapter 10 packets.

    Raises:
        TwinError: It is not installed.
    """
    try:
        import chapter10
    except ImportError as error:
        raise TwinError("1553 records need pychapter10: pip install 'hmtb-twin[bus]'") from error
    return chapter10


def recording(
    setup: str, tests: Sequence[tuple[np.ndarray, np.ndarray]], starts: Sequence[int], date: datetime
) -> Iterator[bytes]:
    """Make the packets of a recording.

    Args:
        setup: Text of the set-up record.
        tests: For each test its ticks (N,) as `FRAME`, and which of their bytes are held (N, bytes of a tick).
        starts: Relative time counter at the first tick of each test; whole seconds.
        date: Date and time at which the counter would have been 0.

    Yields:
        The packets one after the other: set-up record first, a time packet at the beginning of every second.
    """
    c10, bus_packet = pychapter10().c10, _bus_packet()
    yield bytes(
        c10.ComputerF1(
            channel_id=0,
            header_version=SETUP_VERSION,
            data_checksum=CHECKSUM_32,
            data_type=SETUP,
            rtc=starts[0] if len(starts) else 0,
            version=VERSION_2015,
            data=setup.encode("ascii"),
        )
    )
    clock, sequence = 0, 0
    for (frames, kept), start in zip(tests, starts, strict=True):
        content = np.ascontiguousarray(frames).view(np.uint8).reshape(kept.shape)
        for first in range(0, len(frames), TICKS_PER_PACKET):
            if first % SAMPLE_RATE == 0:
                yield _time_packet(start + first // SAMPLE_RATE * CLOCK, date, clock)
                clock += 1
            part = slice(first, first + TICKS_PER_PACKET)
            body = content[part][kept[part]].tobytes()
            if body:
                packet = bus_packet(
                    channel_id=BUS_CHANNEL,
                    header_version=DATA_VERSION,
                    sequence_number=sequence % 256,
                    data_checksum=CHECKSUM_32,
                    data_type=BUS,
                    rtc=int.from_bytes(body[:8], "little"),
                    count=int(kept[part][:, _FIRST_BYTES].sum()),
                    time_tag_bits=FIRST_BIT_OF_FIRST_WORD,
                )
                packet.append(body)
                yield bytes(packet)
                sequence += 1


def _bus_packet() -> Any:
    """The library's class of 1553 packets, with the time tag bits where the standard has them.

    They are bits 31 and 30 of the channel-specific word [IRIG2015, 10.6.4]; pychapter10 1.1.19 has them in 25 and 24,
    which are reserved.
    """
    library = pychapter10()

    class BusPacket(library.c10.MS1553F1):  # type: ignore[name-defined]
        csdw_format = library.packet.BitFormat("u24 count\nu2 time_tag_bits\np6")

    return BusPacket


def _time_packet(counter: int, date: datetime, number: int) -> bytes:
    packet = pychapter10().c10.TimeF1(
        channel_id=TIME_CHANNEL,
        header_version=DATA_VERSION,
        sequence_number=number % 256,
        data_checksum=CHECKSUM_32,
        data_type=TIME,
        rtc=counter,
        time_source=INTERNAL_CLOCK,
        time_format=REAL_TIME_CLOCK,
        date_format=MONTH_AND_YEAR,
        leap=int((date.year % 4 == 0 and date.year % 100 != 0) or date.year % 400 == 0),
    )
    packet.time = date + timedelta(seconds=counter // CLOCK)
    return bytes(packet)
