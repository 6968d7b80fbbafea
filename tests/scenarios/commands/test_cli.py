"""The command line: what it prints, and one clear line for everything that a user can get wrong."""

import io
import os
import re
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest
from scipy.io import savemat

from hmtb_twin.bus.recorder_run import read_run
from scenarios import names
from scenarios.__main__ import _leave
from scenarios.commands.cli import PROGRAMS, main
from scenarios.commands.output import print_table, say, say_beside_bar, say_each
from scenarios.experiments.scenario import Scenario
from sysid import read_csv, read_model
from sysid.records import foreign_files, reading_process
from tests.scenarios.commands.conftest import signals, table
from tests.signals import default_signals, end

OE = ("--method", "oe", "--orders", "1", "1", "1")


def test_help_and_version(run):
    for words in ([], ["--help"], ["scenarios", "list", "--help"]):
        code, out, _ = run(*words)
        assert code == 0
        assert "usage" in out.lower()
    code, out, err = run("--version")
    assert (code, err) == (0, "")
    assert out.startswith("hmtb ")
    code, out, _ = run("identify", "--help")
    assert "p = 5 (the default)" in " ".join(out.split())


@pytest.mark.parametrize(
    "words", [f"{program} {name}" for program in PROGRAMS for name in PROGRAMS[program]["commands"]]
)
def test_help_of_every_command_shows_neither_empty_defaults_nor_wrapped_examples(printed, words):
    out = printed(*words.split()[1:], "--help")
    assert out.startswith(f"usage: {words} ")
    assert not any(text in out for text in ("{None", "default: None", "default: )", "default: '')"))
    assert not any(line.startswith("hmtb ") for line in out.splitlines())


@pytest.mark.slow
def test_narrow_terminals_stale_variables_and_readers_that_leave(printed, monkeypatch, tmp_path):
    monkeypatch.setenv("COLUMNS", "1")
    assert printed("truth", "--help")
    script = f"{sys.executable} -m scenarios waveform prbs --out . | head -1; exit ${{PIPESTATUS[0]}}"
    stale = {**os.environ, "MPLBACKEND": "x", "SOURCE_DATE_EPOCH": "x"}
    assert subprocess.run(["bash", "-c", script], env=stale, cwd=tmp_path).returncode == 0


def test_a_table_does_not_end_the_process_where_its_reader_has_left():
    """What was printed before the table finds the reader gone; the command line makes exit code 0 of that error."""
    program = (
        "import os, sys\n"
        "from scenarios.commands.output import print_table\n"
        "sys.stdout.write('printed before')\n"
        "try:\n"
        "    print_table('title', ['column'], [['1']])\n"
        "    sys.stdout.flush()\n"
        "except BrokenPipeError:\n"
        "    os._exit(7)\n"
    )
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run([sys.executable, "-c", program], stdout=writer, stderr=subprocess.PIPE, text=True)
    os.close(writer)
    assert (done.returncode, done.stderr) == (7, "")


