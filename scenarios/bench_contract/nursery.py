"""A process that has loaded all that a Python estimator needs of ours and forks one process after the other for it.

Loading takes a second; an estimator that dies at every record would cost that every time.
"""

import os
import socket
import struct
import subprocess
import sys
import uuid
from pathlib import Path

from scenarios.bench_contract import process_tree
from scenarios.bench_contract.pipes import Pipes
from scenarios.bench_contract.started import child_environment
from scenarios.bench_contract.supervised import Supervised
from scenarios.errors import ScenarioError

STARTING = 60.0
"""How long it may take to load, s."""

ANSWERING = 10.0
"""How long it may take to fork, s."""

NUMBER = struct.Struct("<q")
"""How it tells numbers of processes and their status."""

FORK, WAIT = b"f", b"w"
"""What it is told to do."""


class Nursery:
    """The process that forks.

    Args:
        folder: In which it runs, and all that it forks.
    """

    def __init__(self, folder: Path) -> None:
        self._mark = uuid.uuid4().hex
        self._control, theirs = socket.socketpair()
        self._control.settimeout(STARTING)
        try:
            self._process = subprocess.Popen(
                # Without the working folder among the places of modules.
                [sys.executable, "-P", "-m", "scenarios.bench_contract.python_child", str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                cwd=folder,
                env=child_environment(
                    {
                        "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
                        # The same answer to the same question, and no windows.
                        "PYTHONHASHSEED": "0",
                        "MPLBACKEND": "Agg",
                    },
                    self._mark,
                ),
                pass_fds=(theirs.fileno(),),
                start_new_session=True,
            )
        finally:
            theirs.close()

    @property
    def alive(self) -> bool:
        """Whether it still runs: what it forks could end it."""
        return self._process.poll() is None

    def fork(self, folder: Path) -> Supervised:
        """A new process, which waits for what to load.

        Args:
            folder: In which it runs.

        Raises:
            ScenarioError: The nursery is gone.
        """
        pipes = Pipes.open(channel=True)
        try:
            socket.send_fds(self._control, [FORK + os.fsencode(folder)], list(pipes.theirs))
            pid = self._number()
        except (OSError, ScenarioError) as error:
            pipes.close()
            raise ScenarioError(f"the process that starts estimators does not answer: {error}") from error
        self._control.settimeout(ANSWERING)
        pipes.hand_over()
        return Supervised(pid, pipes, lambda: self._children(pid), lambda: self._finish(pid))

    def close(self) -> None:
        """End it, and all that came of it."""
        self._control.close()
        process_tree.end_all(
            lambda: {*process_tree.family(self._process.pid), *process_tree.marked(self._mark)}, self._process.pid
        )
        self._process.wait()

    def _children(self, pid: int) -> list[int]:
        """All that came of a fork, orphans too; also where it has ended this process."""
        nursery = self._process.pid
        return list({*process_tree.family(pid), *process_tree.family(nursery)} - {nursery})

    def _finish(self, pid: int) -> tuple[int | None, float]:
        process_tree.end_all(
            lambda: {*self._children(pid), *process_tree.marked(self._mark)} - {self._process.pid}, pid
        )
        try:
            self._control.sendall(WAIT)
            return os.waitstatus_to_exitcode(self._number()), float("nan")
        except (OSError, ScenarioError, ValueError):
            return None, float("nan")

    def _number(self) -> int:
        told = self._control.recv(NUMBER.size)
        if len(told) != NUMBER.size:
            raise ScenarioError("it has ended")
        return int(NUMBER.unpack(told)[0])
