"""The set-up record of a recording (TMATS): what was recorded, on which channel, and what each word means."""

import re
from binascii import crc_hqx
from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import quote, unquote

from hmtb_twin.bus.words import MESSAGES

TIME_CHANNEL, BUS_CHANNEL = 1, 2
"""Channels of the recording; the set-up record itself is channel 0."""

PLAIN = " _-.,+=()/*"
"""What names may hold beside letters and digits; a semicolon would end the attribute."""


@dataclass(frozen=True)
class Test:
    """One test of a run, as the set-up record announces it.

    Attributes:
        name: Its name.
        ticks: Its length, in ticks of 20 ms.
        axes: What it excites.
        planned: The length that it should have had; more than `ticks` where the memory was full.
    """

    name: str
    ticks: int
    axes: tuple[str, ...]
    planned: int

    __test__ = False
    """A test of the arm, not one of the code."""


def setup_record(tests: Sequence[Test]) -> str:
    """Write the set-up record.

    Groups G (general), R (recorder), B (bus messages and their words), C (conversion to engineering units) and V (the
    tests, an attribute of the maker's own) [IRIG2015, ch. 9].

    Args:
        tests: The tests in their sequence.

    Returns:
        Lines of attributes, ASCII.
    """
    lines = [
        r"G\PN:Hydraulic Manipulator Test Bed",
        r"G\106:15",
        r"G\DSI\N:1",
        r"G\DSI-1:HMTB",
        r"G\DST-1:STO",
        r"R-1\ID:HMTB",
        r"R-1\N:2",
        rf"R-1\DSI-1:TIME{TIME_CHANNEL}",
        rf"R-1\TK1-1:{TIME_CHANNEL}",
        rf"R-1\TK4-1:{TIME_CHANNEL}",
        r"R-1\CHE-1:T",
        r"R-1\CDT-1:TIMEIN",
        rf"R-1\CDLN-1:TIME{TIME_CHANNEL}",
        r"R-1\TTF-1:1",
        r"R-1\TFMT-1:I",
        r"R-1\TSRC-1:I",
        rf"R-1\DSI-2:BUS{BUS_CHANNEL}",
        rf"R-1\TK1-2:{BUS_CHANNEL}",
        rf"R-1\TK4-2:{BUS_CHANNEL}",
        r"R-1\CHE-2:T",
        r"R-1\CDT-2:1553IN",
        rf"R-1\CDLN-2:BUS{BUS_CHANNEL}",
        r"R-1\BTF-2:1",
        rf"B-1\DLN:BUS{BUS_CHANNEL}",
        r"B-1\NBS\N:1",
        r"B-1\BID-1:0000",
        rf"B-1\BNA-1:BUS{BUS_CHANNEL}",
        r"B-1\BT-1:1553",
        rf"B-1\NMS\N-1:{len(MESSAGES)}",
    ]
    conversions: list[str] = []
    for i, message in enumerate(MESSAGES, start=1):
        lines += [
            rf"B-1\MID-1-{i}:{i}",
            rf"B-1\MNA-1-{i}:{message.name}",
            rf"B-1\TRA-1-{i}:{message.terminal:05b}",
            rf"B-1\TRM-1-{i}:{int(message.transmits)}",
            rf"B-1\STA-1-{i}:{message.subaddress:05b}",
            rf"B-1\DWC-1-{i}:{message.count % 32:05b}",
            rf"B-1\MN\N-1-{i}:{message.count}",
        ]
        for j, word in enumerate(message.words, start=1):
            measurement = word.name if word.step is not None else f"{message.name}_{word.name}"
            lines += [
                rf"B-1\MN-1-{i}-{j}:{measurement}",
                rf"B-1\NML\N-1-{i}-{j}:1",
                rf"B-1\MWN-1-{i}-{j}-1:{j}",
                rf"B-1\MBM-1-{i}-{j}-1:FW",
                rf"B-1\MTO-1-{i}-{j}-1:MSB",
            ]
            c = len(conversions) + 1
            kind = ["BFM:UNS", "DCT:NON"] if word.step is None else ["BFM:TWO", "DCT:COE", r"CO\N:1", "CO:0"]
            scale = [] if word.step is None else [rf"C-{c}\CO-1:{word.step!r}"]
            conversions.append(
                "\n".join(
                    [rf"C-{c}\DCN:{measurement}", rf"C-{c}\MN3:{word.unit}", *(rf"C-{c}\{k}" for k in kind), *scale]
                )
            )
    lines += "\n".join(conversions).splitlines()
    ours = [r"V-1\ID:HMTB", r"V-1\VN:HTB", rf"V-1\HTB\TST\N:{len(tests)}"]
    for n, test in enumerate(tests, start=1):
        ours += [
            rf"V-1\HTB\NAM-{n}:{spelled(test.name)}",
            rf"V-1\HTB\TIC-{n}:{test.ticks}",
            rf"V-1\HTB\PLN-{n}:{test.planned}",
            rf"V-1\HTB\AXS-{n}:{' '.join(quote(axis) for axis in test.axes)}",
        ]
    return "".join(f"{line};\r\n" for line in [*lines, *ours, rf"V-1\HTB\CRC:{_check(ours)}"])


def announced(text: str) -> tuple[Test, ...]:
    """Read the tests from a set-up record.

    Args:
        text: The record.

    Returns:
        The tests in their sequence; none if the record is not ours, or their lines are damaged.
    """
    *ours, check = re.findall(r"^(V-1\\[^;]*);", text, re.M) or [""]
    if check != rf"V-1\HTB\CRC:{_check(ours)}":
        return ()
    found = dict(re.findall(r"^V-1\\HTB\\([A-Z]+-\d+):([^;]*);", text, re.M))
    tests = []
    for n in range(1, len(found) + 1):
        length, planned = found.get(f"TIC-{n}", ""), found.get(f"PLN-{n}", "")
        if f"NAM-{n}" not in found or not (length.isdecimal() and int(length) < 2**16) or not planned.isdecimal():
            break
        axes = tuple(map(unquote, found.get(f"AXS-{n}", "").split()))
        tests.append(Test(unquote(found[f"NAM-{n}"]), int(length), axes, int(planned)))
    return tuple(tests)


def _check(lines: Sequence[str]) -> str:
    """A check of our own lines: the sum that guards a packet lets two wrong bits through that cancel."""
    return f"{crc_hqx(';'.join(lines).encode(errors='replace'), 0xFFFF):04X}"


def spelled(name: str) -> str:
    """A name in plain ASCII, so that it comes back exactly: what is not plain stands as its percent code."""
    return quote(name, safe=PLAIN)