@pytest.mark.parametrize("program", PROGRAMS)
def test_help_shows_a_line_for_each_command_on_one_screen(printed, program, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    lines = printed(*program.split()[1:], "--help").splitlines()
    shown = lines[lines.index("Commands:") + 2 :]
    assert [line.split()[0] for line in shown[: shown.index("")]] == list(PROGRAMS[program]["commands"])
    assert len(lines) <= 40


def test_help_names_every_variant_and_payload(run):
    from hmtb_twin import PAYLOADS, VARIANTS

    _, out, _ = run("truth", "--help")
    assert all(name in out for name in (*VARIANTS, *PAYLOADS))


def test_help_names_every_method_and_its_orders(run):
    from scenarios.identification.methods import ESTIMATORS

    out = " ".join(run("identify", "--help")[1].split())
    assert f"--method {'|'.join(ESTIMATORS)}" in out
    for name, entry in ESTIMATORS.items():
        assert " ".join([name, *entry.orders, *(f"[{order}]" for order in entry.optional)]) in out


def test_scenarios_are_listed_by_tag_and_shown(run, result, tmp_path):
    listed = result("scenarios", "list", "--tag", "prbs")["scenarios"]
    assert listed[0]["name"] == "siso-5-shoulder_yaw"
    assert [entry["name"] for entry in listed] == list(names("prbs"))
    code, out, _ = run("scenarios")
    assert code == 0
    assert out.count("siso-") == 48
    code, out, _ = run("scenarios", "show", "siso-7-elbow_pitch")
    assert code == 0
    mine = tmp_path / "mine.toml"
    mine.write_text(out.replace("siso-7-elbow_pitch", "mine").replace("240.0", "2.0"))
    done = result("simulate", mine, "--out", tmp_path)
    assert done["logs"] == [str(tmp_path / "mine.nc")]
    assert done["failed"] == {}


@pytest.mark.slow
@pytest.mark.parametrize("header", ["t", "Time", "TIME (s)", "time_s", "Time [ms]", "t / ms", "Ts", "dt"])
def test_every_usual_name_of_time_is_read(result, complaint, tmp_path, header):
    u, y = signals()
    scale = 1000.0 if "ms" in header else 1.0
    times = scale * 0.05 * (np.ones(len(u)) if header in ("Ts", "dt") else np.arange(len(u)))
    path = table(tmp_path / "robot.csv", {header: times, "u": u, "y": y})
    assert result("identify", path, *OE)["dt"] == pytest.approx(0.05)
    message = complaint("identify", path, *OE, "--dt", "0.02")
    assert f"sampling interval 0.02 s by --dt, 0.05 s by {header!r}" in message


def test_the_sampling_interval_of_a_mat_file_is_read(result, complaint, tmp_path):
    u, y = signals()
    mat = tmp_path / "robot.mat"
    savemat(mat, {"u": u, "y": y, "Ts": 0.05})
    assert result("identify", mat, *OE)["dt"] == 0.05
    savemat(mat, {"u": u, "y": y})
    assert "no sampling interval" in complaint("identify", mat, *OE)


def test_unknown_names_suggest_the_near_one(complaint, csv):
    assert "did you mean 'elbow_pitch'" in complaint("identify", csv, *OE, "--joint", "elbow")
    assert "did you mean 'armax'" in complaint("identify", csv, "--method", "armx", "--orders", "1", "1", "1")
    assert "did you mean 'y'" not in complaint("identify", csv, *OE, "--output", "angle")


def test_wrong_orders(complaint, csv):
    identify = ("identify", csv, "--method", "oe", "--orders")
    assert "takes the orders nb nf [nk]; given 2" in complaint(*identify, "2")
    assert "0 or more, given -1 2" in complaint(*identify, "-1", "2")
    assert "data" in complaint(*identify, "4000", "4000", "1")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("dt,u,y\n" + "0.1,1,2\n" * 50, "put a row of rest in front"),
        (
            "dt,u,y\n" + "0.1,0,2\n0.1,0,3\n" * 50,
            "the input 'u' is constant at 0; expected one that moves in 100 samples",
        ),
        ("dt,u,y\n" + "1,1,2\n1,-1,3\n" * 50 + "1,nan,1\n", "NaN"),
        ("dt,u,y\n" + "1,1,2\n1,-1,3\n" * 50 + "1,1,\n", "NaN"),
        ("a,b\n1,2\n", "unknown column 'u'"),
        ("u,y\n" + "1,2\n-1,3\n" * 50, "no sampling interval; expected a column of times"),
        ("1,2\n-1,3\n" * 50, "or --dt SECONDS"),
    ],
)
def test_wrong_csv(complaint, tmp_path, text, says):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    assert says in complaint("identify", path, *OE)


def test_wrong_files(complaint, tmp_path):
    assert "no data file" in complaint("identify", tmp_path / "missing.csv", *OE)
    assert "is a folder, and no rosbag2 folder with a metadata.yaml" in complaint("identify", tmp_path, *OE)
    foreign = tmp_path / "foreign.xyz"
    foreign.write_bytes(bytes(range(256)) * 8)
    assert "unknown kind of data file" in complaint("identify", foreign, *OE)
    short = tmp_path / "short.mat"
    savemat(short, {"dt": 0.02, "u": np.arange(50.0) % 3, "y": np.arange(40.0)})
    message = complaint("identify", short, *OE)
    assert "50" in message
    assert "40" in message


