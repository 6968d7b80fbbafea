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
from scenarios.estimators.process import Reply, WatchedProcess
from scenarios.estimators.request_files import FORMATS, paths, read_model, write_request
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

GRACE = 0.5
"""Time that a process has to end after it has closed its output, s."""

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
        self._home = Path(estimator.home or ".").resolve()
        self._process: WatchedProcess | None = None
        self._at_rest = 0
        self._folder = Path()
        self._command: list[str] = []
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
        else:
            # -P: the working folder is not on the path, so that files there hide no package of the bench.
            child = [sys.executable, "-P", "-m", "scenarios.estimators.python_child"]
            self._command = [*child, self._estimator.target, str(self._home), str(self._limits.memory_bytes)]
        try:
            self._folder = Path(tempfile.mkdtemp(prefix="hmtb-estimator-"))
        except OSError as error:
            raise ScenarioError(f"cannot make a temporary folder for an estimator: {error}") from error
        self._paths = paths(self._folder / "request", self._formats)
        try:
            if self._stays:
                self._start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        """Kill its processes and remove its files."""
        self._end()
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
        if outcome.kind == MODEL:
            outcome = _with_model(outcome, folder, data, task)
        return replace(outcome, why=self._with_placeholders(outcome.why))

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
        if reply.end == "line":
            word, _, why = reply.line.partition(" ")
            why = one_line(self._with_placeholders(why))[:LONGEST_REASON]
        else:
            code, seconds_with_children = _kill(process, reply)
            if reply.end == "exit" and code >= 0 and not self._stays:
                word, why = self._result_of_program(code, process)
                seconds = seconds_with_children
            else:
                word, why = self._reason_of_end(reply, code, process)
        if reply.end != "line" or word == "memory":
            # After a MemoryError what it still holds would count against the next answer.
            self._end()
        if word != "done":
            return EstimatorOutcome(word, why, seconds, reply.wall, reply.peak_bytes)
        # A program that stays may report its own processor time behind the word.
        with suppress(ValueError):
            seconds = float(why)
        return EstimatorOutcome(MODEL, "", seconds, reply.wall, reply.peak_bytes)

    def _result_of_program(self, code: int, process: WatchedProcess) -> tuple[str, str]:
        """Word and reason for a program that is started for each request and ended by itself."""
        if code == REFUSES:
            return REFUSED, self._printed(process)
        word = "error" if code else "done"
        return word, self._description_of_end(code, process)

    def _reason_of_end(self, reply: Reply, code: int, process: WatchedProcess) -> tuple[str, str]:
        """Kind and reason of a failure that ended the process."""
        limit = self._limits.memory_bytes
        if reply.end == "hang":
            return "hang", f"no answer within {self._limits.seconds:g} s"
        # The kernel, or the process itself, may end it between two looks at its memory.
        if reply.end == "memory" or reply.peak_bytes > self._at_rest + NEARLY * limit:
            beyond = " beyond what it had when it was loaded" if self._at_rest else ""
            return "memory", f"more than {limit / 2**20:.0f} MiB{beyond}"
        return "crash", f"its process ended: {self._description_of_end(code, process)}"

    def _start(self) -> WatchedProcess:
        """Start the process.

        Raises:
            ScenarioError: It does not start, or it stays and does not say that it is ready.
        """
        words = self._command
        for name, path in self._paths.items():
            words = [word.replace(f"{{{name}}}", path) for word in words]
        folder, environment = self._home, {}
        if not self._estimator.program:
            # A folder of its own: estimators write files, and import what lies in the working folder.
            folder = self._folder / "work"
            folder.mkdir(exist_ok=True)
            # The child finds the packages that this process finds.
            environment = {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        target, log = self._estimator.target, self._folder / "printed"
        try:
            process = WatchedProcess(words, folder, log, talks=self._stays, environment=environment)
        except OSError as error:
            raise ScenarioError(f"cannot start {target!r}: {error.strerror}") from error
        self._process = process
        if not self._stays:
            return process
        reply = process.exchange("", ("ready", "error"), seconds=STARTING, memory_bytes=float("inf"))
        if reply.line == READY:
            # The limit of a function is beyond what its libraries take, which it cannot help.
            self._at_rest = 0 if self._estimator.program else process.memory()
            return process
        code, _ = _kill(process, reply)
        self._process = None
        why = one_line(reply.line.removeprefix("error "))
        if not why and reply.end == "hang":
            why = f"not ready within {STARTING:g} s"
        elif not why:
            why = self._description_of_end(code, process)
        if self._estimator.program:
            raise ScenarioError(
                f"{target!r}: {why}; expected a program that stays to print the line {READY!r} within {STARTING:g} s "
                "and then to read a line of JSON for each record"
            )
        raise ScenarioError(f"cannot load {target!r} of {self._estimator.name!r} from {str(self._home)!r}: {why}")

    def _description_of_end(self, code: int, process: WatchedProcess) -> str:
        """Exit code or signal, and the end of what it printed."""
        end = f"exit code {code}"
        if code < 0:
            names = {int(member): member.name for member in signal.Signals}
            end = f"signal {names.get(-code, -code)}"
        printed = self._printed(process)
        return f"{end}; it printed {printed!r}" if printed else end

    def _printed(self, process: WatchedProcess) -> str:
        return one_line(self._with_placeholders(process.printed()))[-LONGEST_REASON:]

    def _with_placeholders(self, reason: str) -> str:
        """A reason with placeholders for paths: reasons of different requests are counted together."""
        for name, path in (*self._paths.items(), ("folder", str(self._folder))):
            # Some programs resolve links, and the folder of temporary files may be one.
            for spelling in (os.path.realpath(path), path):
                reason = reason.replace(spelling, f"{{{name}}}")
        return reason

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()


def _kill(process: WatchedProcess, reply: Reply) -> tuple[int, float]:
    """Kill a process; one that has closed its output may be about to end with a code of its own."""
    grace = GRACE if reply.end == "exit" else 0.0
    return process.kill(grace)


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
    if not home.is_dir():
        raise ScenarioError(f"no folder {str(home)!r}, which is given for {estimator.name!r}")
    # A program with a folder in its name is looked for from home, as a shell there would.
    file_name = str(home / words[0]) if "/" in words[0] else words[0]
    program = shutil.which(file_name)
    if program is None:
        raise ScenarioError(f"no program {words[0]!r} for {estimator.name!r}, neither in {str(home)!r} nor on the path")
    return [program, *words[1:]]
