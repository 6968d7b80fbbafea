"""Runs of the 1553 recorder, up to five tests in twenty minutes of memory, as Chapter 10 files."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import numpy as np

from hmtb_twin.bus.chapter10 import Test, read_setup, recording, setup_record
from hmtb_twin.bus.chapter10_scan import Scan, scan
from hmtb_twin.bus.messages import BUS_B, FAULTS, INTRA_PACKET_HEADER, BusFaults, layout, pack, unpack
from hmtb_twin.bus.record import BusRecord
from hmtb_twin.bus.words import CLOCK, COUNTS_PER_TICK, MESSAGES, check_words
from hmtb_twin.files.atomic_write import replacing
from hmtb_twin.files.errors import TwinError, system_reason
from hmtb_twin.parameters.values import SAMPLE_RATE, SAMPLE_TIME

MEMORY = 20 * 60 * SAMPLE_RATE
"""Ticks that the recorder holds: about twenty minutes [Morris1996, II.4]."""

TESTS_PER_RUN = 5
"""Largest number of tests before the memory is read out [Morris1996, II.4]."""

DATE = datetime(1996, 1, 1)
"""Default date of recordings, fixed so that the same tests make the same file."""


@dataclass(frozen=True)
class RecordedRun:
    """Result of writing a run.

    Attributes:
        path: The file.
        ticks: Ticks recorded of each test.
        message: Empty, or what did not fit: values outside the range of their words, ticks beyond the memory.
    """

    path: Path
    ticks: tuple[int, ...]
    message: str


@dataclass(frozen=True)
class BusRun:
    """Result of reading a run.

    Attributes:
        tests: The tests.
        lost: Messages that are missing, over all tests.
        message: Empty, or one line on what is missing, how much and where.
    """

    tests: tuple[BusRecord, ...]
    lost: int
    message: str = field(default="")


def runs(records: Sequence[BusRecord]) -> list[list[BusRecord]]:
    """Distribute tests over runs in order, at most `TESTS_PER_RUN` each that fit into the memory; longer ones alone."""
    groups: list[list[BusRecord]] = []
    for record in records:
        last = groups[-1] if groups else []
        if not last or len(last) == TESTS_PER_RUN or sum(map(len, last)) + len(record) > MEMORY:
            groups.append([])
        groups[-1].append(record)
    return groups


def record_run(
    records: Sequence[BusRecord], path: str | Path, *, faults: BusFaults | None = None, date: datetime = DATE
) -> RecordedRun:
    """Record tests one after the other, until the memory is full.

    Args:
        records: The tests, at most `TESTS_PER_RUN`, at the rate of the bus.
        path: The file, written under a temporary name and then renamed.
        faults: Faults of the bus; none by default.
        date: Start of the recorder's clock.

    Raises:
        TwinError: No test, too many, one at another rate, pychapter10 is missing, or the file cannot be written.
    """
    path = Path(path)
    if not 1 <= len(records) <= TESTS_PER_RUN:
        raise TwinError(f"{len(records)} tests given, expected 1 to {TESTS_PER_RUN} for one run")
    for record in records:
        # Sampling times read from a text may be off by their last digit.
        if abs(record.dt - SAMPLE_TIME) > 1e-9 * SAMPLE_TIME:
            raise TwinError(
                f"{record.name}: sampled every {record.dt:g} s; the bus passes one tick every {SAMPLE_TIME} s"
            )
    # Tests begin at whole seconds, because time packets do.
    start, used = CLOCK, 0
    tests, starts, announcements = [], [], []
    memory_full, remarks = "", []
    faults = faults or BusFaults()
    for test, record in enumerate(records, start=1):
        length = min(len(record), MEMORY - used)
        # Only the first test that is cut is named; its number of missing ticks includes those of all later ones.
        if length < len(record) and not memory_full:
            left_out = sum(map(len, records[test - 1 :])) - length
            memory_full = (
                f"memory full at tick {length} of {record.name} after {MEMORY} ticks in all; "
                f"the other {left_out} ticks were not recorded"
            )
        frames, sent = pack(record, test, start)
        frames, sent = frames[:length], sent[:length]
        clipped = _clipped_ticks(frames)
        if len(clipped):
            remarks.append(
                f"values of {record.name} stand at the end of their words' range at {len(clipped)} ticks, "
                f"from {clipped[0]} to {clipped[-1]}"
            )
        tests.append(faults.apply(frames, sent, test))
        starts.append(start)
        announcements.append(Test(record.name, length, record.axes, len(record)))
        used += length
        # The next whole second, and one of rest.
        start += (length // SAMPLE_RATE + 2) * CLOCK
    _write(path, recording(setup_record(announcements), tests, starts, date))
    if memory_full:
        remarks.append(memory_full)
    message = f"{path.name}: {'; '.join(remarks)}" if remarks else ""
    return RecordedRun(path, tuple(announcement.ticks for announcement in announcements), message)


def _clipped_ticks(frames: np.ndarray) -> np.ndarray:
    """Return the ticks at which a message says that a value is outside the range of its word."""
    clipped = np.zeros(len(frames), bool)
    for message in MESSAGES:
        # The third word from the end is `saturated`; CRC and checksum follow it.
        clipped |= frames[message.name]["data"][:, -3] != 0
    return np.flatnonzero(clipped)


def _write(path: Path, packets: Iterable[bytes]) -> None:
    """Write packets to a file that appears only when it is complete."""
    try:
        with replacing(path) as partial, partial.open("wb") as file:
            for packet in packets:
                file.write(packet)
    except OSError as error:
        raise TwinError(f"cannot write the record {path}: {system_reason(error)}") from error


def read_run(path: str | Path) -> BusRun:
    """Read all valid messages of a recording; missing values are NaN.

    A message is valid if the bus flagged no fault in it, its words are those of the interface control table, its check
    words are right, and its time stamp agrees with its tick.

    Raises:
        TwinError: No such file, no message of the arm in it, or pychapter10 is missing.
    """
    path = Path(path)
    if path.exists() and not path.is_file():  # reading a pipe may never end
        raise TwinError(f"cannot read {path}: it is no ordinary file")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise TwinError(f"cannot read {path}: {error.strerror or error}") from error
    contents = scan(data)
    announced = _announced_tests(path, contents)
    valid, flagged = _valid_messages(data, contents.offsets)
    lengths = _lengths(valid)
    if not lengths:
        packets = f"{contents.packets} whole packets" if contents.packets else "no Chapter 10 packet"
        raise TwinError(f"{path.name}: no message of the arm's bus; the file has {packets} in {len(data)} bytes")
    records, lost = [], 0
    for n in range(1, max(len(announced), *lengths) + 1):
        # Where the set-up record is lost, the messages alone tell how many tests there were and how long.
        test = announced[n - 1] if n <= len(announced) else Test(f"test-{n}", 0, (), 0)
        length = max(test.ticks, lengths.get(n, 0))
        messages = {name: rows[_test_numbers(rows) == n] for name, rows in valid.items()}
        records.append(unpack(messages, test.name, test.axes, length, SAMPLE_TIME))
        lost += sum(length - len(rows) for rows in messages.values())
    remarks = []
    missing_line = _missing_line(path.name, records, lost, flagged, contents, has_setup=bool(announced))
    if missing_line:
        remarks.append(missing_line)
    for test in announced:
        if test.planned > test.ticks:
            remarks.append(f"{test.name} was to have {test.planned} ticks, of which the memory held {test.ticks}")
    return BusRun(tuple(records), lost, "; ".join(remarks))


def _announced_tests(path: Path, contents: Scan) -> tuple[Test, ...]:
    """Return the tests of a recording's set-up record; none if it is lost or damaged."""
    setups = [tests for tests in map(read_setup, contents.setups) if tests]
    if len(setups) > 1:
        raise TwinError(f"{path.name} holds {len(setups)} recordings; expected one")
    return setups[0] if setups else ()


