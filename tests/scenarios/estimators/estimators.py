"""Estimators of every kind of behaviour, for the runner."""

import os
import subprocess
import sys
import time

import numpy as np

import sysid

GOOD = sysid.StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], None, 0.02)


def by_seed(data, task):
    """Does what the seed of the task names."""
    return list(BEHAVIOURS)[task.seed](data, task)


def arx(data, task):
    print("done, as estimators print")
    return sysid.arx(data, 1, 1, 1)


def refuses(data, task):
    raise NotImplementedError("only on Sundays")


def raises(data, task):
    raise ValueError("two\nlines\x1b[31m")


def raises_in_a_library(data, task):
    sysid.arx(data, 0, 0, -1)


def leaves(data, task):
    sys.exit(3)


def none(data, task):
    return None


def unstable(data, task):
    return sysid.StateSpace([[1.01]], [[1.0]], [[1.0]], [[0.0]], None, 0.02)


def nan_covariance(data, task):
    return GOOD, np.full((len(task.frequencies), 1, 1, 2, 2), np.nan)


def asks_for_much(data, task):
    return np.ones(2**31)


def floods(data, task):
    for _ in range(200):
        os.write(1, b"x" * 10000)
    return GOOD


def cannot_be_printed(data, task):
    class SilentError(Exception):
        def __str__(self):
            raise RuntimeError

    raise SilentError


def surrogate(data, task):
    raise ValueError("\ud800")


def names(data, task):
    """Answers only where nothing tells the problem."""
    assert (data.name, data.input_names, data.output_names, data.input_units) == ("", ("u1",), ("y1",), ("",))
    return GOOD


def leaves_a_process(data, task):
    subprocess.Popen(["sleep", "1000.125"], start_new_session=True)
    return GOOD


def dies(data, task):
    print("last words", flush=True)
    os._exit(5)


def hangs(data, task):
    subprocess.Popen(["sleep", "1000.125"])
    while True:
        time.sleep(0.1)


def child_takes_memory(data, task):
    eats = "import time; held = b'1' * 2**28; time.sleep(99)"
    subprocess.run([sys.executable, "-S", "-c", eats])


BEHAVIOURS = {
    arx: ("model", ""),
    refuses: ("refused", "only on Sundays (estimators.py, line"),
    raises: ("error", "ValueError: two lines\N{REPLACEMENT CHARACTER}[31m (estimators.py, "),
    raises_in_a_library: ("error", "(estimators.py, line "),
    leaves: ("error", "SystemExit: 3"),
    cannot_be_printed: ("error", "SilentError: its text cannot be printed"),
    surrogate: ("error", "ValueError: "),
    none: ("malformed", "NoneType given, expected Answer"),
    unstable: ("unstable", "the largest at 1.01"),
    nan_covariance: ("not_finite", "response_covariance has 12 of 12"),
    asks_for_much: ("memory", "MemoryError"),
    floods: ("model", ""),
    names: ("model", ""),
    leaves_a_process: ("model", ""),
    dies: ("crash", "exit code 5; it printed 'last words'"),
    hangs: ("hang", "no answer within 5 s"),
    child_takes_memory: ("memory", "more than 128 MiB beyond"),
}
"""Kind of the outcome of each, and its reason."""
