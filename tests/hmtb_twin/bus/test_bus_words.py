import binascii
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmtb_twin.bus.chapter10 import Test, read_setup, setup_record
from hmtb_twin.bus.record import CHANNELS
from hmtb_twin.bus.words import BAM, COUNTS_PER_TICK, MESSAGES, check_words, checksum, crc, interface_control_table
from hmtb_twin.parameters.values import Recorder

ROOT = Path(__file__).parents[3]


def test_command_words_by_hand():
    # Terminal 1 transmits 12 words of subaddress 1: 00001 1 00001 01100; it receives 13 words: 00001 0 00010 01101.
    commands = ["0000110000101100", "0001010000101011", "0000100001001101"]
    answers = ["0000100000000000", "0001000000000000", "0000100000000000"]
    assert [(f"{m.command:016b}", f"{m.status:016b}") for m in MESSAGES] == list(zip(commands, answers, strict=True))


def test_messages_fit_the_standard_and_the_tick():
    ends = []
    for message in MESSAGES:
        assert 1 <= message.count <= 32
        # 20 us per word, at most 12 us of response time, a gap of 4 us to the next; the counter counts 0.1 us
        ends.append(message.slot + 10 * (20 * (2 + message.count) + 12 + 4))
    assert all(end <= message.slot for end, message in zip(ends, MESSAGES[1:], strict=False))
    assert ends[-1] < COUNTS_PER_TICK == 200_000


def test_the_words_carry_every_channel_of_the_record_and_the_documented_table_is_this_one():
    for message in MESSAGES:
        assert (message.quantities, message.units) == CHANNELS[message.name][:2]
    assert BAM == Recorder().resolver_step == np.deg2rad(180 / 32768)
    text = (ROOT / "docs/measured/bus-words.md").read_text(encoding="utf-8")
    assert "\n".join(interface_control_table()) in text
    assert len(re.findall(r"^\| .*\| `checksum` \|", text, re.M)) == len(MESSAGES)


@given(st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=30))
def test_crc_is_that_of_the_standard_library(words):
    table = np.array([words, words[::-1]], np.uint16)
    expected = [binascii.crc_hqx(row.astype(">u2").tobytes(), 0xFFFF) for row in table]
    np.testing.assert_array_equal(crc(table), expected)


def test_checksum_by_hand():
    # 8001 as it stands, 0003 rotated right once: 8001; together 0000; the third word rotates back by two places
    assert checksum(np.array([[0x8001, 0x0003]], np.uint16))[0] == 0
    # 0001, and 0001 rotated right: 8000; together 8001; rotated left twice: 0006
    assert checksum(np.array([[0x0001, 0x0001]], np.uint16))[0] == 0x0006


@given(st.lists(st.integers(0, 0xFFFF), min_size=2, max_size=30), st.data())
def test_up_to_three_wrong_bits_never_pass(words, data):
    message = np.array([*words, *check_words(np.array([words], np.uint16))[0]], np.uint16)
    places = st.tuples(st.integers(0, len(message) - 1), st.integers(0, 15))
    for word, bit in data.draw(st.lists(places, min_size=1, max_size=3, unique=True)):
        message[word] ^= np.uint16(1 << bit)
    assert (check_words(message[None, :-2])[0] != message[-2:]).any()


TESTS = (
    Test("siso-5-elbow_pitch", 12_000, ("elbow_pitch",), 12_000),
    Test(" a;b\r\n% ü ", 0, ("x y", "z"), 300),
    Test("", 5, (), 5),
)


def test_names_lengths_and_axes_come_back_exactly():
    assert read_setup(setup_record(TESTS)) == TESTS
    assert read_setup(setup_record(())) == ()


def test_attributes_are_lines_of_plain_text_with_one_value_each():
    lines = setup_record(TESTS).split("\r\n")
    assert lines.pop() == ""
    assert all(line.isascii() and line.endswith(";") and line.count(";") == 1 for line in lines)
    names = [line.split(":")[0] for line in lines]
    assert len(set(names)) == len(names)
    assert {name[0] for name in names} == set("GRBCV")


@pytest.mark.parametrize(
    ("old", "new"), [("elbow", "elbou"), ("TIC-1:12000", "TIC-1:13000"), ("CRC:", "CRC:0"), ("NAM-3", "NAM-4")]
)
def test_damaged_lines_and_other_records_announce_nothing(old, new):
    text = setup_record(TESTS)
    start = text.index("V-1")
    assert old in text[start:]
    assert read_setup(text[:start] + text[start:].replace(old, new, 1)) == ()
    for other in ("", "G\\PN:another;\r\n", "V-1\\HTB\\NAM-1:x;", "no attributes at all"):
        assert read_setup(other) == ()
