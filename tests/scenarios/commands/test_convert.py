"""The bus on the command line: `hmtb simulate --format 1553`, `hmtb convert`, `hmtb identify`."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hmtb_twin import JointLog
from hmtb_twin.bus.recorder_run import read_run, record_run
from hmtb_twin.parameters.values import LARGE_MOTION
from scenarios.commands.cli import main
from scenarios.experiments.registry import load
from scenarios.files.record_file import read_records, write_record

OE = ("--method", "oe", "--orders", "2", "2", "1")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Two experiments in every format, the bus faulty."""
    folder = tmp_path_factory.mktemp("made")
    names = ("siso-5-elbow_pitch", "siso-5-shoulder_yaw")
    rates = ("--dropped", "0.002", "--invalid", "0.0005", "--silent", "0.002")
    formats = ("--format", "nc,csv,mat,1553,ascii", "--duration", "40")
    scenarios = [folder / f"{name}.toml" for name in names]
    for path in scenarios:
        path.write_text(replace(load(path.stem), hand_controller=LARGE_MOTION).to_toml(), encoding="utf-8")
    assert main(["simulate", *map(str, scenarios), *formats, *rates, "--out", str(folder / "out")]) == 0
    return folder / "out"


@pytest.mark.slow
def test_simulate_writes_every_format(result, made, tmp_path):
    endings = sorted(path.name.replace("siso-5-", "") for path in made.iterdir())
    joints = ("elbow_pitch", "shoulder_yaw")
    assert endings == sorted([f"{j}.{e}" for j in joints for e in ("nc", "csv", "mat", "asc")] + ["run-1.ch10"])
    again = result("simulate", "siso-5-elbow_pitch", "--format", "1553", "--duration", "2", "--out", tmp_path)
    assert again["logs"] == [str(tmp_path / "siso-5-elbow_pitch.ch10")]
    (record,) = read_run(again["logs"][0]).tests
    assert (record.name, record.axes, len(record)) == ("siso-5-elbow_pitch", ("elbow_pitch",), 100)


def test_noise_and_faults_of_the_bus_follow_the_seed(result, tmp_path):
    files = []
    for number, seed in enumerate((3, 3, 4)):
        words = ("simulate", "siso-5-elbow_pitch", "--duration", "4", "--format", "1553", "--dropped", "0.1")
        (path,) = result(*words, "--seed", seed, "--out", tmp_path / str(number))["logs"]
        files.append(read_run(path).tests[0].measured)
    np.testing.assert_array_equal(files[0], files[1])
    lost = np.isnan(files)
    assert (lost[0] != lost[2]).any()
    assert not np.array_equal(files[0][~lost[0] & ~lost[2]], files[2][~lost[0] & ~lost[2]])


@pytest.mark.slow
def test_a_run_becomes_files_and_files_become_a_run(result, made, tmp_path):
    source = read_run(made / "run-1.ch10")
    for name, ending in (("ascii", "asc"), ("csv", "csv"), ("mat", "mat"), ("nc", "nc")):
        done = result("convert", made / "run-1.ch10", tmp_path / name, "--format", name, code=1)
        paths = [Path(path) for path in done["files"]]
        assert [path.name for path in paths] == [f"{test.name}.{ending}" for test in source.tests]
        assert [entry["ticks_lost"] for entry in done["tests"]] == [int(test.lost.sum()) for test in source.tests]
        assert done["warnings"] == [source.message]
        back = tmp_path / f"{name}.ch10"
        assert result("convert", *paths, back)["files"] == [str(back)]
        for values, outcome in zip(source.tests, read_run(back).tests, strict=True):
            np.testing.assert_array_equal(outcome.columns(), values.columns())
            assert outcome.name == values.name
    (record,) = read_records(tmp_path / "ascii" / "siso-5-elbow_pitch.asc").records
    log = JointLog.load(made / "siso-5-elbow_pitch.nc")
    known = np.isfinite(record.measured)
    np.testing.assert_array_equal(record.measured[known], log.measured[known])


