"""Messages of logs as signals: MCAP files, rosbag2 folders and bags of ROS 1."""

import json
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sysid.records.arguments import shortened
from sysid.records.arrays import FloatArray
from sysid.records.channels import listed
from sysid.records.errors import SysidError
from sysid.records.optional import optional
from sysid.records.reading_process import UnreadableError, read_apart
from sysid.records.time_grid import Signal

LONGEST_VECTOR = 64  # elements of a field that is taken as a vector of channels

DAMAGED = "not an MCAP file, rosbag2 folder or bag, or a damaged one"

STEP = re.compile(r"\.?([^.\[\]]+)|\[([^\[\]]+)\]")


class _Log(NamedTuple):
    """Topics of a log, and their messages: topic, time of logging in ns, contents."""

    topics: tuple[str, ...]
    messages: Callable[[Collection[str]], Iterator[tuple[str, int, Any]]]


def message_signals(
    file: Path, inputs: Sequence[str], outputs: Sequence[str], time: str | None
) -> tuple[list[Signal], list[Signal], str]:
    """Read fields of messages as signals with the stamps of their topics, and a remark on which stamps these are.

    Fields are as `/joint_states.position[3]`; the stamps `header`, `log`, or None: those of headers if all have them.

    Raises:
        SysidError: No such log, topic or field, a package that is missing, stamps that do not increase.
    """
    try:
        u, y, remark = read_apart(read_signals, file, list(inputs), list(outputs), time)
    except (UnreadableError, OSError) as error:
        raise SysidError(f"{file.name}: {DAMAGED} ({error})") from error
    return list(map(_signal, u)), list(map(_signal, y)), remark


def _signal(fields: Sequence[Any]) -> Signal:
    """A signal as it comes from the reading process, which hands over lists for tuples."""
    times, values, names, units = fields
    return Signal(times, values, tuple(names), tuple(units))


def read_signals(
    path: str, inputs: Sequence[str], outputs: Sequence[str], time: str | None
) -> tuple[list[Signal], list[Signal], str]:
    """Do the work of `message_signals` in the reading process: packed messages may claim to fill the memory."""
    file = Path(path)
    if time not in (None, "header", "log"):
        raise SysidError(f"{file.name}: time={time!r}; expected 'header' or 'log', whose stamps logs of messages have")
    try:
        with optional("logs"), _opened(file) as log:
            paths = {field: _split(field, log.topics, file) for field in (*inputs, *outputs)}
            topics = {topic for topic, _ in paths.values()}
            values: dict[str, list[Any]] = {field: [] for field in paths}
            logged: dict[str, list[int]] = {topic: [] for topic in topics}
            headers: dict[str, list[int]] = {topic: [] for topic in topics}
            for topic, at, message in log.messages(topics):
                logged[topic].append(at)
                headers[topic].append(_header_stamp(message))
                for field, (topic_of_field, steps) in paths.items():
                    if topic_of_field == topic:
                        values[field].append(_value(message, steps, field, file))
    except (SysidError, MemoryError):
        raise
    except Exception as error:  # what the libraries raise on damaged files follows no rule
        reason = shortened(str(error), 200) or type(error).__name__
        raise SysidError(f"{file.name}: {DAMAGED} ({reason})") from error
    if empty := [topic for topic in topics if not logged[topic]]:
        raise SysidError(f"{file.name}: no messages of {listed(empty)}")
    # Stamps of two clocks have no common beginning: all topics have headers, or none is used.
    without = [topic for topic in topics if not all(headers[topic])]
    if time == "header" and without:
        raise SysidError(
            f"{file.name}: messages without a stamp in their header in {listed(without)}; expected time='log'"
        )
    ticks = logged if time == "log" or without else headers
    origin = min(ticks[topic][0] for topic in topics)
    times = {topic: _seconds(ticks[topic], origin, topic, file) for topic in topics}

    remark = "stamps are the times of logging"
    if ticks is headers:
        remark = "stamps are those of the headers"

    def signal(field: str) -> Signal:
        topic, _ = paths[field]
        return _field_signal(field, values[field], times[topic], file)

    return [signal(field) for field in inputs], [signal(field) for field in outputs], remark


def _field_signal(field: str, values: Sequence[Any], times: FloatArray, file: Path) -> Signal:
    """Values of a field as channels: one, or one for each element of a vector."""
    if len({np.shape(value) for value in values}) > 1:
        raise SysidError(f"{file.name}: {field} has vectors of several lengths; expected one")
    table = np.array(values, dtype=np.float64).reshape(len(values), -1)
    is_vector = np.shape(values[0]) != ()
    names = tuple(f"{field}[{k}]" for k in range(table.shape[1])) if is_vector else (field,)
    return Signal(times, table, names, ("",) * len(names))


def _seconds(ticks: Sequence[int], origin: int, topic: str, file: Path) -> FloatArray:
    stamps = np.array(ticks, dtype=np.int64)
    back = np.flatnonzero(np.diff(stamps) <= 0)
    if back.size:
        k = int(back[0]) + 1
        raise SysidError(
            f"{file.name}: message {k} of {topic} has the stamp {stamps[k]} ns, not after {stamps[k - 1]} ns "
            f"({back.size} such messages); expected increasing stamps (time='log' or 'header' takes the others)"
        )
    return np.asarray((stamps - origin) * 1e-9)


