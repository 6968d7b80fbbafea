"""Calls of the command line by the tests."""

import json

import pytest

from scenarios.commands.cli import main


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    """Exit code, stdout and stderr."""
    code = main([str(word) for word in words])
    return code, *capsys.readouterr()


def printed(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    """Stdout of a command that succeeds with nothing on stderr."""
    code, out, err = run(capsys, *words)
    assert (code, err) == (0, ""), err
    return out


def result(capsys: pytest.CaptureFixture[str], *words: object) -> dict:
    """The object that --json prints."""
    out = printed(capsys, *words, "--json")
    return json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))


def complaint(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    """The one line on stderr for what must be refused: exit 2, nothing on stdout, no traceback."""
    code, out, err = run(capsys, *words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("hmtb: ")
    return err
