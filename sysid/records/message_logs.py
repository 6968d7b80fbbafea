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


SELECTOR = re.compile(r"@([^.\[\]]+)")
"""A publisher behind its topic: `@2`, or `@elbow,wrist` by the joints that it names."""

MOST_CLOSE = 0.05
"""Share of steps below half of their median from which messages of several publishers are mixed."""


class _Log(NamedTuple):
    """Topics of a log, and their messages: topic, publisher if it is known, time of logging in ns, contents."""

    topics: tuple[str, ...]
    messages: Callable[[Collection[str]], Iterator[tuple[str, str, int, Any]]]


class _Publisher(NamedTuple):
    """What tells the publishers of a topic apart.

    Attributes:
        source: Name of the node or number of the channel, if the log has several for the topic.
        joints: Names of joints in their order; empty of other messages.
        frame: Frame of the header.
    """

    source: str
    joints: tuple[str, ...]
    frame: str

    def text(self) -> str:
        """What is known of the publisher."""
        parts = [", ".join(self.joints), self.source, f"frame {self.frame}" if self.frame else ""]
        return "; ".join(filter(None, parts)) or "no names"


class _Field(NamedTuple):
    """A field as it is asked for.

    Attributes:
        name: Its text.
        topic: Its topic.
        publisher: Number or joints of the publisher; empty if none is chosen.
        steps: Steps from a message to the value.
    """

    name: str
    topic: str
    publisher: str
    steps: tuple[str, ...]