def _split(field: str, topics: Sequence[str], file: Path) -> tuple[str, list[str]]:
    """Topic and steps of a field: `/a.b[3]` is topic `/a`, steps `b` and `3`."""
    matching = [topic for topic in topics if field == topic or field.startswith((f"{topic}.", f"{topic}["))]
    if not matching:
        raise SysidError(f"{file.name}: no topic of {field!r}; expected TOPIC.FIELD of {listed(sorted(topics))}")
    topic = max(matching, key=len)
    return topic, [name or index for name, index in STEP.findall(field[len(topic) :])]


def _value(message: Any, steps: Sequence[str], field: str, file: Path) -> Any:
    """Number or vector of numbers in a message."""
    value = message
    try:
        for step in steps:
            if isinstance(value, dict) or not hasattr(value, "__len__"):
                value = _field(value, step)
            elif step.isdigit():
                value = value[int(step)]
            else:
                # A JointState has the names of its joints in a vector beside those of their values.
                value = value[list(_field(message, "name")).index(step)]
        array = np.asarray(value)
    except (KeyError, AttributeError, IndexError, ValueError):
        array = np.empty(0, dtype=object)
    if array.dtype.kind not in "biuf" or array.ndim > 1 or not 0 < array.size <= LONGEST_VECTOR:
        raise SysidError(f"{file.name}: no number {field!r}; its topic has {listed(list(_fields(message)))}")
    return value if array.ndim == 0 else array


def _field(value: Any, name: str) -> Any:
    return value[name] if isinstance(value, dict) else getattr(value, name)


def _fields(value: Any, prefix: str = "") -> Iterator[str]:
    """Names of the numbers in a message, vectors as `position[0..5]`."""
    if isinstance(value, bool | int | float | np.number):
        yield prefix.lstrip(".") or "a number"
    elif isinstance(value, list | tuple | np.ndarray):
        if len(value) and isinstance(value[0], int | float | np.number):
            yield f"{prefix.lstrip('.')}[0..{len(value) - 1}]"
    else:
        members = value if isinstance(value, dict) else getattr(value, "__dict__", {})
        for name, member in members.items():
            if not name.startswith("_"):
                yield from _fields(member, f"{prefix}.{name}")


def _header_stamp(message: Any) -> int:
    """Stamp of the header in ns; 0 without one."""
    try:
        stamp = _field(_field(message, "header"), "stamp")
        names = stamp if isinstance(stamp, dict) else dir(stamp)
        # ROS 2 has sec and nanosec, ROS 1 secs and nsecs, some JSON sec and nsec.
        whole = "sec" if "sec" in names else "secs"
        remainder = next(name for name in ("nanosec", "nsec", "nsecs") if name in names)
        return int(_field(stamp, whole)) * 10**9 + int(_field(stamp, remainder))
    except (KeyError, AttributeError, StopIteration, TypeError):
        return 0


@contextmanager
def _opened(file: Path) -> Iterator[_Log]:
    if file.suffix != ".mcap":
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        # Bags of ROS 2 before Iron hold no definitions: those of the standard messages are known.
        with AnyReader([file], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:

            def bag_messages(topics: Collection[str]) -> Iterator[tuple[str, int, Any]]:
                connections = [connection for connection in bag.connections if connection.topic in topics]
                for connection, at, data in bag.messages(connections=connections):
                    yield connection.topic, at, bag.deserialize(data, connection.msgtype)

            yield _Log(tuple(bag.topics), bag_messages)
        return
    from mcap.reader import make_reader

    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        # A log that was cut off has no summary: its channels are those of its messages.
        channels = summary.channels.values() if summary else (channel for _, channel, _ in reader.iter_messages())
        decoders: dict[int, Callable[[bytes], Any]] = {}

        def mcap_messages(topics: Collection[str]) -> Iterator[tuple[str, int, Any]]:
            for schema, channel, message in reader.iter_messages(topics=topics):
                if channel.id not in decoders:
                    decoders[channel.id] = _decoder(schema, channel, file)
                yield channel.topic, message.log_time, decoders[channel.id](message.data)

        yield _Log(tuple({channel.topic for channel in channels}), mcap_messages)


def _decoder(schema: Any, channel: Any, file: Path) -> Callable[[bytes], Any]:
    """Function from the bytes of a message to its contents."""
    if channel.message_encoding == "json":
        return json.loads
    definition = schema.encoding if schema else ""
    encoding = (channel.message_encoding, definition)
    if encoding not in (("cdr", "ros2msg"), ("ros1", "ros1msg")):
        raise SysidError(
            f"{file.name}: messages of {channel.topic} are encoded by {' '.join(encoding)}; expected json, or ROS "
            "messages with definitions by msg"
        )
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(schema.data.decode(), schema.name))
    read = store.deserialize_cdr if encoding[0] == "cdr" else store.deserialize_ros1
    return lambda data: read(data, schema.name)
