"""Interface control table of the bus: contents, unit and scale of each word of each message."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi

import numpy as np

from hmtb_twin.bus.joint_log import WRENCH
from hmtb_twin.parameters.values import SAMPLE_RATE
from hmtb_twin.parameters.variants import JOINTS

CLOCK = 10_000_000
"""Rate of the relative time counter, Hz [IRIG2015, 10.6.1]."""

COUNTS_PER_TICK = CLOCK // SAMPLE_RATE
"""Counts of the relative time counter in one period of the position loop; a whole number, so time is exact."""

BAM = 2.0 * pi / 2**16
"""Binary angular measurement: a turn in 16 bits, rad. It is also one count of the resolvers."""

FORCE_STEP = 1.0 / 16.0
"""Scale of the force words, N; their range is 2048 N to either side."""

TORQUE_STEP = 1.0 / 64.0
"""Scale of the torque words, N m; their range is 512 N m to either side."""

LOWEST, HIGHEST = -(2**15), 2**15 - 1
"""Range of a word in two's complement."""


@dataclass(frozen=True)
class Word:
    """One data word.

    Attributes:
        name: Its quantity.
        unit: Unit of its value.
        step: Value of its least significant bit, in that unit; None for whole numbers and sets of bits.
        meaning: One line for the table.
    """

    name: str
    unit: str
    step: float | None
    meaning: str


@dataclass(frozen=True)
class Message:
    """One transfer per tick between the bus controller and a remote terminal.

    Attributes:
        name: Its name in the table: the channel of the record that it carries.
        terminal: Address of the remote terminal.
        subaddress: Subaddress within the terminal.
        transmits: Whether the terminal transmits (RT to BC) or receives (BC to RT).
        slot: Start after the tick, in counts of the relative time counter.
        quantities: Names of its values in the order of their words.
        unit: Their unit, one each.
        steps: Their scales, one each.
        has_status: Whether the control status goes with it.
    """

    name: str
    terminal: int
    subaddress: int
    transmits: bool
    slot: int
    quantities: tuple[str, ...]
    units: tuple[str, ...]
    steps: tuple[float, ...]
    has_status: bool = False

    @property
    def words(self) -> tuple[Word, ...]:
        """The data words in their sequence."""
        words = [
            Word("tick", "20 ms", None, "time tag: ticks since the test began"),
            Word("test", "1", None, "number of the test in the run, from 1"),
        ]
        for name, unit, step in zip(self.quantities, self.units, self.steps, strict=True):
            words.append(Word(name, unit, step, "two's complement"))
        if self.has_status:
            words.append(Word("status", "1", None, "flags of the control computer"))
        saturated = f"bit k: {self.quantities[0]}, ... is outside the range of its word"
        words.append(Word("saturated", "1", None, saturated))
        words.append(Word("crc", "1", None, "CRC-16 of the words before it, polynomial 1021, start FFFF"))
        words.append(Word("checksum", "1", None, "rotated exclusive or of the words before it"))
        return tuple(words)

    @property
    def count(self) -> int:
        """Number of data words."""
        return len(self.words)

    @property
    def command(self) -> int:
        """The command word: terminal, transmit bit, subaddress, word count [MilStd1978, 4.3.3.5.1]."""
        # Five bits count the words; 32 are coded as zero.
        return self.terminal << 11 | self.transmits << 10 | self.subaddress << 5 | self.count % 32

    @property
    def status(self) -> int:
        """The status word of a terminal with nothing to report [MilStd1978, 4.3.3.5.3]."""
        return self.terminal << 11

    @property
    def length(self) -> int:
        """Bytes on the bus: command, status and data words."""
        return 2 * (2 + self.count)


