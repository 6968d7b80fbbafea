from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmtb_twin import TwinError, simulate
from hmtb_twin.bus.messages import BusFaults
from hmtb_twin.bus.record import BusRecord
from hmtb_twin.bus.recorder_run import MEMORY, read_run, record_run, runs
from hmtb_twin.bus.words import BAM, FORCE_STEP, MESSAGES, TORQUE_STEP
from tests.refusals import refused

STEPS = {"commanded": BAM, "measured": BAM, "wrench": np.array([FORCE_STEP] * 3 + [TORQUE_STEP] * 3)}
VALUES = ("commanded", "measured", "wrench")


@pytest.fixture(scope="module")
def records(bus_record):
    return [bus_record("one", 300, seed=1), bus_record("two", 200, seed=2, axes=("x", "y"))]


@pytest.fixture(scope="module")
def content(records, tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "run.ch10"
    record_run(records, path)
    return path.read_bytes()


@pytest.fixture(scope="module")
def passed(content, tmp_path_factory):
    """The records as they come out of an undamaged file."""
    path = tmp_path_factory.mktemp("run") / "whole.ch10"
    path.write_bytes(content)
    return read_run(path).tests


def read_damaged(content, passed, path):
    """Read a damaged file; check that all that is read was sent; return the run and the number of messages missing."""
    path.write_bytes(content)
    run, read = read_run(path), 0
    for record, sent in zip(run.tests, passed, strict=True):
        for name in VALUES:
            ours, theirs = getattr(record, name), getattr(sent, name)[: len(record)]
            known = np.isfinite(ours)
            assert (known.all(axis=1) == known.any(axis=1)).all()
            np.testing.assert_array_equal(ours[known], theirs[known])
            read += int(known.all(axis=1).sum())
        known = np.isfinite(record.status)
        np.testing.assert_array_equal(known, np.isfinite(record.commanded).all(axis=1))
        np.testing.assert_array_equal(record.status[known], sent.status[: len(record)][known])
    return run, 3 * sum(map(len, passed)) - read


def test_everything_passes_within_half_a_quantum_and_the_file_is_the_same_again(records, content, passed, tmp_path):
    for sent, read in zip(records, passed, strict=True):
        assert (read.name, read.dt, read.axes, len(read)) == (sent.name, 0.02, sent.axes, len(sent))
        np.testing.assert_array_equal(read.measured, sent.measured)
        np.testing.assert_array_equal(read.status, sent.status)
        assert not read.saturated.any()
        assert not read.lost.any()
        for name in VALUES:
            assert (np.abs(getattr(read, name) - getattr(sent, name)) <= 0.5 * STEPS[name] * (1 + 1e-9)).all()
    record_run(records, tmp_path / "again.ch10")
    assert (tmp_path / "again.ch10").read_bytes() == content


def test_a_log_passes_to_the_analyst_within_one_quantum(experiment, tmp_path):
    log = simulate([experiment(duration=2.0)])[0]
    record_run([BusRecord.of(log)], tmp_path / "log.ch10")
    run = read_run(tmp_path / "log.ch10")
    assert run.message == ""
    bus, net = run.tests[0].iodata(), log.iodata()
    np.testing.assert_array_equal(bus.y, net.y)
    assert np.abs(bus.u - net.u).max() <= BAM
    for name in ("dt", "input_names", "output_names", "input_units", "output_units", "missing"):
        assert getattr(bus, name) == getattr(net, name)
    np.testing.assert_array_equal(run.tests[0].status, log.status)


def test_what_does_not_fit_stands_at_the_end_of_its_range_with_a_message(bus_record, tmp_path):
    record = bus_record("hard", 4)
    wrench, commanded, measured = (np.array(getattr(record, name)) for name in ("wrench", "commanded", "measured"))
    wrench[1, 0], wrench[1, 5] = 1e5, -1e5
    commanded[2, 6], measured[3, 0] = 4.0, np.pi
    record = replace(record, wrench=wrench, commanded=commanded, measured=measured)
    done = record_run([record], tmp_path / "hard.ch10")
    assert done.message == "hard.ch10: values of hard stand at the end of their words' range at 3 ticks, from 1 to 3"
    read = read_run(tmp_path / "hard.ch10").tests[0]
    assert read.wrench[1, 0] == 2048 - FORCE_STEP
    assert read.wrench[1, 5] == -512
    assert read.commanded[2, 6] == read.measured[3, 0] == BAM * (2**15 - 1)
    np.testing.assert_array_equal(read.saturated, [0, 2**14 + 2**19, 2**6, 2**7])
    record_run([read], tmp_path / "again.ch10")
    np.testing.assert_array_equal(read_run(tmp_path / "again.ch10").tests[0].saturated, read.saturated)


def test_memory_ends_after_twenty_minutes(bus_record, tmp_path, monkeypatch):
    assert MEMORY == 20 * 60 * 50
    monkeypatch.setattr("hmtb_twin.bus.recorder_run.MEMORY", 1000)
    long, short = bus_record("long", 900), bus_record("short", 300)
    done = record_run([long, short, short], tmp_path / "full.ch10")
    assert done.ticks == (900, 100, 0)
    full = "memory full at tick 100 of short after 1000 ticks in all; the other 500 ticks were not recorded"
    assert done.message == f"full.ch10: {full}"
    run = read_run(tmp_path / "full.ch10")
    assert [len(test) for test in run.tests] == [900, 100, 0]
    assert run.lost == 0
    assert "short was to have 300 ticks, of which the memory held 100" in run.message


def test_five_tests_make_a_run(bus_record, tmp_path):
    four_minutes = [bus_record(f"t{k}", 12_000) for k in range(2)] * 4
    assert [len(run) for run in runs(four_minutes)] == [5, 3]
    assert [len(run) for run in runs([bus_record("a", 40_000), bus_record("b", 30_000)])] == [1, 1]
    assert runs([]) == []
    refused("6 tests given, expected 1 to 5", record_run, [bus_record("s", 3)] * 6, tmp_path / "six.ch10")
    with pytest.raises(TwinError, match=r"sampled every 0.01 s; the bus passes one tick every 0.02 s"):
        record_run([replace(bus_record("fast", 10), dt=0.01)], tmp_path / "fast.ch10")
    refused(r"cannot write the record .*absent", record_run, [bus_record("a", 3)], tmp_path / "absent" / "a.ch10")


def test_faults_lose_exactly_what_they_hit(records, passed, tmp_path):
    path, faults = tmp_path / "faulty.ch10", BusFaults(dropped=0.02, silent=0.01, invalid=0.002, short=0.01, seed=5)
    record_run(records, path, faults=faults)
    first = path.read_bytes()
    run, lost = read_damaged(first, passed, path)
    assert [len(record) for record in run.tests] == [len(sent) for sent in passed]
    assert lost == run.lost > 50
    ticks = [np.flatnonzero(test.lost) for test in run.tests]
    start = f"faulty.ch10: {lost} of 1500 messages are missing, the first at tick {ticks[0][0]} of one, "
    assert run.message.startswith(start + f"the last at tick {ticks[1][-1]} of two (")
    for what in ("flagged no response", "flagged invalid word", "flagged wrong word count"):
        assert what in run.message
    assert run.message.endswith("every other message was read")
    for seed, same in ((5, True), (6, False)):
        record_run(records, path, faults=replace(faults, seed=seed))
        assert (path.read_bytes() == first) is same


@pytest.mark.slow
def test_dropped_messages_are_found_by_their_rate_which_is_a_probability(bus_record, tmp_path):
    record_run([bus_record("drops", 12_000)], tmp_path / "drops.ch10", faults=BusFaults(dropped=0.01, seed=1))
    run = read_run(tmp_path / "drops.ch10")
    assert run.lost == pytest.approx(360, abs=4 * 360**0.5)
    assert "flagged" not in run.message
    for name in ("dropped", "silent", "invalid", "short"):
        refused(f"{name}: a probability of 1.5 given, expected 0 to 1", BusFaults, **{name: 1.5})


def test_lost_samples_are_declared_to_the_analyst(bus_record, tmp_path):
    record = bus_record("gaps", 50)
    measured, commanded = np.array(record.measured), np.array(record.commanded)
    measured[10:12] = np.nan
    record_run([replace(record, measured=measured)], tmp_path / "gaps.ch10")
    data = read_run(tmp_path / "gaps.ch10").tests[0].iodata()
    assert data.missing
    np.testing.assert_array_equal(np.flatnonzero(~data.known[:, 0]), [10, 11])
    commanded[[0, 30, 49]] = np.nan
    record_run([replace(record, measured=measured, commanded=commanded)], tmp_path / "gaps.ch10")
    read = read_run(tmp_path / "gaps.ch10").tests[0]
    assert [len(part) for part in read.parts()] == [29, 18]
    assert [part.missing for part in read.parts()] == [True, False]
    refused(r"3 commands were lost between ticks 0 and 49; .* take the 2 parts", read.iodata)
    refused(r"does not say what it excites: name the joint", replace(read, axes=()).parts)
    np.testing.assert_array_equal(read.parts("wrist_yaw")[0].u[:, 0], read.commanded[1:30, 5])


@pytest.mark.slow
def test_every_cut_gives_every_whole_message(content, passed, tmp_path):
    rng, counts = np.random.default_rng(0), []
    setup = int.from_bytes(content[4:8], "little")
    heads = [entry.length.to_bytes(2, "little") + entry.command.to_bytes(2, "little") for entry in MESSAGES]
    for end in [*range(setup + 150, setup + 300), *sorted(rng.integers(setup + 300, len(content), 30))]:
        run, lost = read_damaged(content[:end], passed, tmp_path / "cut.ch10")
        counts.append(1500 - lost)
        # Messages in the file before the cut: a message is there when its last byte is.
        whole = sum(content[:end].count(head) for head in heads)
        assert whole - 1 <= counts[-1] <= whole
        assert run.lost == lost
        assert run.message.count("cut.ch10") == 1
    assert counts == sorted(counts)


def test_nothing_usable_is_one_line(content, tmp_path):
    path = tmp_path / "cut.ch10"
    setup = int.from_bytes(content[4:8], "little")
    for end in (0, 1, 10, 24, 100, setup, setup + 60):
        path.write_bytes(content[:end])
        refused(r"cut.ch10: no message of the arm's bus", read_run, path)
    path.write_bytes(b"time,u,y\n0,1,2\n" * 1000)
    refused("no Chapter 10 packet", read_run, path)
    refused("No such file", read_run, tmp_path / "absent.ch10")


@pytest.mark.slow
def test_a_flipped_bit_costs_one_message_at_most(content, passed, tmp_path):
    """Every part of one packet in turn, from its header to its checksum; then bits anywhere in the file."""
    start = int.from_bytes(content[4:8], "little")
    start += int.from_bytes(content[start + 4 : start + 8], "little")
    length = int.from_bytes(content[start + 4 : start + 8], "little")
    small, path, rng = content[: start + 2 * length], tmp_path / "bit.ch10", np.random.default_rng(0)
    before = read_damaged(small, passed, path)[0].lost
    flips = [(small, [position]) for position in [*range(start, start + 60), *range(start + 60, start + length, 3)]]
    flips += [(content, rng.choice(len(content), count, replace=False).tolist()) for count in 10 * [1, 2, 3, 4]]
    for whole, positions in flips:
        spoilt = bytearray(whole)
        for position in positions:
            spoilt[position] ^= 1 << position % 8
        run, _ = read_damaged(spoilt, passed, path)
        assert run.lost <= (before if whole is small else 0) + len(positions)
        assert run.message != ""


@pytest.mark.slow
@settings(max_examples=25)
@given(st.data())
def test_wild_damage_never_makes_anything_up(content, passed, tmp_path_factory, data):
    spoilt = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(spoilt) - 1))
        match data.draw(st.sampled_from(["noise", "zeros", "remove", "insert", "repeat"])):
            case "noise":
                spoilt[at : at + 300] = np.random.default_rng(at).bytes(300)
            case "zeros":
                spoilt[at : at + 2000] = bytes(2000)
            case "remove":
                del spoilt[at : at + 777]
            case "insert":
                spoilt[at:at] = np.random.default_rng(at).bytes(501)
            case "repeat":
                spoilt[at:at] = spoilt[max(at - 1500, 0) : at]
    assert read_damaged(spoilt, passed, tmp_path_factory.mktemp("wild") / "wild.ch10")[0].lost < 900


