"""Programs in any language: the record is written to files, the program writes its model to one."""

import json
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import TracebackType

from scenarios.estimators.command_line import filled, formats, paths, unfilled, words
from scenarios.estimators.contestant import Contestant, Limits
from scenarios.estimators.launcher import Launcher
from scenarios.estimators.model_file import find_model
from scenarios.estimators.model_reader import ModelReader
from scenarios.estimators.no_model import NoModelError
from scenarios.estimators.outcome import REFUSED, Outcome
from scenarios.estimators.own_folder import OwnFolder, check_room
from scenarios.estimators.python_sandbox import GRACE, NEARLY, outcome_of
from scenarios.estimators.supervised import Exchange, Supervised
from scenarios.estimators.task import PROTOCOL, Task
from scenarios.estimators.task_files import write_task
from scenarios.estimators.wire import WireError
from scenarios.files.errors import ScenarioError
from scenarios.files.printable import one_line
from sysid import IOData
from sysid.records.arrays import FloatArray

REFUSES = 77
"""Exit code of a program that does not do what it is asked."""

READY = f"ready {PROTOCOL}"
"""First line of a program that stays."""

STARTING = 120.0
"""How long a program that stays may take until it is ready, s."""

MOST_PRINTED = 2**20
"""Bytes of what a program that stays may print for one answer."""

RETURNED = "returned"
"""Of a request that is answered, while its model has not been looked at."""

TOLD = 300
"""Characters of a text that are told."""

SAYS = ("done", REFUSED, "error")
"""First words of the answers of a program that stays; lines that begin otherwise are what it prints."""