def _test_numbers(rows: np.ndarray) -> np.ndarray:
    """Return the test that each message belongs to (n,); the word before it is the tick."""
    return np.asarray(rows["data"][:, 1])


def _valid_messages(data: bytes, offsets: np.ndarray) -> tuple[dict[str, np.ndarray], Counter[str]]:
    """Return the valid messages by name, and the number of flagged ones by fault."""
    raw = np.frombuffer(data, np.uint8)
    # Of each message the words behind its time stamp: block status, gap times, length, command.
    offsets = offsets[offsets + INTRA_PACKET_HEADER + 2 <= len(raw)]
    heads = raw[offsets[:, None] + np.arange(8, INTRA_PACKET_HEADER + 2)].view("<u2")
    block_status, length, command = heads[:, 0], heads[:, 2], heads[:, 3]
    fault = block_status & np.uint16(sum(FAULTS)) != 0
    flagged: Counter[str] = Counter()
    for word in block_status[fault]:
        flagged[next(name for bit, name in FAULTS.items() if word & bit)] += 1
    fault_free = (block_status & ~np.uint16(BUS_B)) == 0
    valid = {}
    for message in MESSAGES:
        size = layout(message).itemsize
        fits = fault_free & (length == message.length) & (command == message.command)
        begins = offsets[fits & (offsets + size <= len(raw))]
        rows = np.ascontiguousarray(raw[begins[:, None] + np.arange(size)]).view(layout(message))[:, 0]
        words = rows["data"].astype(np.uint16)
        sound = (rows["status"] == message.status) & (check_words(words[:, :-2]) == words[:, -2:]).all(axis=1)
        sound &= (words[:, 1] >= 1) & (words[:, 1] <= TESTS_PER_RUN)
        valid[message.name] = rows[sound]
    return _of_one_clock(valid), flagged