class _Topic:
    """Stamps in ns of the messages of a topic, and which publisher each is from."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.logged: list[int] = []
        self.headers: list[int] = []
        self.senders: list[int] = []
        self.publishers: dict[_Publisher, int] = {}
        self.order_of_set: dict[frozenset[str], tuple[str, ...]] = {}

    def add(self, source: str, at: int, message: Any) -> None:
        """Take note of a message."""
        joints = _joints(message)
        # Numbers of elements mean those of the first message, also where the order of the names changes later.
        self.order_of_set.setdefault(frozenset(joints), joints)
        publisher = _Publisher(source, joints, _frame(message))
        self.logged.append(at)
        self.headers.append(_header_stamp(message))
        self.senders.append(self.publishers.setdefault(publisher, len(self.publishers)))

    def chosen(self, field: _Field, file: Path) -> set[int]:
        """Numbers from 0 of the publishers that a field chooses."""
        if not field.publisher:
            return set(self.publishers.values())
        joints = tuple(field.publisher.split(","))
        numbers = {k for publisher, k in self.publishers.items() if publisher.joints == joints}
        if field.publisher.isdigit() and 0 < int(field.publisher) <= len(self.publishers):
            numbers = {int(field.publisher) - 1}
        if not numbers:
            raise SysidError(f"{file.name}: no publisher @{field.publisher} of {self.name}; there are {self.text()}")
        return numbers

    def text(self) -> str:
        """The publishers, as they are chosen."""
        labels = []
        for publisher, k in self.publishers.items():
            labels.append(f"{self.name}@{k + 1} ({publisher.text()}; {self.senders.count(k)} messages)")
        return ", ".join(labels)


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
            fields = {name: _split(name, log.topics, file) for name in (*inputs, *outputs)}
            topics = {field.topic: _Topic(field.topic) for field in fields.values()}
            values: dict[str, list[tuple[int, Any]]] = {name: [] for name in fields}
            for topic, source, at, message in log.messages(list(topics)):
                number = len(topics[topic].logged)
                topics[topic].add(source, at, message)
                for name, field in fields.items():
                    if field.topic == topic and _has_joint(message, field.steps):
                        values[name].append((number, _by_name(message, field, topics[topic], file)))
    except (SysidError, MemoryError):
        raise
    except Exception as error:  # what the libraries raise on damaged files follows no rule
        reason = shortened(str(error), 200) or type(error).__name__
        raise SysidError(f"{file.name}: {DAMAGED} ({reason})") from error
    if empty := [topic.name for topic in topics.values() if not topic.logged]:
        raise SysidError(f"{file.name}: no messages of {listed(empty)}")
    # Stamps of two clocks have no common beginning: all topics have headers, or none is used.
    without = [topic.name for topic in topics.values() if not all(topic.headers)]
    if time == "header" and without:
        raise SysidError(
            f"{file.name}: messages without a stamp in their header in {listed(without)}; expected time='log'"
        )
    of_logging = time == "log" or bool(without)
    remarks = ["stamps are the times of logging" if of_logging else "stamps are those of the headers"]
    # The earliest message of all, so that differences are small and exact.
    origin = min((topic.logged if of_logging else topic.headers)[0] for topic in topics.values())
    # Fields that are stamped together share one array: the grid then takes them for one clock.
    clocks: dict[tuple[str, bytes], FloatArray] = {}
    signals: dict[str, Signal] = {}
    for name, field in fields.items():
        topic_of_field = topics[field.topic]
        samples, remark = _from_chosen(field, values[name], topic_of_field, file)
        # That on the stamps stays the last: the remarks of the grid follow it.
        remarks[:0] = [remark] if remark and remark not in remarks else []
        numbers = [number for number, _ in samples]
        ticks = topic_of_field.logged if of_logging else topic_of_field.headers
        key = (field.topic, np.array(numbers).tobytes())
        if key not in clocks:
            clocks[key] = _seconds(ticks, numbers, origin, topic_of_field, file)
        signals[name] = _field_signal(name, [value for _, value in samples], clocks[key], file)
    return [signals[name] for name in inputs], [signals[name] for name in outputs], "; ".join(remarks)


def _from_chosen(
    field: _Field, values: Sequence[tuple[int, Any]], topic: _Topic, file: Path
) -> tuple[list[tuple[int, Any]], str]:
    """Numbers and values of the messages from the chosen publisher, and a remark where several send the field.

    Raises:
        SysidError: No message has the joint, no such publisher, or nodes that send the same joint.
    """
    chosen = topic.chosen(field, file)
    samples = [(number, value) for number, value in values if topic.senders[number] in chosen]
    if not samples:
        raise SysidError(f"{file.name}: no joint of {field.name!r}; there are {topic.text()}")
    senders = {topic.senders[number] for number, _ in samples}
    if field.publisher or len(senders) == 1:
        return samples, ""
    sources = {publisher.source for publisher, k in topic.publishers.items() if k in senders}
    if len(sources) > 1:
        raise SysidError(f"{file.name}: {field.name!r} has several publishers: {_choose(topic)}")
    return samples, f"messages of {topic.name} differ in joints or frame and are read by name: {topic.text()}"


def _choose(topic: _Topic) -> str:
    return f"{topic.text()}; expected one, as {topic.name}@1.FIELD"


def _field_signal(field: str, values: Sequence[Any], times: FloatArray, file: Path) -> Signal:
    """Values of a field as channels: one, or one for each element of a vector."""
    if len({np.shape(value) for value in values}) > 1:
        raise SysidError(f"{file.name}: {field} has vectors of several lengths; expected one")
    table = np.array(values, dtype=np.float64).reshape(len(values), -1)
    is_vector = np.shape(values[0]) != ()
    names = tuple(f"{field}[{k}]" for k in range(table.shape[1])) if is_vector else (field,)
    return Signal(times, table, names, ("",) * len(names))


def _seconds(ticks: Sequence[int], numbers: Sequence[int], origin: int, topic: _Topic, file: Path) -> FloatArray:
    """Seconds since the origin of the messages with these numbers.

    Raises:
        SysidError: Stamps that do not increase, or messages of several publishers close to each other.
    """
    stamps = np.array(ticks, dtype=np.int64)[list(numbers)]
    steps = np.diff(stamps)
    is_mixed = len({topic.senders[number] for number in numbers}) > 1
    back = np.flatnonzero(steps <= 0)
    if is_mixed and (back.size or (steps < 0.5 * np.median(steps)).mean() > MOST_CLOSE):
        raise SysidError(f"{file.name}: the stamps of {topic.name} are those of several publishers: {_choose(topic)}")
    if back.size:
        k = int(back[0]) + 1
        raise SysidError(
            f"{file.name}: message {numbers[k]} of {topic.name} has the stamp {stamps[k]} ns, not after "
            f"{stamps[k - 1]} ns ({back.size} such messages); expected increasing stamps (time='log' or 'header' takes "
            f"the others)"
        )
    return np.asarray((stamps - origin) * 1e-9)


def _split(field: str, topics: Sequence[str], file: Path) -> _Field:
    """Topic, publisher and steps of a field: `/a@2.b[3]` is topic `/a`, publisher `2`, steps `b` and `3`."""
    matching = [topic for topic in topics if field == topic or field.startswith(tuple(topic + mark for mark in ".[@"))]
    if not matching:
        raise SysidError(f"{file.name}: no topic of {field!r}; expected TOPIC.FIELD of {listed(sorted(topics))}")
    topic = max(matching, key=len)
    rest = field[len(topic) :]
    selector = SELECTOR.match(rest)
    publisher = selector[1] if selector else ""
    path = rest[selector.end() :] if selector else rest
    return _Field(field, topic, publisher, tuple(name or index for name, index in STEP.findall(path)))


def _joints(message: Any) -> tuple[str, ...]:
    """Names of the joints of a message, in its order; empty of other messages."""
    try:
        names = _field(message, "name")
    except (KeyError, AttributeError, TypeError):
        return ()
    if isinstance(names, list | tuple | np.ndarray) and all(isinstance(name, str) for name in names):
        return tuple(map(str, names))
    return ()


def _has_joint(message: Any, steps: Sequence[str]) -> bool:
    """Whether a message has the joint of a field; true of fields that are no joint's."""
    joints = _joints(message)
    return len(steps) < 2 or not joints or steps[-1] in joints or steps[-1].isdigit()