def test_one_test_of_a_run(result, complaint, made, tmp_path):
    assert "2 tests (siso-5-elbow_pitch, siso-5-shoulder_yaw) need a folder" in complaint(
        "convert", made / "run-1.ch10", tmp_path / "a.asc"
    )
    done = result("convert", made / "run-1.ch10", tmp_path / "a.asc", "--test", "2", code=1)
    assert [entry["name"] for entry in done["tests"]] == ["siso-5-shoulder_yaw"]
    for test in ("3", "9" * 5000):
        message = complaint("convert", made / "run-1.ch10", tmp_path / "b.asc", "--test", test)
        assert f"unknown test '{test[:9]}" in message
    assert not (tmp_path / "b.asc").exists()


def test_what_would_be_lost_is_refused(result, complaint, made, tmp_path):
    log = made / "siso-5-elbow_pitch.nc"
    message = complaint("convert", log, tmp_path / "a.ch10")
    for what in ("true_angles", "load_pressure", "digits of the commanded values", "--lossy"):
        assert what in message
    assert list(tmp_path.iterdir()) == []
    done = result("convert", log, tmp_path / "a.ch10", "--lossy")
    assert any("true_angles" in text for text in done["warnings"])
    np.testing.assert_array_equal(read_run(tmp_path / "a.ch10").tests[0].measured, JointLog.load(log).measured)


def test_memory_is_full_with_one_line(result, complaint, tmp_path, monkeypatch, bus_record):
    record_run([bus_record("long", 200)], tmp_path / "long.ch10")
    monkeypatch.setattr("hmtb_twin.bus.recorder_run.MEMORY", 150)
    message = complaint("convert", tmp_path / "long.ch10", tmp_path / "cut.ch10")
    assert "50 of 200 ticks: the recorder's memory holds 150, twenty minutes" in message
    done = result("convert", tmp_path / "long.ch10", tmp_path / "cut.ch10", "--lossy")
    assert "memory full at tick 150 of long" in done["warnings"][-1]
    output = result("convert", tmp_path / "cut.ch10", tmp_path / "cut.asc", code=1)
    assert output["warnings"] == ["long was to have 200 ticks, of which the memory held 150"]


@pytest.mark.slow
def test_identify_reads_all_of_them(result, complaint, made, tmp_path):
    reference = result("identify", made / "siso-5-elbow_pitch.nc", *OE, "--skip", "4")
    assert 0.9 < reference["bandwidth_hz"] < 1.2
    assert reference["fit"]["simulation"][0] > 95
    for ending, words in ((".asc", ()), (".mat", ()), (".csv", ("--joint", "elbow_pitch"))):
        output = result("identify", made / f"siso-5-elbow_pitch{ending}", *OE, *words, "--skip", "4")
        # the title names the file
        assert {**output, "title": ""} == {**reference, "title": ""}
    bus = result("identify", made / "run-1.ch10", "--test", "siso-5-elbow_pitch", *OE, "--skip", "4")
    # Gaps cost samples, not truth: the model of the parts is that of the whole.
    assert bus["bandwidth_hz"] == pytest.approx(reference["bandwidth_hz"], rel=0.02)
    assert bus["samples"] < reference["samples"] == 1800
    assert "messages are missing" in bus["warnings"][0]
    assert "parts between lost samples" in bus["warnings"][1]
    result("convert", made / "run-1.ch10", tmp_path / "a.asc", "--test", "1", code=1)
    by_ascii = result("identify", tmp_path / "a.asc", *OE, "--skip", "4")
    assert by_ascii["bandwidth_hz"] == bus["bandwidth_hz"]
    checked = result("identify", tmp_path / "a.asc", *OE, "--validate", made / "siso-5-elbow_pitch.nc")
    assert checked["fit"]["simulation"][0] > 80
    run_itself = ("--test", "1", "--validate", made / "run-1.ch10", "--validate-test", "1")
    validated = result("identify", made / "run-1.ch10", *run_itself, *OE, "--skip", "4")
    assert validated["fit"] == bus["fit"]
    assert "choose one by --test" in complaint("identify", made / "run-1.ch10", *OE)


