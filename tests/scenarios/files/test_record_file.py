"""Every format gives back what it was given."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import loadmat

from hmtb_twin import JOINTS, JointLog, TwinError, TwinWarning
from hmtb_twin.bus.record import BusRecord
from hmtb_twin.bus.recorder_run import read_run, record_run
from hmtb_twin.bus.words import BAM, FORCE_STEP, TORQUE_STEP
from scenarios.files.data_file import excited, read_parts, write_log
from scenarios.files.errors import ScenarioError
from scenarios.files.record_file import RecordFile, is_record, losses, read_records, write_record
from sysid import IOData

OURS = (".asc", ".txt", ".csv", ".mat", ".nc")


def read_data(path: Path, **options: Any) -> IOData:
    """The record of a file that has one part."""
    (record,) = read_parts(path, **options)
    return record


@pytest.fixture(scope="module")
def gappy(bus_record) -> BusRecord:
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
def log(experiment) -> JointLog:
    from hmtb_twin import simulate

    return simulate([experiment(duration=3.0)])[0]


@pytest.fixture(scope="module")
def experiment():
    from scenarios import load

    return lambda duration: replace(load("siso-5-elbow_pitch"), duration=duration)


@pytest.mark.parametrize("ending", OURS)
def test_every_bit_comes_back(gappy, tmp_path, ending):
    path = write_record(gappy, tmp_path / f"a{ending}")
    (found,) = read_records(path).records
    np.testing.assert_array_equal(found.columns(), gappy.columns())
    np.testing.assert_array_equal(found.time, gappy.time)
    assert found.dt == gappy.dt
    if ending != ".csv":
        assert (found.name, found.axes) == (gappy.name, gappy.axes)
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


def test_csv_columns_are_read_by_name_as_ever(log, tmp_path):
    path = write_log(log, tmp_path / "a.csv")
    data = read_data(path, input="elbow_pitch_commanded", output="elbow_pitch_measured")
    np.testing.assert_array_equal(data.y, log.iodata().y)
    assert path.read_text().splitlines()[0].startswith("time_s,shoulder_roll_commanded,")


def test_flat_file_loads_as_numbers_and_says_its_units(gappy, tmp_path):
    path = write_record(gappy, tmp_path / "a.asc")
    table = np.loadtxt(path, comments="%")  # as MATLAB's load does
    np.testing.assert_array_equal(table[:, 0], gappy.time)
    np.testing.assert_array_equal(table[:, 1:8], gappy.commanded)
    text = path.read_text()
    assert text.isascii()
    assert "% sampling time: 0.02 s\n" in text
    assert "% column 1: time, s\n" in text
    assert "% column 5: elbow_pitch_commanded, rad\n" in text
    assert "% column 19: torque_x, N m\n" in text


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
    with pytest.raises(ScenarioError, match="holds 2 tests: one, two; choose one by --test"):
        read_data(path)
    assert len(read_data(path, test="1")) == 30
    assert len(read_data(path, test="two", joint="wrist_yaw")) == 20
    assert excited(path, "two") == ("x", "y")
    with pytest.raises(ScenarioError, match="unknown test 'tow': did you mean 'two'"):
        read_data(path, test="tow")
    with pytest.raises(TwinError, match="two excites x, y: name the joint"):
        read_data(path, test="2")
    (tmp_path / "u.csv").write_text("t,u,y\n0,1,2\n1,2,3\n2,2,4\n")
    with pytest.raises(ScenarioError, match=r"u.csv holds one test; --test is for 1553 records"):
        read_data(tmp_path / "u.csv", test="1")


def test_a_damaged_record_warns_once_and_reads_on(bus_record, tmp_path):
    path = tmp_path / "run.ch10"
    record_run([bus_record("one", 300)], path)
    path.write_bytes(path.read_bytes()[:-9000])
    with pytest.warns(TwinWarning, match="messages are missing") as said:
        data = read_data(path)
    assert len(said) == 1
    assert 200 < len(data) < 300


def test_anyones_text_table_is_read(tmp_path):
    path = tmp_path / "robot.txt"
    path.write_text("% my robot\nt u y\n0 1 2\n0.1 2 3\n0.2 2 4\n")
    data = read_data(path)
    assert (len(data), data.dt) == (3, pytest.approx(0.1))
    assert not is_record(path)
    with pytest.raises(ScenarioError, match=r"robot.txt is no ASCII record of ours"):
        read_records(path)


@pytest.mark.parametrize("ending", [".asc", ".csv"])
def test_damaged_text_is_one_line(gappy, tmp_path, ending):
    path = write_record(gappy, tmp_path / f"a{ending}")
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:-3]) + lines[-3][:40])
    with pytest.raises(ScenarioError, match=r"3 values in the line of time 7.94, expected 23|2 values in the line"):
        read_records(path)
    path.write_text("".join([*lines[:100], *lines[105:]]))
    with pytest.raises(ScenarioError, match=r"the file is cut off|times are not 0.02 s apart"):
        read_records(path)
    path.write_text("".join(lines).replace("0.06", "zero", 1))
    with pytest.raises(ScenarioError, match=r"could not convert string 'zero|expected"):
        read_records(path)


@pytest.mark.parametrize("ending", [".mat", ".nc"])
def test_damaged_binary_is_one_line(gappy, tmp_path, ending):
    path = write_record(gappy, tmp_path / f"a{ending}")
    content = path.read_bytes()
    for size in (0, 200, len(content) // 2, len(content) - 8):
        path.write_bytes(content[:size])
        with pytest.raises((ScenarioError, TwinError)):
            read_records(path)


def test_foreign_files_are_one_line(tmp_path):
    with pytest.raises(ScenarioError, match="no file"):
        read_records(tmp_path / "absent.asc")
    (tmp_path / "a.xls").write_text("x")
    with pytest.raises(ScenarioError, match=r"unknown kind of file '.xls'; there are: .nc, .csv, .mat, .ch10, .asc"):
        read_records(tmp_path / "a.xls")


def test_what_would_be_lost_is_named(log, gappy, tmp_path):
    kept = read_records(write_record(gappy, tmp_path / "a.asc"))
    assert losses([kept], "mat") == []
    assert [text.split(": ")[-1].split(" values")[0] for text in losses([kept], "1553")] == [
        "digits of the wrench",
        "digits of the commanded",
    ]
    record_run([gappy], tmp_path / "a.ch10")
    once = RecordFile(read_run(tmp_path / "a.ch10").tests)
    assert losses([once], "1553") == []
    measured = np.array(once.records[0].measured)
    measured[30, 2] = np.nan
    holed = RecordFile((replace(once.records[0], measured=measured),))
    assert losses([holed], "1553") == [
        f"{gappy.name}: measured values at 1 ticks at which others of the same message are missing"
    ]
    stored = read_records(write_log(log, tmp_path / "log.nc"))
    (hidden,) = losses([stored], "csv")
    assert hidden.startswith("what only a simulation knows (")
    for channel in ("true_angles", "load_pressure", "volts", "counts"):
        assert channel in hidden
    assert "commanded" not in hidden
    assert "status" not in hidden
    with pytest.raises(ScenarioError, match="6 tests given; a run of the recorder holds 5"):
        losses([once] * 6, "1553")


def test_unwritable_place(gappy, tmp_path: Path):
    (tmp_path / "a.asc").mkdir()
    with pytest.raises(ScenarioError, match="it is a folder"):
        write_record(gappy, tmp_path / "a.asc")
    with pytest.raises(ScenarioError, match=r"unknown kind of file '.doc'"):
        write_record(gappy, tmp_path / "a.doc")
    with pytest.raises(ScenarioError, match=r"unknown format '.doc'"):
        write_log(None, tmp_path / "a.doc")
