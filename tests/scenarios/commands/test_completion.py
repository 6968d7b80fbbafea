"""Completion of commands and names in a shell: bash itself is asked what it would offer."""

import subprocess

import pytest

from scenarios import names
from scenarios.commands.cli import COMMANDS, PROGRAMS


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    from contextlib import redirect_stdout
    from io import StringIO

    from scenarios.commands.cli import main

    with redirect_stdout(StringIO()) as out:
        assert main(["completion", "bash"]) == 0
    path = tmp_path_factory.mktemp("completion") / "hmtb"
    path.write_text(out.getvalue(), encoding="utf-8")
    return path


@pytest.fixture
def offered(script, tmp_path):
    """Words that bash offers for the last word."""

    def ask(*words: str) -> list[str]:
        code = 'source "$1"; shift; COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)); _hmtb; printf "%s\\n" "${COMPREPLY[@]}"'
        command = ["bash", "--norc", "-c", code, "bash", str(script), "hmtb", *words]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
        assert done.stderr == ""
        return done.stdout.split()

    return ask


def test_commands(offered):
    assert offered("") == list(COMMANDS)
    assert offered("id") == ["identify"]
    assert offered("dataset", "") == list(PROGRAMS["hmtb dataset"]["commands"])
    assert offered("dataset", "s") == ["show", "score"]


def test_options(offered):
    assert offered("identify", "a.csv", "--val") == ["--validate", "--validate-test"]
    assert offered("dataset", "score", "--d") == ["--data"]
    assert "--json" in offered("simulate", "siso-5-elbow_pitch", "--out", "runs", "--")


def test_names_stand_where_an_argument_takes_them(offered):
    assert offered("simulate", "reach", "siso-5-") == [name for name in names() if name.startswith("siso-5-")]
    assert offered("simulate", "--json", "rea") == ["reach"]
    assert offered("simulate", "--out", "runs", "rea") == ["reach"]
    assert offered("scenarios", "show", "rpcm-") == ["rpcm-unloaded"]
    assert offered("dataset", "get", "hmtb-si") == ["hmtb-siso-v1"]
    assert offered("dataset", "build", "hmtb-m") == ["hmtb-mimo-v1"]
    assert offered("track", "track-el") == ["track-elbow_pitch"]


def test_values_of_options(offered):
    assert offered("identify", "a.csv", "--method", "o") == ["oe", "okid"]
    assert offered("truth", "--servo", "") == ["flow", "torque"]
    assert offered("control", "--method", "following", "a") == ["adaptive"]
    assert offered("completion", "") == ["bash", "zsh", "fish"]
    assert offered("dataset", "build", "--progress", "b") == ["bar"]


def test_elsewhere_the_shell_completes_files(offered, script):
    assert offered("simulate", "--out", "r") == []
    assert offered("identify", "r") == []
    assert "complete -o default -F _hmtb hmtb" in script.read_text(encoding="utf-8")


def test_scripts_of_other_shells(printed):
    assert "bashcompinit" in printed("completion", "zsh")
    lines = printed("completion", "fish").splitlines()
    assert 'complete -c hmtb -n "__fish_seen_subcommand_from truth" -l servo -x -a "flow torque"' in lines
