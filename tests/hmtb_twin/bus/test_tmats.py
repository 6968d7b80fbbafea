import pytest

from hmtb_twin.bus.chapter10 import Test, read_setup, setup_record

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
