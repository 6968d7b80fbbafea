"""IRIG 106 Chapter 10 files: set-up record (TMATS), time and bus packets."""

import re
from binascii import crc_hqx
from calendar import isleap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from types import ModuleType
from typing import Any
from urllib.parse import quote, unquote

import numpy as np

from hmtb_twin.bus.messages import FRAME
from hmtb_twin.bus.words import CLOCK, MESSAGES, Message, Word
from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.values import SAMPLE_RATE

TIME_CHANNEL, BUS_CHANNEL = 1, 2
"""Channels of the recording; the set-up record is channel 0."""

PLAIN = " _-.,+=()/*"
"""Characters of names besides letters and digits; a semicolon would end the attribute."""


@dataclass(frozen=True)
class Test:
    """One test of a run, as the set-up record announces it.

    Attributes:
        name: Its name.
        ticks: Its length, in ticks of 20 ms.
        axes: Excited axes.
        planned: Planned length; more than `ticks` if the memory was full.
    """

    name: str
    ticks: int
    axes: tuple[str, ...]
    planned: int

    __test__ = False
    """Tells pytest that this is a test of the arm, not of the code."""


_GENERAL_ATTRIBUTES = rf"""
G\PN:Hydraulic Manipulator Test Bed
G\106:15
G\DSI\N:1
G\DSI-1:HMTB
G\DST-1:STO
R-1\ID:HMTB
R-1\N:2
R-1\DSI-1:TIME{TIME_CHANNEL}
R-1\TK1-1:{TIME_CHANNEL}
R-1\TK4-1:{TIME_CHANNEL}
R-1\CHE-1:T
R-1\CDT-1:TIMEIN
R-1\CDLN-1:TIME{TIME_CHANNEL}
R-1\TTF-1:1
R-1\TFMT-1:I
R-1\TSRC-1:I
R-1\DSI-2:BUS{BUS_CHANNEL}
R-1\TK1-2:{BUS_CHANNEL}
R-1\TK4-2:{BUS_CHANNEL}
R-1\CHE-2:T
R-1\CDT-2:1553IN
R-1\CDLN-2:BUS{BUS_CHANNEL}
R-1\BTF-2:1
B-1\DLN:BUS{BUS_CHANNEL}
B-1\NBS\N:1
B-1\BID-1:0000
B-1\BNA-1:BUS{BUS_CHANNEL}
B-1\BT-1:1553
B-1\NMS\N-1:{len(MESSAGES)}
"""
"""Attributes of program, recorder and bus, which are the same in every run."""


def setup_record(tests: Sequence[Test]) -> str:
    """Write the set-up record.

    Groups G (general), R (recorder), B (bus messages and their words), C (conversion to engineering units) and V (the
    tests, a vendor-specific attribute) [IRIG2015, ch. 9].

    Args:
        tests: The tests in order.

    Returns:
        Lines of attributes, ASCII.
    """
    attributes = _GENERAL_ATTRIBUTES.strip().splitlines()
    measurements: list[tuple[str, Word]] = []
    for i, message in enumerate(MESSAGES, start=1):
        attributes += _message_attributes(f"1-{i}", i, message)
        for j, word in enumerate(message.words, start=1):
            # Tick, test number and checks occur in every message; the name of a measurement must be unique.
            measurement = word.name if word.step is not None else f"{message.name}_{word.name}"
            attributes += _word_attributes(f"1-{i}-{j}", j, measurement)
            measurements.append((measurement, word))
    for number, (measurement, word) in enumerate(measurements, start=1):
        attributes += _conversion_attributes(f"C-{number}", measurement, word)
    announcements = list(_test_attributes(tests))
    attributes += announcements
    attributes.append(rf"V-1\HTB\CRC:{_check(announcements)}")
    return "".join(f"{attribute};\r\n" for attribute in attributes)