def test_without_the_setup_record_the_messages_are_read(content, passed, tmp_path):
    run, _ = read_damaged(content[int.from_bytes(content[4:8], "little") :], passed, tmp_path / "bare.ch10")
    assert [(test.name, test.axes) for test in run.tests] == [("test-1", ()), ("test-2", ())]
    assert run.lost == 0
    assert "the set-up record is lost, and with it the names and lengths of the tests" in run.message


def test_two_recordings_in_one_file_are_refused(content, bus_record, tmp_path):
    other, both = tmp_path / "other.ch10", tmp_path / "both.ch10"
    record_run([bus_record("other", 20)], other)
    both.write_bytes(content + other.read_bytes())
    refused(r"both.ch10 holds 2 recordings; expected one", read_run, both)
    both.write_bytes(content + content)
    assert read_run(both).message == ""


def test_record_checks_itself(bus_record, tmp_path):
    record = bus_record("a", 5)
    refused(r"measured of shape \(5, 6\) given, expected \(5, 7\)", replace, record, measured=record.measured[:, 1:])
    refused("status holds flags: whole numbers from 0 to 65535", replace, record, status=record.status + 0.5)
    refused("wrench has infinite values", replace, record, wrench=record.wrench + np.inf)
    with pytest.raises(ValueError, match="read-only"):
        record.measured[0, 0] = 1.0
    back = BusRecord.load(record.save(tmp_path / "a.nc"))
    np.testing.assert_array_equal(back.columns(), record.columns())
    assert (back.name, back.dt, back.axes) == (record.name, record.dt, record.axes)