class ProgramSandbox:
    """Runs a program.

    Args:
        contestant: The estimator; its target is a command line.
        limits: What it may use for one answer.
    """

    def __init__(self, contestant: Contestant, limits: Limits) -> None:
        self._contestant, self._limits = contestant, limits
        self._home = Path(contestant.home or ".").resolve()
        self._process: Supervised | None = None
        self._launcher: Launcher | None = None
        self._reader = ModelReader()
        self._folder, self._asked = OwnFolder(), 0
        self._words: list[str] = []

    def __enter__(self) -> "ProgramSandbox":
        self._words = words(self._contestant)
        self._folder.make()
        try:
            self._launcher = Launcher()
            if self._contestant.stays:
                self._start()
        except BaseException:
            self._close_launcher()
            self._folder.remove()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()
        self._close_launcher()
        self._reader.__exit__(kind, error, trace)
        self._folder.remove()

    def ask(self, data: IOData, task: Task) -> Outcome:
        """Ask once; see `open_sandbox`. Reasons name files by their placeholders."""
        got = self._ask(data, task)
        return replace(got, why=self._in_general(got.why)) if got.why else got

    def _ask(self, data: IOData, task: Task) -> Outcome:
        self._asked += 0 if self._contestant.stays else 1
        try:
            folder = self._folder.new(str(self._asked))
        except ScenarioError as error:
            return Outcome("error", f"it left files that cannot be removed: {error}")
        try:
            write_task(folder, data, task, formats(self._contestant.target))
        except OSError as error:
            check_room(error)
            return Outcome("error", f"the files of the record cannot be written to {folder}: {error.strerror}")
        try:
            return self._asked_in(folder, data, task)
        finally:
            if not self._contestant.stays:
                # A full run asks thousands of times.
                self._folder.clear(str(self._asked))

    def _asked_in(self, folder: Path, data: IOData, task: Task) -> Outcome:
        """Ask once; the files are in a folder."""
        told = self._told() if self._contestant.stays else self._run()
        if told.kind != RETURNED:
            return told
        fields = {"kind": RETURNED, "why": "", "seconds": told.seconds, "wall": told.wall, "peak_bytes": 0}
        numbers: Mapping[str, FloatArray] = {}
        try:
            numbers = self._reader.read(find_model(folder))
        except NoModelError as error:
            fields |= {"kind": error.kind, "why": str(error)}
        except OSError as error:
            fields |= {"kind": "malformed", "why": f"the model cannot be read: {error.strerror}"}
        return outcome_of(fields, numbers, data, task, peak_bytes=told.peak_bytes)

    @property
    def _request_folder(self) -> Path:
        """A new one for each start of a program; one that stays knows its one from its command line."""
        return self._folder.path / str(self._asked)

    @property
    def _places(self) -> dict[str, str]:
        return paths(self._request_folder, self._contestant.target)

    def _in_general(self, text: str) -> str:
        """Without what only this request has: the names of its files."""
        return unfilled(text, self._places, self._request_folder)

    def _run(self) -> Outcome:
        """Run the program once."""
        begun = time.monotonic()
        try:
            process = self._launch()
        except ScenarioError as error:
            return Outcome("error", str(error))
        got = process.exchange(
            b"", lambda _: False, seconds=self._limits.seconds, memory_bytes=self._limits.memory_bytes
        )
        wall = time.monotonic() - begun
        process.end()
        code, tail = process.exit_code, process.tail(self._in_general)
        # That of its children that it has waited for goes along.
        seconds = process.usage_seconds if got.end == "ended" else got.seconds
        if got.end != "ended" or code is None or code < 0:
            kind, why = self._lost(process, got)
        elif code == 0:
            kind, why = RETURNED, ""
        elif code == REFUSES:
            kind, why = REFUSED, tail
        else:
            kind, why = "error", f"exit code {code}; it printed {tail!r}"
        return Outcome(kind, why, seconds, wall, got.peak_bytes)

    def _told(self) -> Outcome:
        """Tell a program that stays of the request."""
        if self._process is None:
            try:
                self._start()
            except ScenarioError as error:
                return Outcome("crash", str(error))
        process = self._process
        if process is None:
            raise ScenarioError("the sandbox is closed")
        process.forget_tail()
        # A second answer to the last request is none to this one.
        process.forget_replies()
        lines = AwaitedLine(SAYS)
        line = json.dumps(self._places) + "\n"
        got = process.exchange(
            line.encode("ascii"), lines, seconds=self._limits.seconds, memory_bytes=self._limits.memory_bytes
        )
        if got.end != "answered":
            process.end(GRACE if got.end == "ended" else 0.0)
            kind, why = self._lost(process, got)
            self._end()
            return Outcome(kind, why, got.seconds, got.wall, got.peak_bytes)
        word, _, text = lines.found.partition(" ")
        kind = {"done": RETURNED, REFUSED: REFUSED}.get(word, "error")
        return Outcome(
            kind,
            "" if kind == RETURNED else one_line(self._in_general(text))[:TOLD],
            got.seconds,
            got.wall,
            got.peak_bytes,
        )

    def _launch(self) -> Supervised:
        """Start the program, by a process that is there before the clock runs, unless a program has ended it.

        Raises:
            ScenarioError: It cannot be started.
        """
        if self._launcher is None or not self._launcher.alive:
            self._close_launcher()
            self._launcher = Launcher()
        return self._launcher.start(filled(self._words, self._places), self._home, talks=self._contestant.stays)

    def _close_launcher(self) -> None:
        launcher, self._launcher = self._launcher, None
        if launcher is not None:
            launcher.close()

    def _start(self) -> None:
        """Start a program that stays.

        Raises:
            ScenarioError: It cannot be started, or does not say that it is ready.
        """
        try:
            self._process = self._launch()
        except ScenarioError as error:
            raise ScenarioError(f"{self._contestant.target!r}: {error}") from error
        lines = AwaitedLine(("ready",))
        got = self._process.exchange(b"", lines, seconds=STARTING, memory_bytes=2**40)
        if got.end == "answered" and lines.found == READY:
            return
        process = self._process
        process.end(GRACE if got.end == "ended" else 0.0)
        self._end()
        told = (
            one_line(lines.found)
            or f"{got.end}, {process.how_it_ended()}, it printed {process.tail(self._in_general)!r}"
        )
        raise ScenarioError(
            f"{self._contestant.target!r}: {told}; expected a program that stays to print the line {READY!r} within "
            f"{STARTING:g} s and then to read a line of JSON for each record"
        )

    def _lost(self, process: Supervised, got: Exchange) -> tuple[str, str]:
        limit = self._limits.memory_bytes
        if got.end == "hang":
            return "hang", f"no answer within {self._limits.seconds:g} s"
        if got.end == "memory" or got.peak_bytes > NEARLY * limit:
            return "memory", f"more than {limit / 2**20:.0f} MiB"
        if got.end == "garbage":
            return "malformed", got.why
        printed = process.tail(self._in_general)
        return "crash", f"it ended: {process.how_it_ended()}" + (f"; it printed {printed!r}" if printed else "")

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.end()


class AwaitedLine:
    """Waits for a line that begins with one of some words, among others.

    Args:
        words: The words.

    Attributes:
        found: The line; empty while it has not come.
    """

    def __init__(self, words: tuple[str, ...]) -> None:
        self._words, self._seen = words, 0
        self.found = ""

    def __call__(self, reply: bytearray) -> bool:
        """Whether the line has come.

        Args:
            reply: All that has come so far.

        Raises:
            WireError: Too much that is no such line.
        """
        while (end := reply.find(b"\n", self._seen)) >= 0:
            line = reply[self._seen : end].decode("utf-8", "replace").strip()
            self._seen = end + 1
            if line.partition(" ")[0] in self._words:
                self.found = line
                return True
        if len(reply) > MOST_PRINTED:
            raise WireError(f"{len(reply)} bytes without a line that begins with {' or '.join(self._words)}")
        return False
