"""Runner of estimators: each in its own process, a request in files, an outcome whatever the estimator does."""

import errno
import json
import os
import shlex
import shutil
import signal
import sys
import tempfile
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from scenarios.estimators.estimator import Estimator, Limits
from scenarios.estimators.model_numbers import answer_of, unstable
from scenarios.estimators.outcome import MODEL, REFUSED, EstimatorOutcome, NoModelError
from scenarios.estimators.process import WatchedProcess
from scenarios.estimators.request_files import FILES, FORMATS, read_model, write_request
from scenarios.estimators.task import PROTOCOL, Task
from scenarios.files.errors import ScenarioError
from scenarios.files.printable import one_line
from sysid import IOData

REFUSES = 77
"""Exit code of a program that refuses a task."""

READY = f"ready {PROTOCOL}"
"""First line of a program that stays."""

STARTING = 120.0
"""Time that a program that stays has until it is ready, s."""

PROGRAM_WORDS = ("done", REFUSED, "error")
"""First words of the answers of a program that stays; lines that begin otherwise are ignored."""

FUNCTION_WORDS = (*PROGRAM_WORDS, "malformed", "not_finite", "memory")
"""Those of the child of a Python function, whose own printing goes elsewhere."""

NEARLY = 0.9
"""A process that died with this share of its memory limit in use died of that."""

LONGEST_REASON = 300
"""Characters of a printed text that a reason quotes."""

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
"""Errors that say that nothing can be written any more: no other request would fare better."""