def test_cut_off_file(result, complaint, made, tmp_path):
    content = (made / "run-1.ch10").read_bytes()
    (tmp_path / "cut.ch10").write_bytes(content[: len(content) // 3])
    done = result("convert", tmp_path / "cut.ch10", tmp_path / "asc", "--format", "ascii", code=1)
    (message,) = done["warnings"]
    assert message.startswith("cut.ch10: ")
    assert "which is cut off" in message
    (tmp_path / "cut.ch10").write_bytes(content[:5000])
    reason = complaint("convert", tmp_path / "cut.ch10", tmp_path / "asc2", "--format", "ascii")
    assert "no message of the arm's bus" in reason
    assert not (tmp_path / "asc2").exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("a.asc", "expected a file to convert and the file or folder to write"),
        ("absent.asc b.csv", "no file 'absent.asc'"),
        ("a.asc b.xyz", "'b.xyz' ends in none of .nc, .csv"),
        ("a.asc b --format xls", "unknown format 'xls'"),
        ("a.asc b.csv --format mat", "b.csv ends like csv, --format says mat"),
        ("a.asc a.asc", "would be written over itself"),
        ("a.asc copy.asc both --format csv", "two tests are named 'a'"),
        ("b.asc c.asc both --format csv", "two tests are named 'b_c'"),
        ("a.xyz b.csv", "unknown kind of file '.xyz'"),
    ],
)
def test_mistakes_are_one_line(complaint, tmp_path, monkeypatch, bus_record, words, says):
    monkeypatch.chdir(tmp_path)
    for file, test in (("a", "a"), ("copy", "a"), ("b", "b/c"), ("c", "b\0c")):
        write_record(bus_record(test, 5), Path(f"{file}.asc"))
    Path("a.xyz").write_text("x")
    before = sorted(path.name for path in tmp_path.iterdir())
    assert says in complaint("convert", *words.split())
    assert sorted(path.name for path in tmp_path.iterdir()) == before


def test_without_the_library_nothing_is_simulated(complaint, tmp_path, monkeypatch, bus_record):
    record_run([bus_record("a", 5)], tmp_path / "a.ch10")
    monkeypatch.setitem(sys.modules, "chapter10", None)
    line = "1553 records need pychapter10: pip install 'hmtb-twin[bus]'"
    assert line in complaint("simulate", "siso-5-elbow_pitch", "--format", "1553", "--out", tmp_path / "out")
    assert line in complaint("convert", tmp_path / "a.ch10", tmp_path / "a.asc")
    assert line in complaint("identify", tmp_path / "a.ch10", *OE)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.ch10"]


def test_a_csv_says_what_it_cannot_hold(result, run, complaint, made, tmp_path):
    source, out = made / "siso-5-elbow_pitch.asc", tmp_path / "mine.csv"
    says = "mine.csv does not say that the test is siso-5-elbow_pitch nor that it excites elbow_pitch"
    assert result("convert", source, out)["lost"] == [says]
    assert run("convert", source, out, "--overwrite")[::2] == (0, f"note: {says}\n")
    assert result("convert", source, tmp_path / "mine.mat")["lost"] == []
    assert result("convert", out, tmp_path / "again.csv")["lost"] == ["again.csv does not say that the test is mine"]
    joint_needed = "it is a record of joints: choose one by --joint"
    assert joint_needed in complaint("identify", made / "siso-5-elbow_pitch.csv", *OE)


def test_a_recording_of_several_tests_is_one_row(made, printed):
    names = ("siso-5-elbow_pitch", "siso-5-shoulder_yaw")
    out = printed("simulate", *names, "--format", "1553", "--duration", "2", "--out", made / "two")
    (row,) = (line for line in out.splitlines() if "run-1.ch10 " in line and "next:" not in line)
    assert "4 s (2 tests)" in row
