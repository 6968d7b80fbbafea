"""Runs of the 1553 recorder, up to five tests in twenty minutes of memory, as Chapter 10 files."""

from collections import Counter
from collections.abc import Sequence
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
        if abs(record.dt - SAMPLE_TIME) > 1e-9 * SAMPLE_TIME:
            raise TwinError(
                f"{record.name}: sampled every {record.dt:g} s; the bus passes one tick every {SAMPLE_TIME} s"
            )
    # Tests begin at whole seconds, because time packets do.
    start, used = CLOCK, 0
    tests, starts, announcements = [], [], []
    full, clipping = "", []
    for number, record in enumerate(records, start=1):
        length = min(len(record), MEMORY - used)
        if length < len(record):
            left_out = sum(map(len, records[number - 1 :])) - length
            full = full or (
                f"memory full at tick {length} of {record.name} after {MEMORY} ticks in all; "
                f"the other {left_out} ticks were not recorded"
            )
        frames, sent = pack(record, number, start)
        clipped = np.flatnonzero(sum(frames[message.name]["data"][:length, -3] != 0 for message in MESSAGES))
        if len(clipped):
            clipping.append(
                f"values of {record.name} stand at the end of their words' range at {len(clipped)} ticks, "
                f"from {clipped[0]} to {clipped[-1]}"
            )
        tests.append((faults or BusFaults()).apply(frames[:length], sent[:length], number))
        starts.append(start)
        announcements.append(Test(record.name, length, record.axes, len(record)))
        used += length
        start += (length // SAMPLE_RATE + 2) * CLOCK
    try:
        with replacing(path) as partial, partial.open("wb") as file:
            for packet in recording(setup_record(announcements), tests, starts, date):
                file.write(packet)
    except OSError as error:
        raise TwinError(f"cannot write the record {path}: {system_reason(error)}") from error
    remarks = "; ".join([*clipping, *([full] if full else [])])
    return RecordedRun(path, tuple(test.ticks for test in announcements), f"{path.name}: {remarks}" if remarks else "")


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
    setups = [tests for text in contents.setups if (tests := read_setup(text))]
    if len(setups) > 1:
        raise TwinError(f"{path.name} holds {len(setups)} recordings; expected one")
    valid, flagged = _valid_messages(data, contents.offsets)
    lengths = _lengths(valid)
    if not lengths:
        packets = f"{contents.packets} whole packets" if contents.packets else "no Chapter 10 packet"
        raise TwinError(f"{path.name}: no message of the arm's bus; the file has {packets} in {len(data)} bytes")
    known = setups[0] if setups else ()
    records, missing = [], []
    for n in range(1, max(len(known), *lengths) + 1):
        plan = known[n - 1] if n <= len(known) else None
        length = max(plan.ticks if plan else 0, lengths.get(n, 0))
        part = {name: rows[rows["data"][:, 1] == n] for name, rows in valid.items()}
        record = unpack(part, plan.name if plan else f"test-{n}", plan.axes if plan else (), length, SAMPLE_TIME)
        records.append(record)
        missing.append({name: length - len(rows) for name, rows in part.items()})
    lost = sum(sum(counts.values()) for counts in missing)
    missing_line = _missing_line(path.name, records, lost, flagged, contents, has_setup=bool(known))
    short = [
        f"{t.name} was to have {t.planned} ticks, of which the memory held {t.ticks}"
        for t in known
        if t.planned > t.ticks
    ]
    return BusRun(tuple(records), lost, "; ".join(([missing_line] if missing_line else []) + short))


def _valid_messages(data: bytes, offsets: np.ndarray) -> tuple[dict[str, np.ndarray], Counter[str]]:
    """Return the valid messages by name, and the number of flagged ones by fault."""
    raw = np.frombuffer(data, np.uint8)
    offsets = offsets[offsets + INTRA_PACKET_HEADER + 2 <= len(raw)]
    heads = raw[offsets[:, None] + np.arange(8, INTRA_PACKET_HEADER + 2)].view("<u2")
    block_status, length, command = heads[:, 0], heads[:, 2], heads[:, 3]
    fault = block_status & np.uint16(sum(FAULTS)) != 0
    flagged: Counter[str] = Counter()
    for word in block_status[fault]:
        flagged[next(name for bit, name in FAULTS.items() if word & bit)] += 1
    good = {}
    for message in MESSAGES:
        kind = layout(message)
        fits = ((block_status & ~np.uint16(BUS_B)) == 0) & (length == message.length) & (command == message.command)
        at = offsets[fits & (offsets + kind.itemsize <= len(raw))]
        rows = np.ascontiguousarray(raw[at[:, None] + np.arange(kind.itemsize)]).view(kind)[:, 0]
        words = rows["data"].astype(np.uint16)
        sound = (rows["status"] == message.status) & (check_words(words[:, :-2]) == words[:, -2:]).all(axis=1)
        sound &= (words[:, 1] >= 1) & (words[:, 1] <= TESTS_PER_RUN)
        good[message.name] = rows[sound]
    return _of_one_clock(good), flagged


def _of_one_clock(good: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Drop messages whose time stamp contradicts their tick, and ticks whose messages contradict each other."""
    starts = {m.name: _start(good[m.name], m.slot) for m in MESSAGES}
    numbers = np.concatenate([rows["data"][:, 1] for rows in good.values()])
    every = np.concatenate(list(starts.values()))
    kept = {}
    for name, rows in good.items():
        agree = np.zeros(len(rows), bool)
        for n in np.unique(numbers):
            values, counts = np.unique(every[numbers == n], return_counts=True)
            agree |= (rows["data"][:, 1] == n) & (starts[name] == values[np.argmax(counts)])
        rows = np.unique(rows[agree])
        key = rows["data"][:, 1].astype(np.int64) << 16 | rows["data"][:, 0]
        _, index, counts = np.unique(key, return_inverse=True, return_counts=True)
        kept[name] = rows[counts[index] == 1]
    return kept


def _start(rows: np.ndarray, slot: int) -> np.ndarray:
    return rows["stamp"].astype(np.int64) - slot - COUNTS_PER_TICK * rows["data"][:, 0].astype(np.int64)


def _lengths(good: dict[str, np.ndarray]) -> dict[int, int]:
    """Return the number of ticks up to the last valid message of each test."""
    lengths: dict[int, int] = {}
    for rows in good.values():
        for n in np.unique(rows["data"][:, 1]):
            last = int(rows["data"][rows["data"][:, 1] == n, 0].max()) + 1
            lengths[int(n)] = max(lengths.get(int(n), 0), last)
    return lengths


def _missing_line(
    name: str, records: Sequence[BusRecord], lost: int, flagged: Counter[str], contents: Scan, *, has_setup: bool
) -> str:
    """Return one line on what is missing; empty if nothing is."""
    damaged = contents.damaged
    if not lost and has_setup and not damaged:
        return ""
    reasons = [f"{count} flagged {fault}" for fault, count in flagged.most_common()]
    if damaged:
        end = ", which is cut off" if contents.cut else ""
        reasons.append(f"{damaged} damaged part{'s' if damaged > 1 else ''} of the file{end}")
    if not has_setup:
        reasons.append("the set-up record is lost, and with it the names and lengths of the tests")
    total = len(MESSAGES) * sum(map(len, records))
    text = f"{name}: {lost} of {total} messages are missing"
    spans = [(record.name, np.flatnonzero(record.lost)) for record in records]
    spans = [(test, ticks) for test, ticks in spans if len(ticks)]
    if spans:
        (first, a), (last, b) = spans[0], spans[-1]
        text += f", the first at tick {a[0]} of {first}, the last at tick {b[-1]} of {last}"
    if reasons:
        text += f" ({'; '.join(reasons)})"
    return text + "; every other message was read"