def _frame(message: Any) -> str:
    try:
        return str(_field(_field(message, "header"), "frame_id"))
    except (KeyError, AttributeError, TypeError):
        return ""


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


def _by_name(message: Any, field: _Field, topic: _Topic, file: Path) -> Any:
    """Value of a field, elements in the order that the joints have in the first message."""
    joints = _joints(message)
    order = topic.order_of_set[frozenset(joints)]
    steps = field.steps
    if joints == order or len(order) != len(joints):
        return _value(message, steps, field.name, file)
    if steps[-1].isdigit() and int(steps[-1]) < len(order):
        return _value(message, (*steps[:-1], order[int(steps[-1])]), field.name, file)
    value = _value(message, steps, field.name, file)
    if np.shape(value) == (len(joints),):
        return np.asarray(value)[[joints.index(joint) for joint in order]]
    return value


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

            def bag_messages(topics: Collection[str]) -> Iterator[tuple[str, str, int, Any]]:
                connections = [connection for connection in bag.connections if connection.topic in topics]
                sources = {connection.id: _node(connection) for connection in connections}
                for connection, at, data in bag.messages(connections=connections):
                    message = bag.deserialize(data, connection.msgtype)
                    yield connection.topic, sources[connection.id], at, message

            yield _Log(tuple(bag.topics), bag_messages)
        return
    from mcap.reader import make_reader

    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        # A log that was cut off has no summary: its channels are those of its messages.
        channels = summary.channels.values() if summary else (channel for _, channel, _ in reader.iter_messages())
        decoders: dict[int, Callable[[bytes], Any]] = {}

        def mcap_messages(topics: Collection[str]) -> Iterator[tuple[str, str, int, Any]]:
            for schema, channel, message in reader.iter_messages(topics=topics):
                if channel.id not in decoders:
                    decoders[channel.id] = _decoder(schema, channel, file)
                yield channel.topic, f"channel {channel.id}", message.log_time, decoders[channel.id](message.data)

        yield _Log(tuple({channel.topic for channel in channels}), mcap_messages)


def _node(connection: Any) -> str:
    """Name of the node behind a connection, which bags of ROS 1 have; empty of others."""
    return str(getattr(connection.ext, "callerid", None) or "")


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
