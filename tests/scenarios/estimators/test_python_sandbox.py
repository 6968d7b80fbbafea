"""What a function does is an outcome, and nothing is left running."""

import os
import re
import sys
import types
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sysid
from scenarios.estimators import process_tree
from scenarios.estimators.contestant import Contestant, Limits
from scenarios.estimators.outcome import Outcome
from scenarios.estimators.python_child import load
from scenarios.estimators.python_sandbox import PythonSandbox
from scenarios.estimators.sandbox import open_sandbox
from scenarios.estimators.task import Task
from scenarios.files.errors import ScenarioError
from tests.scenarios.estimators.estimators import BEHAVIOURS

HERE = Path(__file__).parent
EXPECTED = {
    "arx": ("model", ""),
    "refuses": ("refused", "only on Sundays (estimators.py, line"),
    "raises": ("error", "ZeroDivisionError: by zero (estimators.py, line"),
    "leaves": ("error", "SystemExit: 3"),
    "raises_in_a_library": ("error", "(estimators.py, line "),
    "raises_colours": ("error", "ValueError: two lines\N{REPLACEMENT CHARACTER}[31m (estimators.py, "),
    "raises_without_words": ("error", "cannot say"),
    "none": ("malformed", "NoneType given, expected Answer"),
    "wrong_dt": ("malformed", "dt = 1 given"),
    "two_inputs": ("malformed", "B of shape (1, 2) given, expected (1, 1)"),
    "unstable": ("unstable", "the largest at 1.01"),
    "hollow": ("malformed", "what it returned cannot be read: KeyboardInterrupt"),
    "nan_covariance": ("not_finite", "response_covariance has 12 of 12"),
    "negative_covariance": ("malformed", "covariance has a negative eigenvalue"),
    "asks_for_much": ("memory", "MemoryError"),
    "floods": ("model", ""),
    "forks_and_answers": ("model", ""),
    "answers_twice": ("model", ""),
    "deletes_its_folder": ("model", ""),
    "hides_its_time": ("model", ""),
    "dies": ("crash", "exit code 5; it printed 'last words'"),
    "hangs": ("hang", "no answer within 2 s"),
    "writes_garbage": ("malformed", "something else than an answer"),
    "closes_everything": ("crash", "its process ended"),
    "ends_its_parent": ("crash", "nobody saw how"),
    "shares_much": ("memory", "more than 128 MiB"),
}


@pytest.mark.slow
def test_whatever_it_does_is_an_outcome_and_nothing_is_left(data: sysid.IOData, task: Task) -> None:
    before = {pid for pid in process_tree._pids() if process_tree._read(pid, "cmdline")}
    open_files = len(os.listdir("/proc/self/fd"))
    contestant = Contestant("any", "estimators.py:by_seed", home=str(HERE))
    with (
        open_sandbox(contestant, Limits(seconds=2.0, memory_bytes=2**27)) as sandbox,
        open_sandbox(replace(contestant, name="beside"), Limits()) as beside,
    ):
        process = beside._process
        for number, behaviour in enumerate(BEHAVIOURS):
            kind, why = EXPECTED[behaviour.__name__]
            got = sandbox.ask(data, replace(task, seed=number))
            assert (got.kind, why in got.why) == (kind, True), f"{behaviour.__name__}: {got}"
            assert (got.answer is not None) == (kind in ("model", "unstable"))
            assert got.wall < 10.0
            assert got.seconds > 0.4 or behaviour.__name__ != "hides_its_time"
            # What becomes of one is nothing to the other, unless it ends what both come from.
            assert beside._process is process and (process.alive or behaviour.__name__ == "ends_its_parent")
        assert beside.ask(data, replace(task, seed=0)).kind == "model"
        check_direct(sandbox.ask(data, replace(task, seed=0)), data, task)
        folder = sandbox._home.path
    assert not folder.exists() and len(os.listdir("/proc/self/fd")) == open_files
    # Processes of others may have begun meanwhile; ours would say so or be our children.
    left = [pid for pid in process_tree.family(os.getpid()) if pid not in before and pid != os.getpid()]
    left += [pid for pid in process_tree._pids() if b"time.sleep(1000)" in process_tree._read(pid, "cmdline")]
    assert not left


def check_direct(got: Outcome, data: sysid.IOData, task: Task) -> None:
    """An answer is that of a direct call, to the last bit, with covariances and intervals; time and memory are told."""
    direct = sysid.arx(data, 1, 1, 1)
    assert got.answer is not None
    for name in ("A", "B", "C", "D", "K", "innovation_covariance"):
        np.testing.assert_array_equal(getattr(got.answer.model, name), getattr(direct.model, name))
    np.testing.assert_array_equal(got.answer.covariance, direct.covariance)
    np.testing.assert_array_equal(
        got.answer.response_covariance, direct.frequency_response(task.frequencies).covariance
    )
    np.testing.assert_array_equal(got.answer.bandwidth_ci95, direct.bandwidth().ci95)
    assert 0.0 < got.seconds < 10.0 and got.peak_bytes > 2**20


def test_what_cannot_be_loaded_is_said_at_once() -> None:
    contestant = Contestant("none", "no_such_package:f", home=str(HERE))
    with (
        pytest.raises(ScenarioError, match=r"cannot load 'no_such_package:f' of 'none' .* No module named"),
        PythonSandbox(contestant, Limits()),
    ):
        raise AssertionError("it opened")


@pytest.mark.parametrize(
    ("target", "why"),
    [
        ("estimators.py:arxx", "has no 'arxx'; it has Hollow, "),
        ("estimators.py:BEHAVIOURS", "is of type tuple, expected a function"),
        ("estimator.py:arx", "no file "),
        ("estimators.py", "expected module:function or path/to/file.py:function"),
    ],
)
def test_a_target_that_is_no_function_is_named(target: str, why: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setitem(sys.modules, "estimators", types.ModuleType("estimators"))
    with pytest.raises(ImportError, match=re.escape(why)):
        load(target, HERE)
    assert load("estimators.py:SilentError.__str__", HERE).__name__ == "__str__"
