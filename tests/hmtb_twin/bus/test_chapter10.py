"""What stands in the files, read by another library and by hand."""

import struct
from datetime import datetime, timedelta
from io import BytesIO

import numpy as np
import pytest
from chapter10 import C10
from chapter10.computer import ComputerF1
from chapter10.ms1553 import MS1553F1
from chapter10.time import TimeF1

from hmtb_twin.bus.messages import BusFaults
from hmtb_twin.bus.recorder_run import DATE, record_run
from hmtb_twin.bus.words import BAM, MESSAGES
from tests.refusals import refused


@pytest.fixture(scope="module")
def content(bus_record, tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "run.ch10"
    record_run([bus_record("first", 130, seed=1), bus_record("second; test", 60, seed=2)], path)
    return path.read_bytes()


@pytest.fixture(scope="module")
def packets(content):
    return list(C10(BytesIO(content)))


def test_order_types_and_sequence_numbers(packets, content):
    assert isinstance(packets[0], ComputerF1)
    assert isinstance(packets[1], TimeF1)
    assert sum(packet.packet_length for packet in packets) == len(content)
    for kind, channel in ((TimeF1, 1), (MS1553F1, 2)):
        mine = [packet for packet in packets if isinstance(packet, kind)]
        assert {packet.channel_id for packet in mine} == {channel}
        assert [packet.sequence_number for packet in mine] == list(range(len(mine)))
    assert all(packet.packet_length % 4 == 0 and packet.data_checksum == 3 for packet in packets)
    assert packets[1].rtc <= packets[2].rtc


def test_header_and_body_checksums_by_hand(content):
    position = count = 0
    while position < len(content):
        header = struct.unpack_from("<12H", content, position)
        assert header[0] == 0xEB25
        assert sum(header[:11]) % 2**16 == header[11]
        length, held = struct.unpack_from("<II", content, position + 4)
        words = np.frombuffer(content, "<u4", (length - 24) // 4, position + 24)
        assert held <= 4 * len(words) - 4 < held + 4
        assert words[:-1].sum(dtype=np.uint64) % 2**32 == words[-1]
        position += length
        count += 1
    assert position == len(content)
    assert count == 1 + 3 + 2 + 26 + 12


def test_first_message_by_hand(content, bus_record):
    record = bus_record("first", 130, seed=1)
    setup_length = struct.unpack_from("<I", content, 4)[0]
    time_length = struct.unpack_from("<I", content, setup_length + 4)[0]
    at = setup_length + time_length
    header = content[at : at + 24]
    assert header[:4] == bytes([0x25, 0xEB, 2, 0])  # sync, channel
    assert header[12:16] == bytes([0x06, 0, 0x03, 0x19])  # version, sequence, 32-bit checksum, 1553 format 1
    assert int.from_bytes(header[16:22], "little") == 10_000_000
    (specific,) = struct.unpack_from("<I", content, at + 24)
    assert (specific & 0xFFFFFF, specific >> 30) == (15, 1)  # five ticks of three messages, stamped at the first bit
    stamp, block, gaps, length = struct.unpack_from("<QHHH", content, at + 28)
    assert (stamp, block, gaps, length) == (10_000_000, 0, 80, 28)
    words = struct.unpack_from("<14H", content, at + 42)
    assert words[:4] == (0b00001_1_00001_01100, 0b00001 << 11, 0, 1)  # command, status, tick, test
    signed = [word - 65536 if word > 32767 else word for word in words[4:11]]
    np.testing.assert_array_equal(np.array(signed) * BAM, record.measured[0])
    assert words[11] == 0
    total = 0
    for k, word in enumerate(words[2:]):
        total ^= (word >> k | word << (16 - k)) & 0xFFFF
    assert total == 0


def test_stamps_count_the_ticks_exactly(packets, bus_record):
    stamps = {message.command: [] for message in MESSAGES}
    for packet in packets:
        if isinstance(packet, MS1553F1):
            messages = list(packet)
            assert packet.count == len(messages)
            assert packet.rtc == messages[0].ipts
            assert messages[-1].ipts - messages[0].ipts < 1_000_000  # less than 100 ms in a packet
            for message in messages:
                words = struct.unpack(f"<{len(message.data) // 2}H", message.data)
                assert not (message.me or message.we or message.le or message.se or message.fe or message.timeout)
                stamps[words[0]].append(message.ipts)
    ticks = 200_000 * np.concatenate([np.arange(130), 4 * 50 + np.arange(60)])  # each test begins at a whole second
    for message in MESSAGES:
        np.testing.assert_array_equal(stamps[message.command], 10_000_000 + ticks + message.slot)


def test_time_packets_tell_the_clock(packets, bus_record, tmp_path):
    times = [packet for packet in packets if isinstance(packet, TimeF1)]
    assert [packet.rtc for packet in times] == [10_000_000 * second for second in (1, 2, 3, 5, 6)]
    assert all(packet.time == DATE + timedelta(seconds=packet.rtc // 10_000_000) for packet in times)
    assert {(packet.time_source, packet.date_format) for packet in times} == {(0, 1)}
    date = datetime(2024, 2, 28, 23, 59, 58)
    record_run([bus_record("late", 120)], tmp_path / "late.ch10", date=date)
    times = [packet.time for packet in C10(str(tmp_path / "late.ch10")) if isinstance(packet, TimeF1)]
    assert times == [date + timedelta(seconds=k) for k in (1, 2, 3)]


def test_setup_record_describes_channels_words_and_scales(packets):
    setup = packets[0]
    assert setup.version == 0x0B
    assert setup["R-1\\CDT-2"] == {b"R-1\\CDT-2": b"1553IN"}
    assert setup["R-1\\BTF-2"] == {b"R-1\\BTF-2": b"1"}
    assert setup["R-1\\TK1-2"] == {b"R-1\\TK1-2": b"2"}
    names = set(setup["B-1\\MN-1-"].values())
    assert len(names) == sum(message.count for message in MESSAGES)
    assert names == {value for key, value in setup["C-"].items() if key.endswith(b"\\DCN")}
    (index,) = (k[2:].split(b"\\")[0] for k, v in setup["C-"].items() if v == b"elbow_pitch_commanded")
    assert float(setup[f"C-{index.decode()}\\CO-1"][b"C-" + index + b"\\CO-1"]) == BAM
    assert all(line.endswith(b";") and line.isascii() for line in setup.data.splitlines())


def test_faults_set_the_bits_of_the_standard(bus_record, tmp_path):
    faults = BusFaults(invalid=0.01, silent=0.05, short=0.05, seed=4)
    record_run([bus_record("faulty", 500)], tmp_path / "faulty.ch10", faults=faults)
    flags, plans = [], {entry.command: entry for entry in MESSAGES}
    packets = [packet for packet in C10(str(tmp_path / "faulty.ch10")) if isinstance(packet, MS1553F1)]
    for message in (message for packet in packets for message in packet):
        words = struct.unpack(f"<{len(message.data) // 2}H", message.data)
        plan = plans[words[0]]
        assert message.me == (message.we or message.timeout or message.le)
        if message.timeout and plan.transmits:
            assert len(words) == 1
        else:
            assert len(words) == 1 + (not message.timeout) + plan.count - message.le
        # The terminal answers what it receives if, and only if, it heard everything.
        assert plan.transmits or message.timeout or not (message.we or message.le)
        flags.append((not message.me, message.we, message.timeout, message.le))
    good, *faulty = np.sum(flags, axis=0)
    assert good > 1000
    assert min(faulty) > 50


def test_missing_library_is_one_line(bus_record, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "chapter10", None)
    refused(r"pip install 'hmtb-twin\[bus\]'", record_run, [bus_record("none", 5)], tmp_path / "none.ch10")
    assert not list(tmp_path.iterdir())
