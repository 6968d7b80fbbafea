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
    header = [("stamp", "<u8"), ("block_status", "<u2"), ("gap_times", "<u2"), ("length", "<u2")]
    command, status, data = ("command", "<u2"), ("status", "<u2"), ("data", "<u2", (message.count,))
    # A terminal that transmits sends its status ahead of the data, one that receives answers after them.
    words = [command, status, data] if message.transmits else [command, data, status]
    return np.dtype([*header, *words])


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
        complete = np.isfinite(getattr(record, message.name)).all(axis=1)
        if message.has_status:
            complete &= np.isfinite(record.status)
        words = _data_words(record, message, complete, test)
        rows = frames[message.name]
        rows["stamp"] = start + COUNTS_PER_TICK * ticks + message.slot
        rows["gap_times"] = RESPONSE_TIME
        rows["length"] = message.length
        rows["command"] = message.command
        rows["status"] = message.status
        rows["data"] = np.column_stack([words, check_words(words)])
        sent[:, column] = complete
    return frames, sent


def _data_words(record: BusRecord, message: Message, complete: np.ndarray, test: int) -> np.ndarray:
    """Return the data words (N, k) of a message ahead of its check words, 16 bits each."""
    # Ticks with lost values get zeros, which no conversion to integers objects to; they are not sent.
    values = np.where(complete[:, None], getattr(record, message.name), 0.0)
    codes = np.rint(values / np.array(message.steps))
    over = (codes < LOWEST) | (codes > HIGHEST)
    # A record that has passed the bus before, as a file, keeps the bits that it already has.
    earlier = _flags(record.saturated) >> FIRST_BIT[message.name] & 2 ** len(message.quantities) - 1
    saturated = over @ (1 << np.arange(over.shape[1])) | earlier
    # Two's complement in 16 bits.
    coded = np.clip(codes, LOWEST, HIGHEST).astype(np.int64) & 0xFFFF
    columns = [np.arange(len(record)), np.full(len(record), test), coded]
    if message.has_status:
        columns.append(_flags(record.status))
    columns.append(saturated)
    return np.column_stack(columns).astype(np.uint16)


def unpack(messages: dict[str, np.ndarray], name: str, axes: tuple[str, ...], length: int, dt: float) -> BusRecord:
    """Decode a test from its valid messages; values without a message are NaN.

    Args:
        messages: Valid messages by name, each as `layout`, at most one per tick.
        name: The test.
        axes: Excited axes.
        length: Its number of ticks.
        dt: Sampling time, s.
    """
    channels = {}
    for channel, (names, _) in CHANNELS.items():
        channels[channel] = np.full((length, len(names)), np.nan)
    flags = np.zeros(length, np.int64)
    received = np.zeros(length, bool)
    for message in MESSAGES:
        data = messages[message.name]["data"]
        ticks = data[:, 0].astype(np.int64)
        width = len(message.quantities)
        # Behind tick and test; the cast makes the order of bytes that of the machine, as the sign's bit needs.
        codes = data[:, 2 : 2 + width].astype(np.uint16).view(np.int16)
        channels[message.name][ticks] = np.array(message.steps) * codes
        if message.has_status:
            channels["status"][ticks, 0] = data[:, 2 + width]
        # The third word from the end holds the saturation bits of this message alone.
        flags[ticks] |= data[:, -3].astype(np.int64) << FIRST_BIT[message.name]
        received[ticks] = True
    channels["saturated"][:, 0] = np.where(received, flags, np.nan)
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
        # Lost values count as unchanged.
        largest = np.abs(np.nan_to_num(values - passed)).max(initial=0.0)
        if largest > 0:
            changed[message.name] = float(largest)
    return changed


def incomplete(record: BusRecord) -> dict[str, int]:
    """Return by channel the number of ticks with some values but not all, which words cannot express."""
    counts = {}
    for message in MESSAGES:
        finite = np.isfinite(getattr(record, message.name))
        if message.has_status:
            finite = np.column_stack([finite, np.isfinite(record.status)])
        incomplete_ticks = int((finite.any(axis=1) & ~finite.all(axis=1)).sum())
        if incomplete_ticks:
            counts[message.name] = incomplete_ticks
    return counts


def _flags(values: np.ndarray) -> np.ndarray:
    """Return flags held as floats as integers; lost ones have no bit set."""
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
        for attribute in fields(self):
            value = getattr(self, attribute.name)
            if attribute.name != "seed" and not 0.0 <= value <= 1.0:
                raise TwinError(f"{attribute.name}: a probability of {value} given, expected 0 to 1")

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
        # By byte, because a fault may cut a message short.
        kept = np.ones((len(frames), FRAME.itemsize), bool)
        start = 0
        for column, message in enumerate(MESSAGES):
            rows, size = frames[message.name], layout(message).itemsize
            # The order of the draws is part of what a seed means: dropped, silent, short, wrong words, wrong bits.
            dropped = rng.random(len(frames)) < self.dropped
            silent = rng.random(len(frames)) < self.silent
            short = rng.random(len(frames)) < self.short
            wrong = rng.random(rows["data"].shape) < self.invalid
            # One wrong bit fails the parity of a word.
            rows["data"] ^= np.where(wrong, 1 << rng.integers(16, size=wrong.shape), 0).astype(np.uint16)
            invalid = np.asarray(wrong.any(axis=1))
            if message.transmits:
                # A terminal that does not answer sends no data that could be invalid.
                invalid, short = invalid & ~silent, short & ~silent
                unanswered = silent
                # Words on the bus: command, status, data.
                first_lost, data_end = INTRA_PACKET_HEADER + 2, size
            else:
                unanswered = silent | invalid | short
                # Words on the bus: command, data, status.
                first_lost, data_end = size - 2, size - 2
            rows["block_status"] |= _block_status(invalid, short, unanswered)
            held = kept[:, start : start + size]
            held[short, data_end - 2 : data_end] = False
            held[unanswered, first_lost:] = False
            rows["length"] = held.sum(axis=1) - INTRA_PACKET_HEADER
            held[dropped | ~sent[:, column]] = False
            start += size
        return frames, kept


def _block_status(invalid: np.ndarray, short: np.ndarray, unanswered: np.ndarray) -> np.ndarray:
    """Return the fault bits of the block status words (N,) of messages."""
    errors = np.where(invalid | short | unanswered, MESSAGE_ERROR, 0)
    errors |= np.where(invalid, INVALID_WORD, 0)
    errors |= np.where(short, WORD_COUNT_ERROR, 0)
    errors |= np.where(unanswered, NO_RESPONSE, 0)
    return errors.astype(np.uint16)
