"""Conversion of records to 1553 messages as Chapter 10 stores them, and back; faults of the bus."""

from dataclasses import dataclass, fields
from functools import cache

import numpy as np

from hmtb_twin.bus.record import CHANNELS, BusRecord
from hmtb_twin.bus.words import COUNTS_PER_TICK, HIGHEST, LOWEST, MESSAGES, Message, check_words
from hmtb_twin.files.errors import TwinError

INTRA_PACKET_HEADER = 14
"""Bytes before the words of a message: time stamp 8, block status 2, gap times 2, length 2 [IRIG2015, 10.6.4]."""

RESPONSE_TIME = 80
"""Response time of a terminal, 0.1 us: within the permitted 4 to 12 us [MilStd1978, 4.3.3.8]."""

FIRST_BIT = {"commanded": 0, "measured": 7, "wrench": 14}
"""First bit of each message in `BusRecord.saturated`."""


@cache
def layout(message: Message) -> np.dtype:
    """Return the layout of a message in the file, packed and little-endian: intra-packet header, words in bus order."""
    answer = [("status", "<u2"), ("data", "<u2", (message.count,))]
    return np.dtype(
        [
            ("stamp", "<u8"),
            ("block_status", "<u2"),
            ("gap_times", "<u2"),
            ("length", "<u2"),
            ("command", "<u2"),
            *(answer if message.transmits else answer[::-1]),
        ]
    )


FRAME = np.dtype([(message.name, layout(message)) for message in MESSAGES])
"""One tick: its messages one after the other."""


def pack(record: BusRecord, test: int, start: int) -> tuple[np.ndarray, np.ndarray]:
    """Encode a test as messages; a value outside the range of its word saturates and sets its bit of `saturated`.

    Args:
        record: The test, at the rate of the bus.
        test: Its number in the run, from 1.
        start: Relative time counter at its first tick.

    Returns:
        The ticks (N,) as `FRAME`, and which messages exist (N, 3): those without missing values.
    """
    ticks = np.arange(len(record))
    frames = np.zeros(len(record), FRAME)
    sent = np.empty((len(record), len(MESSAGES)), bool)
    for column, message in enumerate(MESSAGES):
        values = getattr(record, message.name)
        known = np.isfinite(values).all(axis=1)
        known &= np.isfinite(record.status) if message.has_status else True
        codes = np.rint(np.where(known[:, None], values, 0.0) / np.array(message.steps))
        over = (codes < LOWEST) | (codes > HIGHEST)
        before = _flags(record.saturated) >> FIRST_BIT[message.name] & 2 ** len(message.quantities) - 1
        saturated = over @ (1 << np.arange(over.shape[1])) | before
        words = np.column_stack(
            [
                ticks,
                np.full(len(ticks), test),
                np.clip(codes, LOWEST, HIGHEST).astype(np.int64) & 0xFFFF,
                *([_flags(record.status)] if message.has_status else []),
                saturated,
            ]
        ).astype(np.uint16)
        part = frames[message.name]
        part["stamp"] = start + COUNTS_PER_TICK * ticks + message.slot
        part["gap_times"] = RESPONSE_TIME
        part["length"] = message.length
        part["command"] = message.command
        part["status"] = message.status
        part["data"] = np.column_stack([words, check_words(words)])
        sent[:, column] = known
    return frames, sent


def unpack(messages: dict[str, np.ndarray], name: str, axes: tuple[str, ...], length: int, dt: float) -> BusRecord:
    """Decode a test from its valid messages; values without a message are NaN.

    Args:
        messages: Valid messages by name, each as `layout`, at most one per tick.
        name: The test.
        axes: Excited axes.
        length: Its number of ticks.
        dt: Sampling time, s.
    """
    channels = {c: np.full((length, len(names)), np.nan) for c, (names, _) in CHANNELS.items()}
    flags = np.zeros(length, np.int64)
    known = np.zeros(length, bool)
    for message in MESSAGES:
        data = messages[message.name]["data"]
        ticks = data[:, 0].astype(np.int64)
        width = len(message.quantities)
        codes = data[:, 2 : 2 + width].astype(np.uint16).view(np.int16)
        channels[message.name][ticks] = np.array(message.steps) * codes
        if message.has_status:
            channels["status"][ticks, 0] = data[:, 2 + width]
        flags[ticks] |= data[:, -3].astype(np.int64) << FIRST_BIT[message.name]
        known[ticks] = True
    channels["saturated"][:, 0] = np.where(known, flags, np.nan)
    return BusRecord(
        name=name,
        dt=dt,
        axes=axes,
        commanded=channels["commanded"],
        measured=channels["measured"],
        wrench=channels["wrench"],
        status=channels["status"][:, 0],
        saturated=channels["saturated"][:, 0],
    )