def _message_attributes(key: str, position: int, message: Message) -> Iterator[str]:
    """Yield the attributes of a message of the bus."""
    yield rf"B-1\MID-{key}:{position}"
    yield rf"B-1\MNA-{key}:{message.name}"
    yield rf"B-1\TRA-{key}:{message.terminal:05b}"
    yield rf"B-1\TRM-{key}:{int(message.transmits)}"
    yield rf"B-1\STA-{key}:{message.subaddress:05b}"
    # 32 words are coded as zero, as in the command word.
    yield rf"B-1\DWC-{key}:{message.count % 32:05b}"
    yield rf"B-1\MN\N-{key}:{message.count}"


def _word_attributes(key: str, position: int, measurement: str) -> Iterator[str]:
    """Yield the attributes of a word: a measurement that fills it, most significant bit first."""
    yield rf"B-1\MN-{key}:{measurement}"
    yield rf"B-1\NML\N-{key}:1"
    yield rf"B-1\MWN-{key}-1:{position}"
    yield rf"B-1\MBM-{key}-1:FW"
    yield rf"B-1\MTO-{key}-1:MSB"


def _conversion_attributes(group: str, measurement: str, word: Word) -> Iterator[str]:
    """Yield the attributes that convert a word to its unit: none for bits, otherwise a polynomial of first order."""
    yield rf"{group}\DCN:{measurement}"
    yield rf"{group}\MN3:{word.unit}"
    if word.step is None:
        yield rf"{group}\BFM:UNS"
        yield rf"{group}\DCT:NON"
    else:
        yield rf"{group}\BFM:TWO"
        yield rf"{group}\DCT:COE"
        yield rf"{group}\CO\N:1"
        yield rf"{group}\CO:0"
        # All digits: the step of the angles is no short decimal fraction.
        yield rf"{group}\CO-1:{word.step!r}"


def _test_attributes(tests: Sequence[Test]) -> Iterator[str]:
    """Yield the attributes that announce the tests."""
    yield r"V-1\ID:HMTB"
    yield r"V-1\VN:HTB"
    yield rf"V-1\HTB\TST\N:{len(tests)}"
    for n, test in enumerate(tests, start=1):
        axes = " ".join(quote(axis) for axis in test.axes)
        yield rf"V-1\HTB\NAM-{n}:{encoded(test.name)}"
        yield rf"V-1\HTB\TIC-{n}:{test.ticks}"
        yield rf"V-1\HTB\PLN-{n}:{test.planned}"
        yield rf"V-1\HTB\AXS-{n}:{axes}"


def read_setup(text: str) -> tuple[Test, ...]:
    """Return the tests of a set-up record in order; none if the record is not of this format, or damaged."""
    *announcements, check = re.findall(r"^(V-1\\[^;]*);", text, re.M) or [""]
    if check != rf"V-1\HTB\CRC:{_check(announcements)}":
        return ()
    attributes = dict(re.findall(r"^V-1\\HTB\\([A-Z]+-\d+):([^;]*);", text, re.M))
    tests = []
    for n in range(1, len(attributes) + 1):
        length, planned = attributes.get(f"TIC-{n}", ""), attributes.get(f"PLN-{n}", "")
        # The tick word of a message has 16 bits: no test is longer.
        has_length = length.isdecimal() and int(length) < 2**16
        if f"NAM-{n}" not in attributes or not has_length or not planned.isdecimal():
            break
        axes = tuple(map(unquote, attributes.get(f"AXS-{n}", "").split()))
        tests.append(Test(unquote(attributes[f"NAM-{n}"]), int(length), axes, int(planned)))
    return tuple(tests)


def _check(lines: Sequence[str]) -> str:
    """Return the CRC of the tests' lines: two wrong bits that cancel pass the packet's checksum."""
    # Damaged text may hold replacement characters, which ASCII lacks: then the CRC just differs.
    return f"{crc_hqx(';'.join(lines).encode(errors='replace'), 0xFFFF):04X}"


