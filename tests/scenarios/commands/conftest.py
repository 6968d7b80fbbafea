"""Calls of the command line by the tests."""

import json

import numpy as np
import pytest

from scenarios.commands.cli import main
from tests.scenarios.commands.lag import DT, signals, table


@pytest.fixture
def csv(tmp_path):
    """A table of a lag."""
    u, y = signals()
    return table(tmp_path / "robot.csv", {"t": DT * np.arange(len(u)), "u": u, "y": y})


@pytest.fixture
def run(capsys):
    """Run a command: exit code, stdout and stderr."""

    def call(*words):
        code = main([str(word) for word in words])
        return code, *capsys.readouterr()

    return call


@pytest.fixture
def printed(run):
    """Run a command that ends with an exit code, 0 by default, and nothing on stderr: stdout."""

    def call(*words, code=0):
        end, out, err = run(*words)
        assert (end, err) == (code, ""), err
        return out

    return call


@pytest.fixture
def result(printed):
    """Run a command with --json: the object that it prints."""
    return lambda *words, code=0: json.loads(
        printed(*words, "--json", code=code), parse_constant=lambda name: pytest.fail(f"{name} is not JSON")
    )


@pytest.fixture
def complaint(run):
    """Run a command that must be refused, with exit 2, nothing on stdout and no traceback: the one line on stderr."""

    def call(*words):
        code, out, err = run(*words)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert err.startswith("hmtb: ")
        return err

    return call
