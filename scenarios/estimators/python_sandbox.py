"""A Python estimator in a process of its own, which stays from one request to the next as long as it behaves."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from scenarios.estimators import process_tree
from scenarios.estimators.contestant import Contestant, Limits
from scenarios.estimators.model_numbers import answer_of, unstable
from scenarios.estimators.no_model import NoModelError
from scenarios.estimators.nursery import SHARED, Nursery
from scenarios.estimators.outcome import KINDS, MODEL, Outcome
from scenarios.estimators.own_folder import OwnFolder
from scenarios.estimators.record_on_wire import request
from scenarios.estimators.supervised import Exchange, Supervised
from scenarios.estimators.task import Task
from scenarios.estimators.wire import WireError, complete, pack, unpack
from scenarios.files.errors import ScenarioError
from scenarios.files.printable import one_line
from sysid import IOData
from sysid.records.arrays import FloatArray

LOADING = 120.0
"""How long loading a module may take, s."""

NEARLY = 0.9
"""A process that died with this part of its memory in use died of that."""

MOST_MEMORY = 2**60
"""No process has more, bytes."""

UNSEEN = 0.25
"""Processor time that an answer may take beyond twice what its own process says, s: to read and to write it."""

GRACE = 0.5
"""How long a process may take to end after it has closed its pipe, s."""


class PythonSandbox:
    """A process that calls a function.

    Args:
        contestant: The estimator; its target is a function.
        limits: What it may use for one answer.
    """

    def __init__(self, contestant: Contestant, limits: Limits) -> None:
        self._contestant, self._limits = contestant, limits
        self._process: Supervised | None = None
        self._nursery: Nursery | None = None
        self._home, self._asked = OwnFolder(), 0
        self._at_rest = 0

    def __enter__(self) -> "PythonSandbox":
        # Its working folder is its own: some delete what they find there.
        self._home.make()
        SHARED.enter()
        try:
            self._start()
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def ask(self, data: IOData, task: Task) -> Outcome:
        """Ask once; see `open_sandbox`."""
        if self._nursery is not None and not self._nursery.alive:
            # Some estimator has ended it: no fault of this one.
            self._end()
        if self._process is None:
            try:
                self._start()
            except ScenarioError as error:
                return Outcome("crash", str(error))
        process = self._process
        if process is None:
            raise ScenarioError("the sandbox is closed")
        process.forget_tail()
        got = process.exchange(
            pack(*request(data, task)),
            complete,
            seconds=self._limits.seconds,
            memory_bytes=self._at_rest + self._limits.memory_bytes,
        )
        if got.end != "answered":
            return self._lost(process, got)
        try:
            fields, numbers = unpack(got.reply)
            told = _told(fields)
        except WireError as error:
            return self._lost(process, replace(got, end="garbage", why=str(error)))
        if told["kind"] == "memory":
            # What it holds on to would count against the next answer.
            self._end()
        if got.seconds > 2.0 * told["seconds"] + UNSEEN:
            # Its own word leaves out what others of its processes did, or is not true.
            told["seconds"] = got.seconds
        return outcome_of(told, numbers, data, task, peak_bytes=got.peak_bytes)

    def _start(self) -> None:
        """Start the process and load the function.

        Raises:
            ScenarioError: The function cannot be loaded.
        """
        contestant = self._contestant
        home = Path(contestant.home or ".").resolve()
        self._nursery = SHARED.get()
        self._asked += 1
        self._process = self._nursery.fork(self._home.new(str(self._asked)))
        fields = {"target": contestant.target, "home": str(home), "memory_bytes": self._limits.memory_bytes}
        got = self._process.exchange(pack(fields), complete, seconds=LOADING, memory_bytes=2**40)
        why = {
            "hang": f"loading it did not end within {LOADING:g} s",
            "garbage": "it wrote into the pipe of the bench while it was loaded",
        }.get(got.end, "")
        if got.end == "answered":
            try:
                told, _ = unpack(got.reply)
            except WireError as error:
                told = {"why": str(error)}
            if told.get("kind") == "ready":
                self._at_rest = process_tree.resident(process_tree.family(self._process.pid))
                return
            why = one_line(str(told.get("why")))
        tail = self._process.tail()
        self._process.end(GRACE)
        how = self._process.how_it_ended()
        self._end()
        raise ScenarioError(
            f"cannot load {contestant.target!r} of {contestant.name!r} from {str(home)!r}: "
            f"{why or f'its process ended, {how}; it printed {tail!r}'}; expected module:function or "
            "path/to/file.py:function that can be imported by the interpreter that runs the bench"
        )

    def _lost(self, process: Supervised, got: Exchange) -> Outcome:
        """The outcome of a request after which the process is of no use."""
        process.end(GRACE if got.end == "ended" else 0.0)
        kind, why = self._why(process, got)
        tail = process.tail()
        self._end()
        printed = f"; it printed {tail!r}" if tail and kind == "crash" else ""
        return Outcome(kind, why + printed, got.seconds, got.wall, got.peak_bytes)

    def _why(self, process: Supervised, got: Exchange) -> tuple[str, str]:
        limit = self._limits.memory_bytes
        if got.end == "hang":
            return "hang", f"no answer within {self._limits.seconds:g} s"
        if got.end == "memory" or got.peak_bytes > self._at_rest + NEARLY * limit:
            return "memory", f"more than {limit / 2**20:.0f} MiB beyond what it had when it was loaded"
        if got.end == "garbage":
            return "malformed", f"it wrote something else than an answer into the pipe of the bench: {got.why[:100]}"
        return "crash", f"its process ended: {process.how_it_ended()}"

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.end()

    def _close(self) -> None:
        self._end()
        SHARED.leave()
        self._home.remove()


def outcome_of(
    told: Mapping[str, Any], numbers: Mapping[str, FloatArray], data: IOData, task: Task, *, peak_bytes: int
) -> Outcome:
    """The outcome of an answer that came.

    Args:
        told: `kind` (`returned`, or how it failed), `why`, `seconds`, `wall`, `peak_bytes`.
        numbers: Of the model.
        data: What it was given.
        task: What it was asked.
        peak_bytes: The most memory that was seen from outside, bytes.
    """
    kind, why, answer = told["kind"], told["why"], None
    if kind == "returned":
        kind = MODEL
        try:
            with np.errstate(all="ignore"):
                answer = answer_of(numbers, data, task)
                why = unstable(answer.model)
            kind = "unstable" if why else MODEL
        except NoModelError as error:
            kind, why = error.kind, str(error)
        # Numbers of any size stand in matrices of any kind: what no check foresaw is still no model.
        except (ArithmeticError, ValueError) as error:
            kind, why = "malformed", f"no model can be made of it: {error}"
    return Outcome(kind, why, told["seconds"], told["wall"], max(peak_bytes, told["peak_bytes"]), answer)


def _told(fields: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a reply, checked: its process is not to be trusted.

    Raises:
        WireError: They are others.
    """
    wanted = {"kind": str, "why": str, "seconds": float, "wall": float, "peak_bytes": int}
    if set(fields) != set(wanted) or any(type(fields[name]) is not kind for name, kind in wanted.items()):
        raise WireError(f"a reply with {', '.join(map(str, fields))[:100]}")
    if fields["kind"] not in ("returned", *KINDS) or fields["kind"] in (MODEL, "unstable"):
        raise WireError(f"a reply of kind {fields['kind'][:50]!r}")
    if not (fields["seconds"] >= 0.0 and fields["wall"] >= 0.0 and 0 <= fields["peak_bytes"] <= MOST_MEMORY):
        raise WireError("a reply whose times or memory are negative or no numbers")
    return {**fields, "why": one_line(fields["why"])}