def encoded(name: str) -> str:
    """Return a name in plain ASCII that decodes exactly: other characters become their percent codes."""
    return quote(name, safe=PLAIN)


SETUP, TIME, BUS = 0x01, 0x11, 0x19
"""Data types: computer-generated data of format 1, time data of format 1, MIL-STD-1553 of format 1."""

VERSION_2015 = 0x0B
"""Chapter 10 of 106-15 in the set-up record's channel-specific word."""

SETUP_VERSION, DATA_VERSION = 0x07, 0x06
"""Versions of the data types in the packet headers."""

CHECKSUM_32 = 3
"""Packet flag: a 32-bit sum of the body stands at its end."""

FIRST_BIT_OF_FIRST_WORD = 1
"""Event that the time stamps of the messages mark."""

INTERNAL_CLOCK, REAL_TIME_CLOCK, MONTH_AND_YEAR = 0, 3, 1
"""Source, format and date format of the time packets."""

_FIRST_BYTES = np.cumsum([0, *(FRAME[message.name].itemsize for message in MESSAGES[:-1])])
"""First byte of each message of a tick; the recorder has it of every message that it has."""

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
    bus_packet_class = _bus_packet_class()
    first_counter = starts[0] if starts else 0
    yield _setup_packet(setup, first_counter)
    time_packets, bus_packets = 0, 0
    for (frames, kept), start in zip(tests, starts, strict=True):
        content = np.ascontiguousarray(frames).view(np.uint8).reshape(kept.shape)
        for first in range(0, len(frames), TICKS_PER_PACKET):
            if first % SAMPLE_RATE == 0:
                yield _time_packet(start + first // SAMPLE_RATE * CLOCK, date, time_packets)
                time_packets += 1
            span = slice(first, first + TICKS_PER_PACKET)
            body = content[span][kept[span]].tobytes()
            # A packet without messages would have no time of its own.
            if body:
                packet = bus_packet_class(
                    channel_id=BUS_CHANNEL,
                    header_version=DATA_VERSION,
                    sequence_number=bus_packets % 256,
                    data_checksum=CHECKSUM_32,
                    data_type=BUS,
                    # The body begins with the time stamp of its first message.
                    rtc=int.from_bytes(body[:8], "little"),
                    count=int(kept[span][:, _FIRST_BYTES].sum()),
                    time_tag_bits=FIRST_BIT_OF_FIRST_WORD,
                )
                packet.append(body)
                yield bytes(packet)
                bus_packets += 1


def _setup_packet(setup: str, counter: int) -> bytes:
    packet = pychapter10().c10.ComputerF1(
        channel_id=0,
        header_version=SETUP_VERSION,
        data_checksum=CHECKSUM_32,
        data_type=SETUP,
        rtc=counter,
        version=VERSION_2015,
        data=setup.encode("ascii"),
    )
    return bytes(packet)


def _bus_packet_class() -> Any:
    """The library's class of 1553 packets, with the time tag bits where the standard has them.

    They are bits 31 and 30 of the channel-specific word [IRIG2015, 10.6.4]; pychapter10 1.1.19 has them in 25 and 24,
    which are reserved.
    """
    library = pychapter10()

    class BusPacket(library.c10.MS1553F1):  # type: ignore[name-defined]
        csdw_format = library.packet.BitFormat("u24 count\nu2 time_tag_bits\np6")

    return BusPacket


def _time_packet(counter: int, date: datetime, sequence_number: int) -> bytes:
    packet = pychapter10().c10.TimeF1(
        channel_id=TIME_CHANNEL,
        header_version=DATA_VERSION,
        sequence_number=sequence_number % 256,
        data_checksum=CHECKSUM_32,
        data_type=TIME,
        rtc=counter,
        time_source=INTERNAL_CLOCK,
        time_format=REAL_TIME_CLOCK,
        date_format=MONTH_AND_YEAR,
        leap=int(isleap(date.year)),
    )
    packet.time = date + timedelta(seconds=counter // CLOCK)
    return bytes(packet)
