"""Files are replaced after a question on a terminal or by --overwrite; each command says what is next."""

import os
import pty
import shlex
import subprocess
import sys
from inspect import signature

import pytest

from scenarios.commands.cli import PROGRAMS, _command, main, parse

WAVEFORM = ("waveform", "prbs", "--out")


def next_words(out):
    """Words of the command that the last line shows."""
    mark, program, *words = shlex.split(out.splitlines()[-1])
    assert (mark, program) == ("next:", "hmtb")
    return words


def on_terminal(answer, *words):
    """Exit code and output of a command on a terminal on which somebody answers its question."""
    terminal, side = pty.openpty()
    command = [sys.executable, "-m", "scenarios", *map(str, words)]
    with subprocess.Popen(command, stdin=side, stdout=subprocess.PIPE, stderr=side, text=True) as process:
        os.close(side)
        shown = b""
        while b"[y/N] " not in shown:
            shown += os.read(terminal, 4096)
        os.write(terminal, f"{answer}\n".encode())
        while True:
            try:
                data = os.read(terminal, 4096)
            except OSError:  # the other side is closed
                break
            if not data:
                break
            shown += data
        out = process.stdout.read()
    os.close(terminal)
    return process.returncode, out, shown.decode()


@pytest.mark.slow
def test_without_a_terminal_nothing_is_replaced(complaint, printed, tmp_path):
    printed(*WAVEFORM, tmp_path)
    before = (tmp_path / "prbs.txt").read_bytes()
    text = complaint(*WAVEFORM, tmp_path, "--seed", 7)
    assert f"{tmp_path / 'prbs.txt'} and 1 other file exist: --overwrite replaces them" in text
    assert (tmp_path / "prbs.txt").read_bytes() == before
    printed(*WAVEFORM, tmp_path, "--seed", 7, "--overwrite")
    assert (tmp_path / "prbs.txt").read_bytes() != before


@pytest.mark.slow
@pytest.mark.parametrize("answer", ["n", "y"])
def test_a_terminal_is_asked(tmp_path, answer):
    (tmp_path / "prbs.txt").write_text("mine", encoding="utf-8")
    code, out, shown = on_terminal(answer, *WAVEFORM, tmp_path)
    assert f"{tmp_path / 'prbs.txt'} exists: replace it? [y/N] " in shown
    assert code == (0 if answer == "y" else 2)
    assert ((tmp_path / "prbs.txt").read_text(encoding="utf-8") == "mine") == (answer == "n")
    assert ("nothing was written" in shown) == (answer == "n")
    assert out.startswith("Waveform prbs") == (answer == "y")


def test_every_command_that_writes_files_takes_the_option():
    never = {"hmtb station", "hmtb dataset build", "hmtb dataset export"}  # they replace nothing
    for program, table in PROGRAMS.items():
        for name, place in table["commands"].items():
            options = signature(_command(place)).parameters if place else {}
            writes = bool({"out", "save"} & set(options)) or name == "convert"
            assert ("overwrite" in options) == (writes and f"{program} {name}" not in never), name


@pytest.mark.slow
def test_the_next_command_works_as_printed(printed, run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = next_words(printed("preview", "siso-5-elbow_pitch", "--duration", 20, "--out", "runs"))
    assert words == ["simulate", "siso-5-elbow_pitch", "--out", "runs", "--duration", "20.0"]
    words = next_words(printed(*words))
    assert words == ["identify", "runs/siso-5-elbow_pitch.nc", "--joint", "elbow_pitch"]
    words = next_words(printed(*words, "--method", "oe", "--orders", 2, 2, 2, "--out", "figures"))
    assert words[-2:] == ["--save", "siso-5-elbow_pitch.json"]
    words = next_words(printed(*words))
    assert words[:2] == ["compare", "runs/siso-5-elbow_pitch.nc"]
    words = next_words(printed(*words, "--out", "outputs.svg"))
    assert main(words) == 0
    words = next_words(run("convert", "runs/siso-5-elbow_pitch.nc", "a b.csv", "--lossy")[1])
    assert words == ["identify", "a b.csv", "--joint", "elbow_pitch"]
    assert callable(parse(words))
    printed(*words, "--method", "arx", "--orders", 1, 1, 1)
    assert main(next_words(printed("waveform", "multisine"))) == 0


def test_hints_name_only_options_that_the_command_has(complaint, tmp_path):
    path = tmp_path / "robot.csv"
    path.write_text("dt,u,y\n" + "0.1,1,2\n0.1,-1,3\n" * 50 + "0.1,1,\n", encoding="utf-8")
    assert "--missing takes NaN" in complaint("identify", path)
    text = complaint("track", path)
    assert "NaN" in text
    assert "missing" not in text