@pytest.mark.parametrize(
    "words",
    [
        ("simulate", "pipe"),
        ("identify", "pipe", "--input", "u", "--output", "y"),
        ("dataset", "build", "hmtb-siso-v1", "--withhold", "secret", "--students", "pipe"),
        ("simulate", "siso-5-elbow_pitch", "--out", "/dev/null"),
    ],
)
def test_pipes_and_devices_are_refused(complaint, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe")
    assert "is a pipe, a socket or a device" in complaint(*words)


@pytest.mark.parametrize("reader", [read_run, read_model, Scenario.read, partial(read_csv, inputs="u", outputs="y")])
def test_readers_refuse_pipes_too(tmp_path, reader):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with ThreadPoolExecutor() as pool, pytest.raises(ValueError, match="pipe"):
        answer = pool.submit(reader, pipe)
        try:
            answer.result(20.0)  # s
        finally:
            if not answer.done():
                pipe.write_text("")  # lets go a reader that waits


@pytest.mark.parametrize("command", ["export", "baselines", "score"])
def test_a_folder_without_a_data_set_is_refused(complaint, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    words = {"export": ("--format", "csv"), "score": ("--data", ".")}.get(command, ())
    complaint("dataset", command, "." if command != "score" else "p", *words)


# a file of MATLAB 7.3 is HDF5 too, behind a head of its own
@pytest.mark.parametrize(
    "words",
    [
        "identify log.nc",
        "compare log.mat",
        "convert log.nc a.asc",
        "identify log.mcap --input /u --output /y",
        "video log.nc",
        "truth --data log.nc",
    ],
)
def test_a_file_that_ends_the_process_which_reads_it_is_refused(complaint, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "crash.py").write_text("import os; os.abort()")
    monkeypatch.setattr(foreign_files, "__file__", str(tmp_path / "crash.py"))
    monkeypatch.setattr(reading_process, "_OF_THREAD", threading.local())
    for name in ("log.nc", "log.mat", "log.mcap"):
        (tmp_path / name).write_bytes(bytes(512) + b"\x89HDF\r\n\x1a\n")
    (name,) = re.findall(r"log\.\w+", words)
    message = complaint(*words.split())
    assert name in message and "reading it crashed" in message


def test_names_from_files_do_not_steer_the_terminal(complaint, tmp_path, capsys):
    assert "\x1b" not in complaint("identify", tmp_path / "\x1b[2Jrow.csv", *OE)
    print_table("scores", ("name", "score"), [("eve\x1b[1A\rann", "1.0")])
    say("eve\x1b[2J")
    print_table("scores", ("name", "score"), [("eve\n bob  0.1", "1.0")])
    say_beside_bar("eve\x1b[2J")
    say_each("refused: ", ["eve\n bob: late"])
    out, err = capsys.readouterr()
    assert "\x1b" not in out + err and "\n bob" not in out


def test_words_that_a_terminal_cannot_show_are_escaped(monkeypatch, capfd):
    stream = io.TextIOWrapper(io.BytesIO(), "ascii")
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stderr", stream)
        assert main(["é"]) == 2
    stream.flush()
    assert rb"unknown command '\xe9'" in stream.buffer.getvalue()
    monkeypatch.setattr(os, "_exit", lambda _: None)
    monkeypatch.setattr(sys, "argv", ["hmtb", "\udcff\x1b\n"])
    _leave()
    assert "run the command again: hmtb '???'\n" in capfd.readouterr().err


def test_too_little_memory_is_one_line(complaint, monkeypatch):
    def full(*_, **__):
        raise MemoryError("Unable to allocate 7.45 GiB")

    monkeypatch.setattr("scenarios.experiments.registry.load", full)
    assert "not enough memory (Unable to allocate 7.45 GiB)" in complaint("preview", "siso-5-elbow_pitch")
    script = f"ulimit -v 650000; exec {sys.executable} -m scenarios simulate siso-5-elbow_pitch"
    done = subprocess.run(["bash", "-c", script], stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "ulimit -v allows 650000 kB, a command needs 1048576" in done.stderr


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no /dev/full")
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_full_disk_is_one_line(unbuffered, monkeypatch):
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)  # Python writes at once, or flushes once more when it ends
    command = [sys.executable, "-m", "scenarios"]
    with open("/dev/full", "w") as full:
        done = subprocess.run([*command, "--version"], stdout=full, stderr=subprocess.PIPE)
        assert subprocess.run([*command, "nonsense"], stderr=full).returncode == 2
        assert subprocess.run([*command, "nonsense"], stdout=full, stderr=full).returncode == 2
    assert (done.returncode, done.stderr) == (2, b"hmtb: cannot read or write: No space left on device\n")


def test_a_folder_that_cannot_be_written_is_refused(complaint, tmp_path):
    blocker = tmp_path / "file"
    blocker.write_text("")
    for command in (("thesis", "--quick"), ("simulate", "siso-1-elbow_pitch"), ("waveform", "prbs")):
        assert "cannot write to folder" in complaint(*command, "--out", blocker / "inside")


def test_interrupt_is_130_and_leaves_nothing(run, monkeypatch, tmp_path):
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("hmtb_twin.linearize", interrupted)
    monkeypatch.setattr("hmtb_twin.simulate", interrupted)
    monkeypatch.setattr("scenarios.thesis.study.run_study", interrupted)
    inside = tmp_path / "deep" / "er"
    for words in (
        ("truth",),
        ("simulate", "siso-1-elbow_pitch", "--out", str(inside)),
        ("thesis", "--quick", "--out", str(inside)),
    ):
        code, out, err = run(*words)
        assert (code, out) == (130, "")
        assert err == f"hmtb: interrupted; run the command again: hmtb {' '.join(words)}\n"
    assert "\x1b" not in run("thesis", "--quick", "--out", inside / "\x1b")[2]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("delay", [0.0, 0.1, 0.4, 0.8])
def test_an_interrupt_during_start_up_is_one_line(run, delay, number):
    """Whichever module is being imported: compiled ones lose a KeyboardInterrupt or turn it into another error."""
    script = "from scenarios.__main__ import run; print('started', flush=True); raise SystemExit(run())"
    command = [sys.executable, "-c", script, "truth"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, preexec_fn=default_signals, **pipes) as process:
        process.stdout.readline()
        time.sleep(delay + 0.01)
        _, err = end(process, number)
    # The library of windows starts a process of its own to learn its version, which may complain behind the line.
    assert process.returncode == 130
    assert err.startswith("hmtb: interrupted; run the command again: hmtb truth\n")
    assert "KeyboardInterrupt" not in err


@pytest.mark.slow
@pytest.mark.parametrize("words", [["--help"], ["scenarios", "list"]])
def test_start_up_is_fast(words):
    """Help and lists import no package for simulation or identification, and cost at most four times tyro and rich."""

    def start(*options):
        begin, python = sum(os.times()[2:4]), (sys.executable, "-X", "importtime")  # s of children
        done = subprocess.run([*python, *options], check=True, capture_output=True, text=True)
        return sum(os.times()[2:4]) - begin, done.stderr

    ours, loaded = min(start("-m", "scenarios", *words) for _ in range(3))
    assert ours < 4.0 * min(start("-c", "import tyro, rich.table") for _ in range(3))[0]
    assert re.search(r"\| +tyro$", loaded, re.M)
    assert not re.search(r"\| +(numpy|scipy|mujoco|pinocchio|control|h5py|matplotlib|sysid)$", loaded, re.M)


def test_clipping_and_slewing_are_told(run, result, tmp_path):
    _, toml, _ = run("scenarios", "show", "siso-1-elbow_pitch")
    loud, quiet = tmp_path / "loud.toml", tmp_path / "quiet.toml"
    text = toml.replace("240.0", "4.0") + "\n[hand_controller]\ngain = 0.067\nhold = 1\n"
    loud.write_text(text.replace("siso-1-elbow_pitch", "loud").replace("amplitude = 1.0", "amplitude = 50.0"))
    quiet.write_text(text.replace("siso-1-elbow_pitch", "quiet").replace("amplitude = 1.0", "amplitude = 0.01"))
    output = result("simulate", loud, quiet, "--out", tmp_path)
    assert output["clipped"]["loud"] > 0.5
    assert output["velocity_limited"]["loud"] > 0.9
    assert output["clipped"]["quiet"] == 0.0
    assert output["velocity_limited"]["quiet"] < output["velocity_limited"]["loud"]
    assert [text.partition(":")[0] for text in output["warnings"]] == ["loud"]
    code, out, _ = run("simulate", loud, "--out", tmp_path, "--overwrite")
    assert code == 0
    assert "converter clips" in out
    assert "warning: loud:" in out


def test_errors_of_libraries_do_not_leak(complaint, monkeypatch, tmp_path):
    def full(*_: object, **__: object) -> None:
        raise OSError("[Errno 28] Unable to synchronously create file (errno = 28, error message = 'No space left')")

    simulate = ("simulate", "siso-1-elbow_pitch", "--duration", "1", "--out", tmp_path)
    (tmp_path / "siso-1-elbow_pitch.nc").mkdir()
    assert "it is a folder" in complaint(*simulate)
    (tmp_path / "siso-1-elbow_pitch.nc").rmdir()
    monkeypatch.setattr("hmtb_twin.files.netcdf.write_whole", full)
    message = complaint(*simulate)
    assert "cannot write" in message
    assert "rrno" not in message


def test_a_log_of_another_joint_gives_a_hint(result, complaint, tmp_path):
    words = ("simulate", "siso-5-elbow_pitch", "siso-5-shoulder_yaw", "--duration", "6", "--out", tmp_path)
    mine, other = result(*words)["logs"]
    assert "excites shoulder_yaw" in complaint("identify", mine, *OE, "--validate", other)
    assert "the log of 0.02 s" in complaint("identify", mine, *OE, "--dt", "0.01")


def test_a_fault_of_ours_keeps_its_traceback(monkeypatch):
    def broken(*_: object) -> None:
        raise ValueError("not the user's doing")

    monkeypatch.setattr("hmtb_twin.linearize", broken)
    with pytest.raises(ValueError, match="not the user's doing"):
        main(["truth"])


@pytest.mark.slow
@pytest.mark.parametrize(("words", "code"), [(["truth", "--pose", "home"], 0), (["--version"], 0), (["nonsense"], 2)])
def test_closed_streams_get_nothing(monkeypatch, words, code):
    """`hmtb ... >&- 2>&-`: Python has no stream then."""
    for name in ("stdout", "stderr"):
        monkeypatch.setattr(sys, name, None)
    assert main(words) == code
    for stream in (sys.stdout, sys.stderr):
        assert stream.name == os.devnull
        stream.close()
