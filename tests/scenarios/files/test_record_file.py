"""Every format returns the record that was written."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.io import loadmat

from hmtb_twin import JOINTS, TwinWarning, simulate
from hmtb_twin.bus.record import BusRecord
from hmtb_twin.bus.recorder_run import read_run, record_run
from hmtb_twin.bus.words import BAM, FORCE_STEP, TORQUE_STEP
from scenarios import load
from scenarios.files.data_file import excited, read_parts, write_log
from scenarios.files.record_file import RecordFile, is_record, losses, read_records, write_record
from tests.refusals import refused

OURS = (".asc", ".txt", ".csv", ".mat", ".nc")


def read_data(path, **options):
    """The record of a file that has one part."""
    (record,) = read_parts(path, **options)
    return record


@pytest.fixture(scope="module")
def gappy(bus_record):
    """Values with all digits, gaps, flags, a name that no format likes."""
    record = bus_record("50 % of: a;b = ü", 400, seed=3, axes=("elbow_pitch",))
    measured, commanded, status, wrench = (
        np.array(getattr(record, name)) for name in ("measured", "commanded", "status", "wrench")
    )
    measured[[0, 7, 8, 200]] = np.nan
    commanded[[150, 399]] = status[[150, 399]] = np.nan
    wrench[150] = measured[150] = np.nan
    saturated = np.where(np.arange(400) == 3, 2.0**19 + 1, 0.0)
    return replace(record, measured=measured, commanded=commanded, status=status, wrench=wrench, saturated=saturated)


@pytest.fixture(scope="module")
def log():
    return simulate([replace(load("siso-5-elbow_pitch"), duration=3.0)])[0]


@pytest.mark.parametrize("ending", OURS)
def test_every_bit_comes_back(gappy, tmp_path, ending):
    path = write_record(gappy, tmp_path / f"a{ending}")
    (stored,) = read_records(path).records
    np.testing.assert_array_equal(stored.columns(), gappy.columns())
    np.testing.assert_array_equal(stored.time, gappy.time)
    assert stored.dt == gappy.dt
    if ending != ".csv":
        assert (stored.name, stored.axes) == (gappy.name, gappy.axes)
    assert is_record(path)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_1553_to_ascii_to_the_analyst_is_the_log_within_one_quantum(log, tmp_path):
    record_run([BusRecord.of(log)], tmp_path / "a.ch10")
    (record,) = read_records(tmp_path / "a.ch10").records
    for ending in OURS:
        path = write_record(record, tmp_path / f"a{ending}")
        data, net = read_data(path, joint="elbow_pitch"), log.iodata()
        np.testing.assert_array_equal(data.y, net.y)
        assert np.abs(data.u - net.u).max() <= BAM / 2 * (1 + 1e-9)
        assert (data.dt, data.input_units, data.output_units) == (net.dt, net.input_units, net.output_units)
        assert (data.input_names, data.output_names) == (net.input_names, net.output_names)
        assert not data.missing
    steps = np.array([FORCE_STEP] * 3 + [TORQUE_STEP] * 3)
    assert (np.abs(record.wrench - log.wrench) <= steps / 2).all()


@pytest.mark.parametrize("ending", [".asc", ".csv", ".mat"])
def test_what_simulate_writes_has_every_digit(log, tmp_path, ending):
    path = write_log(log, tmp_path / f"a{ending}")
    np.testing.assert_array_equal(read_data(path, joint="elbow_pitch").u, log.iodata().u)
    np.testing.assert_array_equal(read_data(path, joint="wrist_yaw").y, log.iodata("wrist_yaw").y)
    (record,) = read_records(path).records
    np.testing.assert_array_equal(record.wrench, log.wrench)
    np.testing.assert_array_equal(record.status, log.status)
    assert excited(path) == (() if ending == ".csv" else ("elbow_pitch",))
    if ending == ".csv":  # its columns are read by name too
        data = read_data(path, input="elbow_pitch_commanded", output="elbow_pitch_measured")
        np.testing.assert_array_equal(data.y, log.iodata().y)
        assert path.read_text().startswith("time_s,shoulder_roll_commanded,")


def test_flat_file_loads_as_numbers_and_says_its_units(gappy, tmp_path):
    path = write_record(gappy, tmp_path / "a.asc")
    table = np.loadtxt(path, comments="%")  # as MATLAB's load does
    np.testing.assert_array_equal(table[:, 0], gappy.time)
    np.testing.assert_array_equal(table[:, 1:8], gappy.commanded)
    text = path.read_text()
    assert text.isascii()
    for line in ("sampling time: 0.02 s", "column 5: elbow_pitch_commanded, rad", "column 19: torque_x, N m"):
        assert f"% {line}\n" in text


def test_mat_file_has_names_and_units_beside_every_variable(gappy, tmp_path):
    content = loadmat(write_record(gappy, tmp_path / "a.mat"), simplify_cells=True)
    assert content["measured"].shape == (400, 7)
    assert list(content["names"]["measured"]) == [f"{joint}_measured" for joint in JOINTS]
    assert list(content["units"]["wrench"]) == ["N"] * 3 + ["N m"] * 3
    assert (content["dt"], content["units"]["time"]) == (0.02, "s")
    assert (tmp_path / "a.mat").read_bytes().startswith(b"MATLAB 5.0")


def test_gaps_are_declared_to_the_analyst(gappy, tmp_path):
    for ending in (".asc", ".mat", ".nc", ".csv"):
        path = write_record(gappy, tmp_path / f"a{ending}")
        parts = read_parts(path, joint="elbow_pitch")
        assert [len(part) for part in parts] == [150, 248]
        assert all(part.missing for part in parts)
        np.testing.assert_array_equal(np.flatnonzero(~parts[0].known[:, 0]), [0, 7, 8])


def test_a_run_asks_which_test(bus_record, tmp_path):
    path = tmp_path / "run.ch10"
    record_run([bus_record("one", 30), bus_record("two", 20, seed=1, axes=("x", "y"))], path)
    refused("holds 2 tests: one, two; choose one by --test", read_data, path)
    assert len(read_data(path, test="1")) == 30
    assert len(read_data(path, test="two", joint="wrist_yaw")) == 20
    assert excited(path, "two") == ("x", "y")
    refused("unknown test 'tow': did you mean 'two'", read_data, path, test="tow")
    refused("two excites x, y: name the joint, as --joint elbow_pitch", read_data, path, test="2")
    (tmp_path / "u.csv").write_text("t,u,y\n0,1,2\n1,2,3\n2,2,4\n")
    refused("u.csv holds one test; --test is for 1553 records", read_data, tmp_path / "u.csv", test="1")


def test_a_damaged_record_warns_once_and_reads_on(bus_record, tmp_path):
    path = tmp_path / "run.ch10"
    record_run([bus_record("one", 300)], path)
    path.write_bytes(path.read_bytes()[:-9000])
    with pytest.warns(TwinWarning, match="messages are missing") as warnings:
        data = read_data(path)
    assert len(warnings) == 1
    assert 200 < len(data) < 300


def test_anyones_text_table_is_read(tmp_path):
    path = tmp_path / "robot.txt"
    path.write_text("% my robot\nt u y\n0 1 2\n0.1 2 3\n0.2 2 4\n")
    data = read_data(path)
    assert (len(data), data.dt) == (3, pytest.approx(0.1))
    assert not is_record(path)
    refused("robot.txt is no ASCII record of ours", read_records, path)


@pytest.mark.parametrize("ending", [".asc", ".csv"])
def test_damaged_text_is_refused(gappy, tmp_path, ending):
    path = write_record(gappy, tmp_path / f"a{ending}")
    lines = path.read_text().splitlines(keepends=True)
    for text, message in (
        ("".join(lines[:-3]) + lines[-3][:40], "columns changed from 23 to [23] at row 398"),
        ("".join([*lines[:100], *lines[105:]]), "the file is cut off|times are not 0.02 s apart"),
        ("".join(lines).replace("0.06", "zero", 1), "could not convert string 'zero|expected"),
    ):
        path.write_text(text)
        refused(message, read_records, path)


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".mat", ".nc"])
def test_damaged_binary_is_refused(gappy, tmp_path, ending):
    path = write_record(gappy, tmp_path / f"a{ending}")
    content = path.read_bytes()
    for size in (0, 200, len(content) // 2, len(content) - 8):
        path.write_bytes(content[:size])
        refused(".", read_records, path)


def test_foreign_files_and_unwritable_places_are_refused(gappy, tmp_path):
    refused("no file", read_records, tmp_path / "absent.asc")
    (tmp_path / "a.xls").write_text("x")
    message = "unknown kind of file '.xls'; there are: .nc, .csv, .mat, .ch10, .asc"
    refused(message, read_records, tmp_path / "a.xls")
    (tmp_path / "a.asc").mkdir()
    refused("it is a folder", write_record, gappy, tmp_path / "a.asc")
    refused("unknown kind of file '.doc'", write_record, gappy, tmp_path / "a.doc")
    refused("unknown format '.doc'", write_log, None, tmp_path / "a.doc")


@pytest.mark.slow
def test_what_would_be_lost_is_named(log, gappy, tmp_path):
    kept = read_records(write_record(gappy, tmp_path / "a.asc"))
    assert losses([kept], "mat") == []
    wrench, commanded = losses([kept], "1553")
    assert "digits of the wrench" in wrench and "digits of the commanded" in commanded
    record_run([gappy], tmp_path / "a.ch10")
    once = RecordFile(read_run(tmp_path / "a.ch10").tests)
    assert losses([once], "1553") == []
    measured = np.array(once.records[0].measured)
    measured[30, 2] = np.nan
    (loss,) = losses([RecordFile((replace(once.records[0], measured=measured),))], "1553")
    assert loss.endswith("measured values at 1 ticks at which others of the same message are missing")
    stored = read_records(write_log(log, tmp_path / "log.nc"))
    (hidden,) = losses([stored], "csv")
    assert hidden.startswith("what only a simulation knows (")
    for channel in ("true_angles", "load_pressure", "volts", "counts"):
        assert channel in hidden
    assert "commanded" not in hidden and "status" not in hidden
    refused("6 tests given; a run of the recorder holds 5", losses, [once] * 6, "1553")