MESSAGES = (
    Message(
        "measured",
        terminal=1,
        subaddress=1,
        transmits=True,
        slot=0,
        quantities=tuple(f"{joint}_measured" for joint in JOINTS),
        units=("rad",) * len(JOINTS),
        steps=(BAM,) * len(JOINTS),
    ),
    Message(
        "wrench",
        terminal=2,
        subaddress=1,
        transmits=True,
        slot=5_000,
        quantities=WRENCH,
        units=("N",) * 3 + ("N m",) * 3,
        steps=(FORCE_STEP,) * 3 + (TORQUE_STEP,) * 3,
    ),
    Message(
        "commanded",
        terminal=1,
        subaddress=2,
        transmits=False,
        slot=10_000,
        quantities=tuple(f"{joint}_commanded" for joint in JOINTS),
        units=("rad",) * len(JOINTS),
        steps=(BAM,) * len(JOINTS),
        has_status=True,
    ),
)
"""Messages of every tick: the joints are read, the sensor is read, the command is sent."""


def check_words(words: np.ndarray) -> np.ndarray:
    """Return the last two words (N, 2) of messages from the words before them (N, k), 16 bits each: CRC, checksum.

    The CRC detects up to three wrong bits anywhere, which the checksum, made for slow terminals, does not.
    """
    cycle = crc(words)
    return np.column_stack([cycle, checksum(np.column_stack([words, cycle]))])


def crc(words: np.ndarray) -> np.ndarray:
    """Cyclic redundancy check of 16 bits, polynomial x^16 + x^12 + x^5 + 1, start FFFF, high bytes first [Koopman2004].

    Args:
        words: The words (N, k), 16 bits each.

    Returns:
        The checks (N,).
    """
    remainder = np.full(len(words), 0xFFFF, np.uint16)
    # Column by column: all messages at once, a byte at a time through the table of Sarwate's method.
    for word in words.T:
        for octet in (word >> 8, word & 0xFF):
            remainder = (remainder << 8) ^ _CRC_TABLE[(remainder >> 8) ^ octet]
    return remainder


def _crc_table() -> np.ndarray:
    """Return the remainder of each byte (256,) that leaves the register."""
    remainder = np.arange(256, dtype=np.uint16) << 8
    for _ in range(8):
        shifted = remainder << 1
        # x^16 leaves the register at the top; 0x1021 is the rest of the polynomial.
        remainder = np.where(remainder & 0x8000, shifted ^ 0x1021, shifted).astype(np.uint16)
    return remainder


_CRC_TABLE = _crc_table()
"""Change of the CRC by one more byte."""


def checksum(words: np.ndarray) -> np.ndarray:
    """Return the checksum (N,) of messages from the words before it (N, k), 16 bits each.

    Every word, the checksum included, rotated right by the number of words before it, adds up to zero without carries
    [MilStd2003, app. B]. A single wrong bit never passes, random words pass once in 65536.
    """
    wide = words.astype(np.uint32)
    shifts = np.arange(words.shape[1], dtype=np.uint32) % 16
    # Rotations of 16 bits, in 32 so that nothing is shifted out.
    total = np.bitwise_xor.reduce((wide >> shifts | wide << (16 - shifts)) & 0xFFFF, axis=1)
    # The checksum's own rotation, to the right, is undone to the left.
    turn = words.shape[1] % 16
    return ((total << turn | total >> (16 - turn)) & 0xFFFF).astype(np.uint16)


def interface_control_table() -> Iterator[str]:
    """Yield the table as lines of Markdown, heading first, one row per data word."""
    yield "| Message | Word | Holds | Unit | LSB | Range | Coding |"
    yield "|---|---|---|---|---|---|---|"
    for message in MESSAGES:
        way = "RT to BC" if message.transmits else "BC to RT"
        title = (
            f"**{message.name}**, RT {message.terminal}, SA {message.subaddress}, {way}, command {message.command:04X}"
        )
        for position, word in enumerate(message.words, start=1):
            if word.step is None:
                scale, span = "1", "0 to 65535"
            else:
                scale = f"{word.step:.9g}"
                span = f"{LOWEST * word.step:.7g} to {HIGHEST * word.step:.7g}"
                if word.unit == "rad":
                    scale += " (180/32768 deg)"
            yield f"| {title} | {position} | `{word.name}` | {word.unit} | {scale} | {span} | {word.meaning} |"
            # The rows below belong to the same message.
            title = ""
