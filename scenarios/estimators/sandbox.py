"""Where estimators run: each in a process of its own, with limits, whatever it does."""

import os
import sys
from types import TracebackType
from typing import Protocol

from scenarios.estimators.contestant import Contestant, Limits
from scenarios.estimators.outcome import Outcome
from scenarios.estimators.program_sandbox import ProgramSandbox
from scenarios.estimators.python_sandbox import PythonSandbox
from scenarios.estimators.task import Task
from scenarios.files.errors import ScenarioError
from sysid import IOData


class Sandbox(Protocol):
    """An estimator that can be asked."""

    def __enter__(self) -> "Sandbox":
        """Start it.

        Raises:
            ScenarioError: It cannot be started: no such module, function or program.
        """

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it, and all that came of it."""

    def ask(self, data: IOData, task: Task) -> Outcome:
        """Give it a record and take what comes of it; whatever it does is an outcome.

        Args:
            data: The record.
            task: What is asked.
        """


def open_sandbox(contestant: Contestant, limits: Limits) -> Sandbox:
    """A sandbox for an estimator, to be used in a `with` statement.

    Args:
        contestant: The estimator.
        limits: What it may use for one answer: of a function, memory beyond what it has once its module is loaded; of a
            program, all of it.

    Raises:
        ScenarioError: This system has no means to watch processes.
    """
    if not hasattr(os, "pidfd_open") or not os.path.isdir("/proc/self"):
        raise ScenarioError(f"the system {sys.platform!r} runs this, expected Linux with /proc: sandboxes rest on it")
    return (ProgramSandbox if contestant.program else PythonSandbox)(contestant, limits)
