"""Estimators of every kind of behaviour, for the sandbox."""

import os
import signal
import subprocess
import sys
import time

import numpy as np

import sysid
from scenarios.estimators.answer import Answer

GOOD = sysid.StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], None, 0.02)


def by_seed(data, task):
    """Does what the seed of the task names."""
    return BEHAVIOURS[task.seed](data, task)


def arx(data, task):
    print("as estimators do", file=sys.stderr)
    return sysid.arx(data, 1, 1, 1)


def refuses(data, task):
    raise NotImplementedError("only on Sundays")


def raises(data, task):
    raise ZeroDivisionError("by zero")


def raises_in_a_library(data, task):
    sysid.arx(data, 0, 0, -1)


def raises_colours(data, task):
    raise ValueError("two\nlines\x1b[31m")


def leaves(data, task):
    sys.exit(3)


class SilentError(Exception):
    def __str__(self):
        raise KeyError("no words")


def raises_without_words(data, task):
    raise SilentError


def none(data, task):
    return None


def wrong_dt(data, task):
    return sysid.StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], None, 1.0)


def two_inputs(data, task):
    return sysid.StateSpace([[0.5]], [[1.0, 2.0]], [[1.0]], [[0.0, 0.0]], None, 0.02)


def unstable(data, task):
    return sysid.StateSpace([[1.01]], [[1.0]], [[1.0]], [[0.0]], None, 0.02)


class Hollow:
    """Poses as an array and fails when it is looked at."""

    def __array__(self, dtype=None, copy=None):
        raise KeyboardInterrupt


def hollow(data, task):
    return Answer(GOOD, response_covariance=Hollow())


def nan_covariance(data, task):
    return Answer(GOOD, response_covariance=np.full((len(task.frequencies), 1, 1, 2, 2), np.nan))


def negative_covariance(data, task):
    return sysid.Polynomials(B=[0.0, 1.0], F=[1.0, -0.5]), np.diag([1.0, -1.0])


def asks_for_much(data, task):
    return np.ones(2**31)


def floods(data, task):
    for _ in range(200):
        os.write(1, b"x" * 10000)
    return GOOD


def forks_and_answers(data, task):
    if os.fork() == 0:
        os.setsid()
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        time.sleep(1000.0)
    return GOOD


def answers_twice(data, task):
    os.fork()
    return GOOD


def deletes_its_folder(data, task):
    os.rmdir(os.getcwd())
    return GOOD


def dies(data, task):
    print("last words", flush=True)
    os._exit(5)


def hangs(data, task):
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    # Out of its session, and without the environment by which it would be known.
    subprocess.Popen([sys.executable, "-S", "-c", "import time; time.sleep(1000)"], env={}, start_new_session=True)
    while True:
        time.sleep(0.1)


def writes_garbage(data, task):
    for end in range(3, 64):
        try:
            os.write(end, b"garbage")
        except OSError:
            continue
    time.sleep(1000.0)


def closes_everything(data, task):
    os.closerange(0, 256)
    time.sleep(1000.0)


def ends_its_parent(data, task):
    os.kill(os.getppid(), signal.SIGKILL)
    time.sleep(0.1)
    os._exit(1)


def shares_much(data, task):
    import mmap

    held = mmap.mmap(-1, 2**28)
    for at in range(0, len(held), 4096):
        held[at] = 1
    time.sleep(1000.0)


def hides_its_time(data, task):
    ours = sys.modules["__main__"]
    now = ours.processor_seconds()
    ours.processor_seconds = lambda: now
    until = time.process_time() + 0.5
    while time.process_time() < until:
        pass
    return GOOD


BEHAVIOURS = (
    *(
        arx,
        refuses,
        raises,
        raises_in_a_library,
        raises_colours,
        leaves,
        raises_without_words,
        none,
        wrong_dt,
        two_inputs,
        unstable,
        hollow,
    ),
    *(nan_covariance, negative_covariance, asks_for_much, floods, forks_and_answers, answers_twice, deletes_its_folder),
    *(hides_its_time, dies, hangs, writes_garbage, closes_everything, shares_much, ends_its_parent),
)