class EstimatorProcess:
    """An estimator ready for requests, to be used in a `with` statement.

    A program is started for each request; a Python function, and a program that stays, once, and again after each
    failure that ended its process.
    """

    def __init__(self, estimator: Estimator, limits: Limits) -> None:
        self._estimator, self._limits = estimator, limits
        self._stays = estimator.stays or not estimator.program
        self._home = self._working_folder = Path(estimator.home or ".").resolve()
        self._process: WatchedProcess | None = None
        self._at_rest = 0
        self._folder = Path()
        self._command: list[str] = []
        self._environment: dict[str, str] = {}
        self._paths: dict[str, str] = {}
        self._formats: tuple[str, ...] = ("npz",)

    def __enter__(self) -> "EstimatorProcess":
        """Start it.

        Raises:
            ScenarioError: It cannot be started: no such module, function or program; or this system is not Linux.
        """
        if not hasattr(os, "pidfd_open"):
            raise ScenarioError(f"this system is {sys.platform!r}, expected Linux: estimators cannot be watched here")
        if self._estimator.program:
            self._formats = tuple(name for name in FORMATS if f"{{{name}}}" in self._estimator.target)
            self._command = program_words(self._estimator, self._home)
        try:
            self._folder = Path(tempfile.mkdtemp(prefix="hmtb-estimator-"))
            (self._folder / "work").mkdir()
        except OSError as error:
            raise ScenarioError(f"cannot make a temporary folder for an estimator: {error}") from error
        for name in (*self._formats, "task", "model"):
            self._paths[name] = str(self._folder / "request" / FILES[name])
        if not self._estimator.program:
            # -P: the working folder is not on the path, so that files there hide no package of the bench.
            child = [sys.executable, "-P", "-m", "scenarios.estimators.python_child"]
            self._command = [*child, self._estimator.target, str(self._home)]
            # The child finds the packages that this process finds.
            self._environment = {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
            # A folder of its own: estimators write files, and import what lies in the working folder.
            self._working_folder = self._folder / "work"
        try:
            if self._stays:
                self._start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        """Kill its processes and remove its files."""
        if self._process is not None:
            self._end(self._process)
        shutil.rmtree(self._folder, ignore_errors=True)

    def ask(self, data: IOData, task: Task) -> EstimatorOutcome:
        """Send a record and a task to the estimator; whatever it does is an outcome.

        Args:
            data: The record; its names do not reach the estimator.
            task: What is asked.

        Raises:
            ScenarioError: The files of the request cannot be written.
        """
        folder = self._folder / "request"
        try:
            # An empty folder: a model of the request before answers nothing.
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            write_request(folder, data, task, self._formats)
        except OSError as error:
            if error.errno not in FULL:
                return EstimatorOutcome("error", f"cannot write the files of the record: {error.strerror}")
            raise ScenarioError(
                f"cannot write the files of a record: {error.strerror}; expected space in {tempfile.gettempdir()}, or "
                "in the folder that the variable TMPDIR names"
            ) from error
        outcome = self._ask_process()
        return _with_model(outcome, folder, data, task) if outcome.kind == MODEL else outcome

    def _ask_process(self) -> EstimatorOutcome:
        """Let the process answer the files of the request; `MODEL`: its model file has not been read yet."""
        try:
            process = self._process or self._start()
        except ScenarioError as error:
            # One that stays was ready once before.
            failure = "crash" if self._stays else "error"
            return EstimatorOutcome(failure, str(error))
        request = json.dumps(self._paths) if self._stays else ""
        words = PROGRAM_WORDS if self._estimator.program else FUNCTION_WORDS
        memory_bytes = self._at_rest + self._limits.memory_bytes
        reply = process.exchange(request, words, seconds=self._limits.seconds, memory_bytes=memory_bytes)
        seconds = reply.seconds
        if reply.kind == MODEL:
            word, _, why = reply.why.partition(" ")
            why = self._printable(why)[:LONGEST_REASON]
            if word == "memory":
                # After a MemoryError what it still holds would count against the next answer.
                self._end(process)
        else:
            code, seconds_with_children = self._end(process)
            word, why = self._reason_of_end(reply, code, process)
            if word in PROGRAM_WORDS:
                seconds = seconds_with_children
        if word != "done":
            return replace(reply, kind=word, why=why, seconds=seconds)
        return replace(reply, kind=MODEL, why="", seconds=_reported_seconds(why, seconds))

    def _reason_of_end(self, reply: EstimatorOutcome, code: int, process: WatchedProcess) -> tuple[str, str]:
        """Word and reason where a process ended; one of `PROGRAM_WORDS` if a program started for this did by itself."""
        description, limit = self._description_of_end(code, process), self._limits.memory_bytes
        if reply.kind == "crash" and code >= 0 and not self._stays:
            if code == REFUSES:
                return REFUSED, self._printed(process)
            return ("error" if code else "done"), description
        if reply.kind == "hang":
            return "hang", f"no answer within {self._limits.seconds:g} s"
        # The kernel, or the process itself, may end it between two looks at its memory.
        if reply.kind == "memory" or reply.peak_bytes > self._at_rest + NEARLY * limit:
            beyond = " beyond what it had when it was loaded" if self._at_rest else ""
            return "memory", f"more than {limit / 2**20:.0f} MiB{beyond}"
        return "crash", f"its process ended: {description}"

    def _start(self) -> WatchedProcess:
        """Start the process.

        Raises:
            ScenarioError: It does not start, or it stays and does not say that it is ready.
        """
        words = self._command
        for name, path in self._paths.items():
            words = [word.replace(f"{{{name}}}", path) for word in words]
        target, log = self._estimator.target, self._folder / "printed"
        try:
            if not self._estimator.program:
                # The estimator may have removed its own folder.
                self._working_folder.mkdir(parents=True, exist_ok=True)
            process = WatchedProcess(words, self._working_folder, log, talks=self._stays, environment=self._environment)
        except OSError as error:
            raise ScenarioError(f"cannot start {target!r}: {error.strerror}") from error
        self._process = process
        if self._stays:
            self._wait_until_ready(process)
        return process

    def _wait_until_ready(self, process: WatchedProcess) -> None:
        target = self._estimator.target
        reply = process.exchange("", ("ready", "error"), seconds=STARTING, memory_bytes=float("inf"))
        if reply.why == READY:
            if not self._estimator.program:
                # The limit of a function is beyond what its libraries take, which it cannot help.
                self._at_rest = process.memory()
                process.limit_data(self._limits.memory_bytes)
            return
        code, _ = self._end(process)
        why = one_line(reply.why.removeprefix("error "))
        if not why and reply.kind == "hang":
            why = f"not ready within {STARTING:g} s"
        elif not why:
            why = self._description_of_end(code, process)
        if self._estimator.program:
            raise ScenarioError(
                f"{target!r}: {why}; expected a program that stays to print the line {READY!r} within {STARTING:g} s "
                "and then to read a line of JSON for each record"
            )
        raise ScenarioError(f"cannot load {target!r} of {self._estimator.name!r} from {str(self._home)!r}: {why}")

    def _end(self, process: WatchedProcess) -> tuple[int, float]:
        """Kill the process; its exit code and processor time."""
        self._process = None
        return process.kill()

    def _description_of_end(self, code: int, process: WatchedProcess) -> str:
        """Exit code or signal, and the end of what it printed."""
        end = f"exit code {code}"
        if code < 0:
            names = {int(member): member.name for member in signal.Signals}
            end = f"signal {names.get(-code, -code)}"
        printed = self._printed(process)
        return f"{end}; it printed {printed!r}" if printed else end

    def _printed(self, process: WatchedProcess) -> str:
        return self._printable(process.printed())[-LONGEST_REASON:]

    def _printable(self, reason: str) -> str:
        """A reason in one line, placeholders for paths: reasons of different requests are counted together."""
        for name, path in (*self._paths.items(), ("folder", str(self._folder))):
            # Some programs resolve links, and the folder of temporary files may be one.
            for spelling in (os.path.realpath(path), path):
                reason = reason.replace(spelling, f"{{{name}}}")
        return one_line(reason)


def _reported_seconds(text: str, measured: float) -> float:
    """Processor time that a program that stays may report behind its word, s; the measured one where it is none."""
    with suppress(ValueError):
        reported = float(text)
        if 0.0 <= reported < float("inf"):
            return reported
    return measured


def _with_model(outcome: EstimatorOutcome, folder: Path, data: IOData, task: Task) -> EstimatorOutcome:
    """The outcome with the model that its estimator wrote, or with the reason why it is none."""
    try:
        with np.errstate(all="ignore"):
            answer = answer_of(read_model(folder), data, task)
            why = unstable(answer.model)
    except NoModelError as error:
        return replace(outcome, kind=error.kind, why=str(error))
    # Numbers of any size in matrices of any kind: LAPACK may fail in ways that no check foresees.
    except (ArithmeticError, ValueError) as error:
        return replace(outcome, kind="malformed", why=f"no model can be made of the numbers: {error}")
    kind = "unstable" if why else MODEL
    return replace(outcome, kind=kind, why=why, answer=answer)


def program_words(estimator: Estimator, home: Path) -> list[str]:
    """Command line of a program in words, with the path of the program; ScenarioError where it cannot run."""
    line = estimator.target
    try:
        words = shlex.split(line)
    except ValueError as error:
        raise ScenarioError(f"command {line!r} cannot be split into words: {error}") from error
    placeholders = ", ".join(f"{{{name}}}" for name in FORMATS)
    if not words or "{model}" not in line or not any(f"{{{name}}}" in line for name in FORMATS):
        raise ScenarioError(
            f"command {line!r} given, expected one of {placeholders} where it reads "
            "the record, {model} where it writes its model, and {task} where it reads the task, if it does"
        )
    # A program with a folder in its name is looked for from home, as a shell there would.
    file_name = str(home / words[0]) if "/" in words[0] else words[0]
    program = shutil.which(file_name)
    if program is None:
        raise ScenarioError(f"no program {words[0]!r} for {estimator.name!r}, neither in {str(home)!r} nor on the path")
    return [program, *words[1:]]