def rounding(record: BusRecord) -> dict[str, float]:
    """Return the largest change of each channel by rounding to words, in its units; unchanged channels are left out."""
    changed = {}
    for message in MESSAGES:
        values, steps = getattr(record, message.name), np.array(message.steps)
        passed = steps * np.clip(np.rint(values / steps), LOWEST, HIGHEST)
        largest = np.abs(np.nan_to_num(values - passed)).max(initial=0.0)
        if largest > 0:
            changed[message.name] = float(largest)
    return changed


def incomplete(record: BusRecord) -> dict[str, int]:
    """Return by channel the number of ticks with some values but not all, which words cannot express."""
    counts = {}
    for message in MESSAGES:
        known = np.isfinite(getattr(record, message.name))
        if message.has_status:
            known = np.column_stack([known, np.isfinite(record.status)])
        partly = int((known.any(axis=1) & ~known.all(axis=1)).sum())
        if partly:
            counts[message.name] = partly
    return counts


def _flags(values: np.ndarray) -> np.ndarray:
    return np.nan_to_num(values).astype(np.int64)


MESSAGE_ERROR, FORMAT_ERROR, NO_RESPONSE = 1 << 12, 1 << 10, 1 << 9
WORD_COUNT_ERROR, SYNC_ERROR, INVALID_WORD = 1 << 5, 1 << 4, 1 << 3
"""Bits of the block status word [IRIG2015, 10.6.4]."""

BUS_B = 1 << 13
"""Bit that tells the two redundant buses apart; not a fault."""

FAULTS = {
    INVALID_WORD: "invalid word",
    NO_RESPONSE: "no response",
    WORD_COUNT_ERROR: "wrong word count",
    FORMAT_ERROR: "format error",
    SYNC_ERROR: "wrong sync",
    MESSAGE_ERROR: "message error",
}
"""Names of faults; the first of these bits that a message has names its fault."""


@dataclass(frozen=True)
class BusFaults:
    """Probabilities of the faults, which occur independently of each other.

    Attributes:
        dropped: Probability that the recorder misses a message completely.
        silent: Probability that a terminal does not answer a message.
        invalid: Probability that a data word fails parity. A terminal that receives one does not answer.
        short: Probability that the last data word of a message is missing. A terminal that receives too few does not
            answer.
        seed: Seed of the draws.
    """

    dropped: float = 0.0
    silent: float = 0.0
    invalid: float = 0.0
    short: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            if entry.name != "seed" and not 0.0 <= value <= 1.0:
                raise TwinError(f"{entry.name}: a probability of {value} given, expected 0 to 1")

    def apply(self, frames: np.ndarray, sent: np.ndarray, test: int) -> tuple[np.ndarray, np.ndarray]:
        """Apply the faults to the messages of a test.

        Args:
            frames: The ticks (N,) as `FRAME`; not changed.
            sent: Which messages exist (N, 3).
            test: Number of the test; each has its own draws.

        Returns:
            The ticks with flagged faults, and the bytes that the recorder keeps (N, bytes of a tick).
        """
        rng = np.random.default_rng([self.seed, test])
        frames = frames.copy()
        kept = np.ones((len(frames), FRAME.itemsize), bool)
        start = 0
        for column, message in enumerate(MESSAGES):
            part, size = frames[message.name], layout(message).itemsize
            dropped, silent, short = (
                rng.random(len(frames)) < rate for rate in (self.dropped, self.silent, self.short)
            )
            wrong = rng.random(part["data"].shape) < self.invalid
            part["data"] ^= np.where(wrong, 1 << rng.integers(16, size=wrong.shape), 0).astype(np.uint16)
            # A terminal that does not answer sends no data that could be invalid.
            heard = ~silent if message.transmits else np.ones(len(frames), bool)
            invalid, short = wrong.any(axis=1) & heard, short & heard
            unanswered = silent if message.transmits else silent | invalid | short
            part["block_status"] |= (
                np.where(invalid | short | unanswered, MESSAGE_ERROR, 0)
                | np.where(invalid, INVALID_WORD, 0)
                | np.where(short, WORD_COUNT_ERROR, 0)
                | np.where(unanswered, NO_RESPONSE, 0)
            ).astype(np.uint16)
            held = kept[:, start : start + size]
            data_end = size if message.transmits else size - 2
            held[short, data_end - 2 : data_end] = False
            held[unanswered, INTRA_PACKET_HEADER + 2 if message.transmits else size - 2 :] = False
            part["length"] = held.sum(axis=1) - INTRA_PACKET_HEADER
            held[dropped | ~sent[:, column]] = False
            start += size
        return frames, kept