def _of_one_clock(messages: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Drop messages whose time stamp contradicts their tick, and ticks whose messages contradict each other."""
    starts = {message.name: _test_starts(messages[message.name], message.slot) for message in MESSAGES}
    all_tests = np.concatenate([_test_numbers(rows) for rows in messages.values()])
    all_starts = np.concatenate(list(starts.values()))
    agreed = {}
    for test in np.unique(all_tests):
        # Most messages of a test agree on its start: those with a wrong stamp are few, and differ among themselves.
        values, counts = np.unique(all_starts[all_tests == test], return_counts=True)
        agreed[test] = values[np.argmax(counts)]
    consistent = {}
    for name, rows in messages.items():
        agrees = np.zeros(len(rows), bool)
        for test, start in agreed.items():
            agrees |= (_test_numbers(rows) == test) & (starts[name] == start)
        # Copies of one message are equal and count once; different messages of one tick are all doubtful.
        rows = np.unique(rows[agrees])
        test_and_tick = _test_numbers(rows).astype(np.int64) << 16 | rows["data"][:, 0]
        _, index, counts = np.unique(test_and_tick, return_inverse=True, return_counts=True)
        consistent[name] = rows[counts[index] == 1]
    return consistent


def _test_starts(rows: np.ndarray, slot: int) -> np.ndarray:
    """Return the counter at the first tick of its test that follows from stamp and tick of each message (n,)."""
    return rows["stamp"].astype(np.int64) - slot - COUNTS_PER_TICK * rows["data"][:, 0].astype(np.int64)


def _lengths(messages: dict[str, np.ndarray]) -> dict[int, int]:
    """Return the number of ticks up to the last valid message of each test."""
    lengths: dict[int, int] = {}
    for rows in messages.values():
        tests, ticks = _test_numbers(rows), rows["data"][:, 0]
        for test in map(int, np.unique(tests)):
            length = int(ticks[tests == test].max()) + 1
            lengths[test] = max(lengths.get(test, 0), length)
    return lengths


def _missing_line(
    name: str, records: Sequence[BusRecord], lost: int, flagged: Counter[str], contents: Scan, *, has_setup: bool
) -> str:
    """Return one line on what is missing; empty if nothing is."""
    damaged = contents.damaged
    # Damage without loss is possible: the messages of a damaged packet may all have been found.
    if not lost and has_setup and not damaged:
        return ""
    reasons = [f"{count} flagged {fault}" for fault, count in flagged.most_common()]
    if damaged:
        end = ", which is cut off" if contents.cut else ""
        parts = "parts" if damaged > 1 else "part"
        reasons.append(f"{damaged} damaged {parts} of the file{end}")
    if not has_setup:
        reasons.append("the set-up record is lost, and with it the names and lengths of the tests")
    total = len(MESSAGES) * sum(map(len, records))
    line = f"{name}: {lost} of {total} messages are missing"
    incomplete = [record for record in records if record.lost.any()]
    if incomplete:
        first, last = incomplete[0], incomplete[-1]
        first_tick, last_tick = np.flatnonzero(first.lost)[0], np.flatnonzero(last.lost)[-1]
        line += f", the first at tick {first_tick} of {first.name}, the last at tick {last_tick} of {last.name}"
    if reasons:
        line += f" ({'; '.join(reasons)})"
    return line + "; every other message was read"
