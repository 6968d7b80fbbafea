"""A process that has loaded all that a Python estimator needs of ours and forks one process after the other for it.

Loading takes a second; an estimator that dies at every record would cost that every time.
"""

import os
import socket
import struct
import subprocess
import sys
import tempfile
import uuid
from pathlib import Path

from scenarios.estimators import process_tree
from scenarios.estimators.pipes import Pipes
from scenarios.estimators.started import child_environment
from scenarios.estimators.supervised import Supervised
from scenarios.files.errors import ScenarioError

STARTING = 60.0
"""How long it may take to load, s."""

ANSWERING = 10.0
"""How long it may take to fork, s."""

NUMBER = struct.Struct("<q")
"""How it tells numbers of processes and their status."""

FORK, WAIT = b"f", b"w"
"""What it is told to do."""


class Nursery:
    """The process that forks; all sandboxes of this process share one."""

    def __init__(self) -> None:
        self._forks: set[int] = set()
        self._mark = uuid.uuid4().hex
        self._control, theirs = socket.socketpair()
        self._control.settimeout(STARTING)
        try:
            self._process = subprocess.Popen(
                # Without the working folder among the places of modules.
                [sys.executable, "-P", "-m", "scenarios.estimators.python_child", str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                cwd=tempfile.gettempdir(),
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
        self._forks.add(pid)
        return Supervised(pid, pipes, lambda: process_tree.family(pid), lambda: self._finish(pid))

    def close(self) -> None:
        """End it, and all that came of it."""
        self._control.close()
        process_tree.end_all(
            lambda: {*process_tree.family(self._process.pid), *process_tree.marked(self._mark)}, self._process.pid
        )
        self._process.wait()

    def _finish(self, pid: int) -> tuple[int | None, float]:
        self._forks.discard(pid)

        def left() -> set[int]:
            # Orphans of a dead fork come to the nursery, those of a living one to itself.
            nursery = self._process.pid
            return {*process_tree.family(pid), *process_tree.family(nursery, apart=self._forks)} - {nursery}

        process_tree.end_all(left, pid)
        try:
            self._control.sendall(WAIT + NUMBER.pack(pid))
            return os.waitstatus_to_exitcode(self._number()), float("nan")
        except (OSError, ScenarioError, ValueError):
            return None, float("nan")

    def _number(self) -> int:
        told = self._control.recv(NUMBER.size)
        if len(told) != NUMBER.size:
            raise ScenarioError("it has ended")
        return int(NUMBER.unpack(told)[0])


class SharedNursery:
    """The nursery of this process, while anyone uses it."""

    def __init__(self) -> None:
        self._nursery: Nursery | None = None
        self._owner, self._users = 0, 0

    def enter(self) -> None:
        """Begin to use it."""
        if self._owner != os.getpid():
            # This process is a fork: what the other one has is not ours.
            self._nursery, self._owner, self._users = None, os.getpid(), 0
        self._users += 1

    def get(self) -> Nursery:
        """The nursery; a new one where an estimator has ended it."""
        if self._nursery is not None and not self._nursery.alive:
            self._nursery.close()
            self._nursery = None
        if self._nursery is None:
            self._nursery = Nursery()
        return self._nursery

    def leave(self) -> None:
        """End its use; it is closed after the last one."""
        self._users -= 1
        if self._users == 0 and self._nursery is not None:
            self._nursery.close()
            self._nursery = None


SHARED = SharedNursery()
"""That of this process."""
