"""A small process that starts the programs of a sandbox and to which everything that came of them is left.

What a program leaves behind becomes a child of that process, not of the first of the system: so it is found, whatever
session it has moved to and whatever it has taken out of its environment.
"""

import os
import socket
import subprocess
import sys
import tempfile
import uuid
from collections.abc import Sequence
from pathlib import Path

from scenarios.estimators import process_tree
from scenarios.estimators.launcher_messages import receive, send
from scenarios.estimators.pipes import Pipes
from scenarios.estimators.started import child_environment
from scenarios.estimators.supervised import Supervised
from scenarios.files.errors import ScenarioError

ANSWERING = 60.0
"""How long it may take to load or to answer, s; it takes hundredths of one."""


class Launcher:
    """The process that starts programs, one after the other.

    Raises:
        ScenarioError: It does not start.
    """

    def __init__(self) -> None:
        self._mark = uuid.uuid4().hex
        self._control, theirs = socket.socketpair()
        self._control.settimeout(ANSWERING)
        try:
            self._process = subprocess.Popen(
                # Without what is installed and the working folder: it loads little and soon.
                [sys.executable, "-P", "-S", "-m", "scenarios.estimators.launcher_child", str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                cwd=tempfile.gettempdir(),
                env=child_environment({"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}, self._mark),
                pass_fds=(theirs.fileno(),),
                start_new_session=True,
            )
        finally:
            theirs.close()
        try:
            receive(self._control)
        except (OSError, ValueError) as error:
            self.close()
            raise ScenarioError(f"the process that starts programs does not start: {error}") from error

    @property
    def alive(self) -> bool:
        """Whether it still runs: a program could end it."""
        return self._process.poll() is None

    def start(self, command: Sequence[str], folder: Path, *, talks: bool) -> Supervised:
        """Start a program in a session of its own.

        Args:
            command: Program and arguments.
            folder: In which it runs.
            talks: Whether requests and replies go over its standard input and output.

        Raises:
            ScenarioError: It cannot be started.
        """
        pipes = Pipes.open(channel=talks)
        mark = uuid.uuid4().hex
        asked = {"command": list(command), "folder": str(folder), "environment": child_environment({}, mark)}
        try:
            send(self._control, asked, [end for end in pipes.theirs if end >= 0])
            told, _ = receive(self._control)
        except (OSError, ValueError) as error:
            pipes.close()
            raise ScenarioError(f"the process that starts programs does not answer: {error}") from error
        if "pid" not in told:
            pipes.close()
            raise ScenarioError(f"it cannot be started: {told.get('error')}")
        pipes.hand_over()
        pid = int(told["pid"])
        return Supervised(pid, pipes, self._members, lambda: self._finish(pid, mark))

    def close(self) -> None:
        """End it, and all that came of it."""
        self._control.close()
        process_tree.end_all(
            lambda: {*process_tree.family(self._process.pid), *process_tree.marked(self._mark)}, self._process.pid
        )
        self._process.wait()

    def _members(self) -> list[int]:
        """All that came of programs and runs."""
        return [pid for pid in process_tree.family(self._process.pid) if pid != self._process.pid]

    def _finish(self, pid: int, mark: str) -> tuple[int | None, float]:
        # Until it is waited for its number stays its own, and its exit code what it was if it has ended by itself.
        process_tree.end_all(lambda: {*self._members(), *process_tree.marked(mark)}, pid)
        try:
            send(self._control, {"wait": pid})
            told, _ = receive(self._control)
            return os.waitstatus_to_exitcode(int(told["status"])), float(told["seconds"])
        except (OSError, ValueError, KeyError):
            return None, float("nan")
