"""Logs that the packages of the formats wrote: MCAP by mcap, rosbag2 and bags by rosbags."""

import json
import os
import sys

import numpy as np
import pytest

from sysid import oe, read_experiments, read_log
from sysid.records.message_logs import read_signals
from tests.refusals import refused

pytest.importorskip("mcap")
rosbags = pytest.importorskip("rosbags.typesys")

START = 1_767_225_600 * 10**9
RNG = np.random.default_rng(1)
COMMANDS = START + 100_000_000 * np.arange(200)
STATES = START + 20_000_000 * np.arange(1000) + RNG.integers(-1_000_000, 1_000_000, 1000)
LOGGED = STATES + RNG.integers(1_000_000, 9_000_000, 1000)
U = RNG.choice([-1.0, 1.0], 200)
LAG = 5.0
"""Bandwidth of the joint, rad/s."""


def angles():
    """A lag of first order behind the held commands, at the stamps of its sensor."""
    instants = np.union1d(COMMANDS, STATES)
    held, steps, angle = U[np.clip((instants - START) // 100_000_000, 0, 199)], np.diff(instants) * 1e-9, [0.0]
    for u, decay in zip(held[:-1], np.exp(-LAG * steps), strict=True):
        angle.append(u + (angle[-1] - u) * decay)
    return np.array(angle)[np.searchsorted(instants, STATES)]


Y = angles()
FIELDS = {"inputs": ["/cmd.data"], "outputs": ["/joint_states.position[elbow]"]}


def messages(store):
    """Topic, type, time of logging and contents of every message; the joints change places."""
    kinds = store.types
    header, stamp, state = (
        kinds[name] for name in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "sensor_msgs/msg/JointState")
    )
    for at, u in zip(COMMANDS, U, strict=True):
        yield "/cmd", "std_msgs/msg/Float64", int(at), kinds["std_msgs/msg/Float64"](float(u))
    for k, (at, logged, y) in enumerate(zip(STATES, LOGGED, Y, strict=True)):
        ros1 = {"seq": k} if "seq" in header.__dataclass_fields__ else {}
        head = header(**ros1, stamp=stamp(int(at // 10**9), int(at % 10**9)), frame_id="")
        joints = [("base", 9.0), ("elbow", y)][:: 1 if k % 2 else -1]
        position, none = np.array([value for _, value in joints]), np.empty(0)
        content = state(head, [name for name, _ in joints], position, none, none)
        yield "/joint_states", "sensor_msgs/msg/JointState", int(logged), content


def rosbag(path, opened, store, serialize):
    """Write all messages by a writer of rosbags."""
    with opened as writer:
        connections = {}
        for topic, kind, at, message in messages(store):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], at, serialize(message, kind))
    return path


def rosbag2(folder, storage):
    from rosbags.rosbag2 import StoragePlugin, Writer

    store = rosbags.get_typestore(rosbags.Stores.ROS2_HUMBLE)
    return rosbag(folder, Writer(folder, version=9, storage_plugin=StoragePlugin[storage]), store, store.serialize_cdr)


def rosbag1(path):
    from rosbags.rosbag1 import Writer

    store = rosbags.get_typestore(rosbags.Stores.ROS1_NOETIC)
    return rosbag(path, Writer(path), store, store.serialize_ros1)


def mcap_json(path, encoding="json"):
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("numbers", "jsonschema", b"{}")
        topics = {name: writer.register_channel(name, encoding, schema) for name in ("/cmd", "/joint_states")}
        for at, u in zip(COMMANDS, U, strict=True):
            writer.add_message(topics["/cmd"], int(at), json.dumps({"data": u}).encode(), int(at))
        for at, y in zip(STATES, Y, strict=True):
            content = {"name": ["base", "elbow"], "position": [9.0, y]}
            writer.add_message(topics["/joint_states"], int(at), json.dumps(content).encode(), int(at))
        writer.finish()
    return path


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sqlite3", "mcap", "file", "json", "bag"])
def test_a_joint_is_identified_from_a_log_of_messages(tmp_path, kind):
    folder = tmp_path / "robot"
    if kind == "bag":
        path = rosbag1(tmp_path / "robot.bag")
    elif kind == "json":
        path = mcap_json(tmp_path / "robot.mcap")
    else:
        path = rosbag2(folder, "MCAP" if kind == "file" else kind.upper())
        path = next(folder.glob("*.mcap")) if kind == "file" else path
    with pytest.warns(match="stamps are the times of logging; resampled every 0.02 s, as /cmd.data: 200 stamps"):
        data = read_log(path, **FIELDS)
    assert (data.dt, data.name, data.nu, data.ny) == (0.02, path.stem, 1, 1)
    with pytest.warns():
        (same,) = read_experiments(path, **FIELDS)
    np.testing.assert_array_equal(same.y, data.y)
    # Stamps of logging are late by 5 ms on average and jitter by 2 ms.
    pole = np.abs(oe(data, 2, 1, 1).poles()).max()
    assert -np.log(pole) / data.dt == pytest.approx(LAG, rel=0.02)


def test_headers_hold_the_stamps_of_the_sensor(tmp_path):
    path = rosbag2(tmp_path / "robot", "SQLITE3")
    joints = {"inputs": ["/joint_states.position[base]"], "outputs": ["/joint_states.position[elbow]"]}
    with pytest.warns(match="stamps are those of the headers; resampled"):
        data = read_log(path, **joints)
    np.testing.assert_allclose(data.y[:, 0], np.interp(data.time, (STATES - STATES[0]) * 1e-9, Y), atol=2e-3)
    refused("messages without a stamp in their header in /cmd", read_log, path, **FIELDS, time="header")
    refused("time='stamp'; expected 'header' or 'log'", read_log, path, **FIELDS, time="stamp")
    for field, message in (
        ("/odom.x", "no topic of '/odom.x'; expected TOPIC.FIELD of /cmd, /joint_states"),
        ("/joint_states.speed", r"no number '/joint_states.speed'; its topic has .*position\[0\.\.1\]"),
    ):
        refused(message, read_log, path, inputs=["/cmd.data"], outputs=[field])
    refused("time_unit='s', but stamps of messages are in ns", read_experiments, path, **FIELDS, time_unit="s")


@pytest.mark.slow
def test_damaged_and_foreign_logs_are_refused(tmp_path):
    path = mcap_json(tmp_path / "robot.mcap")
    content = path.read_bytes()
    for damaged in (content[:3000], content[:-40], content[:500] + bytes(200) + content[700:], b"", b"x" * 900):
        path.write_bytes(damaged)
        refused("robot.mcap: not an MCAP file, rosbag2 folder or bag, or a damaged one", read_log, path, **FIELDS)
    foreign = mcap_json(path, "protobuf")
    refused("messages of .* are encoded by protobuf jsonschema; expected json, or ROS", read_log, foreign, **FIELDS)
    (tmp_path / "folder").mkdir()
    refused("folder: not an MCAP file, rosbag2 folder or bag", read_log, tmp_path / "folder", **FIELDS)
    os.mkfifo(tmp_path / "folder" / "pipe")
    refused("holds a pipe", read_log, tmp_path / "folder", **FIELDS)
    refused("no data file", read_log, tmp_path / "none.mcap", **FIELDS)


@pytest.mark.slow
def test_the_extra_is_named_where_it_is_missing(tmp_path, monkeypatch):
    path = mcap_json(tmp_path / "robot.mcap")
    monkeypatch.setitem(sys.modules, "mcap.reader", None)
    message = r"this needs the package mcap: pip install './sysid\[logs\]'"
    refused(message, read_signals, str(path), **FIELDS, time=None)


def joint_states(folder, published):
    """A rosbag2 of messages (k, joints, positions) of /joint_states, every 10 ms."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    store = rosbags.get_typestore(rosbags.Stores.ROS2_HUMBLE)
    kinds = store.types
    header, stamp, state = (
        kinds[name] for name in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "sensor_msgs/msg/JointState")
    )
    with Writer(folder, version=9, storage_plugin=StoragePlugin["SQLITE3"]) as writer:
        connection = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
        for k, joints, positions in published:
            at = START + 10_000_000 * k
            head = header(stamp=stamp(at // 10**9, at % 10**9), frame_id="")
            content = state(head, joints, np.array(positions), np.empty(0), np.empty(0))
            writer.write(connection, at, store.serialize_cdr(content, state.__msgtype__))
    return folder


@pytest.mark.parametrize("field", ["/joint_states.position[elbow]", "/joint_states.position[0]"])
def test_joints_are_read_by_name_where_their_order_changes(tmp_path, field):
    log = []
    for k in range(60):
        joints = [("elbow", float(k)), ("wrist", -1.0 - k)][:: 1 if k % 3 == 0 else -1]
        log.append((k, [name for name, _ in joints], [value for _, value in joints]))
    path = joint_states(tmp_path / "robot", log)
    with pytest.warns(
        match=r"read by name: /joint_states@1 \(elbow, wrist; 20 messages\), /joint_states@2 \(wrist, elb"
    ):
        data = read_log(path, inputs=["/joint_states.position[wrist]"], outputs=[field])
    np.testing.assert_array_equal(data.y[:, 0], np.arange(60.0))
    np.testing.assert_array_equal(data.u[:, 0], -1.0 - np.arange(60.0))


def test_joints_of_two_publishers_have_stamps_of_their_own(tmp_path):
    log = [(k, [("elbow", "wrist")[k % 2]], [float(k)]) for k in range(100)]
    path = joint_states(tmp_path / "robot", log)
    with pytest.warns(match="stamps are those of the headers"):
        data = read_log(path, inputs=[], outputs=["/joint_states.position[elbow]"])
    np.testing.assert_array_equal(data.y[:, 0], np.arange(0.0, 100.0, 2.0))
    message = (
        r"no joint of '.*shoulder.*'; there are /joint_states@1 \(elbow; 50 messages\), /joint_states@2 \(wrist; 50"
    )
    refused(message, read_log, path, inputs=[], outputs=["/joint_states.position[shoulder]"])


def test_of_two_publishers_of_a_joint_one_is_chosen(tmp_path):
    log = []
    for k in range(100):
        log.append((k, ["elbow", "wrist"], [float(k), 5.0]))
        if k % 4 == 0:
            log.append((k, ["wrist", "elbow"], [0.0, 0.0]))
    path = joint_states(tmp_path / "robot", log)
    message = (
        r"several publishers: /joint_states@1 \(elbow, wrist; 100 messages\), .*; expected one, as /joint_states@1"
    )
    refused(message, read_log, path, inputs=[], outputs=["/joint_states.position[elbow]"])
    for chosen in ("@1", "@elbow,wrist"):
        with pytest.warns(match="stamps are those of the headers"):
            data = read_log(path, inputs=[], outputs=[f"/joint_states{chosen}.position[elbow]"])
        np.testing.assert_array_equal(data.y[:, 0], np.arange(100.0))
    refused(
        "no publisher @3 of /joint_states; there are", read_log, path, inputs=[], outputs=["/joint_states@3.position"]
    )
