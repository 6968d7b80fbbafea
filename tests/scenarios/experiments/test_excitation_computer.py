"""The excitation computer plays files as its board can: in time, in counts, on two outputs."""

import numpy as np
import pytest

from hmtb_twin import Chain
from hmtb_twin.control.data_acquisition import BOARD
from scenarios import Excitation, Scenario
from scenarios.experiments.waveform import read_points, write_points
from tests.refusals import refused

STEP = 20.0 / 4096
RAMP = tuple(float(value) for value in np.linspace(-0.99, 0.99, 100))


def ramp(repeat_frequency=None, iterations=None):
    return Excitation("points", {"points": RAMP}, repeat_frequency, iterations)


def test_the_converter_rounds_to_its_counts_and_saturates():
    volts = np.array([-99.0, -10.0, -0.6 * STEP, 0.0, 0.4 * STEP, 1.0, 9.9999, 12.0])
    expected = [-10.0, -10.0, -STEP, 0.0, 0.0, 205 * STEP, 2047 * STEP, 2047 * STEP]
    np.testing.assert_allclose(BOARD.convert(volts), expected, rtol=1e-15)
    smooth = [-10.0, -10.0, -0.6 * STEP, 0.0, 0.4 * STEP, 1.0, 2047 * STEP, 2047 * STEP]
    np.testing.assert_allclose(BOARD.convert(volts, rounds=False), smooth, rtol=1e-15)
    assert BOARD.exceeds_range(volts).tolist() == [True, False, False, False, False, False, True, True]
    assert not BOARD.exceeds_range(np.array([-10.0, 2047 * STEP])).any()


@pytest.mark.parametrize(
    ("frequency", "period"),
    [(None, RAMP), (0.5, RAMP), (0.1, tuple(np.repeat(RAMP, 5))), (1.0, RAMP[::2])],
)
def test_a_file_lasts_two_seconds_and_a_slower_one_holds_points_a_faster_one_misses_some(frequency, period):
    np.testing.assert_array_equal(ramp(frequency).requested_volts(0.04 * len(period))[:, 0], np.tile(period, 2))
    assert ramp(frequency).misses_points == (frequency == 1.0)


@pytest.mark.parametrize(("frequency", "samples"), [(None, 300), (1.0, 150), (0.3, 500)])
def test_after_its_iterations_the_output_is_zero(frequency, samples):
    volts = Excitation("points", {"points": (1.0,) * 99 + (2.0,)}, frequency, 3).requested_volts(20.0)[:, 0]
    assert (volts[:samples] > 0.0).all()
    assert (volts[samples:] == 0.0).all()


def test_two_outputs_and_no_more_unless_asked_for():
    one, two, three = (Excitation("prbs", {"seed": seed}) for seed in (0, 6, 12))
    axes = ("shoulder_yaw", "shoulder_pitch", "elbow_pitch")
    for entries in ((one,), (one, two, one), (one, one, one)):
        assert Scenario("two", axes, entries, duration=2.0).volts().shape == (100, 3)
    message = "3 different excitations.*2 analogue outputs.*independent_channels = true"
    refused(message, Scenario, "three", axes, (one, two, three))
    apart = Scenario("three", axes, (one, two, three), duration=2.0, independent_channels=True).volts()
    assert len({column.tobytes() for column in apart.T}) == 3
    refused("2 excitations for 3 axes", Scenario, "odd", axes, (one, two), independent_channels=True)


def test_a_switched_off_converter_still_saturates():
    loud = Excitation("sine", {"frequency": 5.0, "amplitude": 50.0})
    volts = Scenario("loud", ("elbow_pitch",), (loud,), duration=2.0, chain=Chain(dac=False)).volts()
    np.testing.assert_array_equal(volts, np.clip(loud.requested_volts(2.0), -10.0, 2047 * STEP))
    assert (volts.min(), volts.max()) == (-10.0, 2047 * STEP)


FILE = """
name = "mine"
axes = ["elbow_pitch"]
duration = 4.0
[excitation]
kind = "file"
path = "files/mine.txt"
iterations = 1
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "files").mkdir()
    write_points(RAMP, tmp_path / "files" / "mine.txt")
    (tmp_path / "mine.toml").write_text(FILE, encoding="utf-8")
    return tmp_path


def test_a_file_reads_back_to_the_last_bit(tmp_path):
    values = np.random.default_rng(0).standard_normal(100)
    assert read_points(write_points(values, tmp_path / "p.txt")) == tuple(values.tolist())
    (tmp_path / "q.txt").write_text("# mine\n" + ", ".join(map(repr, values.tolist())) + " # V\n\n", encoding="utf-8")
    assert read_points(tmp_path / "q.txt") == tuple(values.tolist())


def test_a_scenario_takes_over_the_points_of_a_file_beside_it(folder):
    scenario = Scenario.read(folder / "mine.toml")
    assert scenario.excitation == (ramp(iterations=1),)
    (folder / "files" / "mine.txt").unlink()
    # What a log keeps as its recipe needs no file.
    assert Scenario.from_toml(scenario.to_toml()) == scenario
    assert "path" not in scenario.to_toml()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("1.0\n" * 99, "holds 100 finite numbers, one period; given 99"),
        ("1.0\n" * 50 + "two\n", "line 51: expected a finite number in V, given 'two'"),
        ("nan\n" * 100, "finite"),
        ("1e9\n" * 100, "at most 1000 V"),
        ("", "given 0"),
    ],
)
def test_a_wrong_file_is_refused_by_name(folder, text, says):
    (folder / "files" / "mine.txt").write_text(text, encoding="utf-8")
    refused(rf"mine\.toml.*mine\.txt.*{says}", Scenario.read, folder / "mine.toml")


def test_a_missing_file_and_a_wrong_entry_are_refused(folder):
    (folder / "files" / "mine.txt").write_bytes(b"\xff\xfe\x00")
    refused("it is no text", Scenario.read, folder / "mine.toml")
    (folder / "files" / "mine.txt").unlink()
    refused(r"cannot read waveform file.*mine\.txt.*No such file", Scenario.read, folder / "mine.toml")
    message = "takes a path and repeat_frequency, iterations; given path, amplitude"
    refused(message, Scenario.from_toml, FILE + "amplitude = 1.0\n")
    refused("cannot read waveform file", read_points, "a\0b")


def test_a_waveform_of_silence_is_one_line(complaint, tmp_path):
    complaint("waveform", "sine", "--frequency", "5", "--amplitude", "0", "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()
