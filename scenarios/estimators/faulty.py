"""Estimators that are wrong on purpose, each in one way: the bench is shown to catch them.

All are the prediction-error fit of this package, to which one thing is done. They are written as anyone writes an
estimator: a function from a record and a task to an answer.
"""

import os
import signal
import time
from dataclasses import replace

import control
import numpy as np

from scenarios.estimators.answer import Answer
from scenarios.estimators.changed_answers import changed_claim, delayed_input, scaled_gain, wandering
from scenarios.estimators.estimates import answer_of
from scenarios.estimators.ours import pem, prediction_error
from scenarios.estimators.reference_time import Ruler
from scenarios.estimators.task import Task
from sysid import IOData, StateSpace
from sysid.records.arrays import FloatArray

COVARIANCE_FACTOR = 2.0
"""How far from the truth a wrong covariance is."""

GAIN = 1.02
"""Of the biased one."""

VARIANCE = 1.5
"""Of the inefficient one, as a multiple of the best."""

SHARE = 1.0 / 50.0
"""How often the unreliable ones fail."""

SLOWNESS, LONGEST = 1800.0, 10.0
"""Processor time of the slow one, in rulers of the test bench, half as much again as is called slow; and at most, s."""

OUTSIDE = 1.05
"""Modulus of the largest pole of an unstable model."""

APPETITE, BITE = 8 * 2**30, 2**28
"""Memory that the hungry one takes, and at a time, bytes."""


def delayed(data: IOData, task: Task) -> Answer:
    """It counts the delay from zero: its model answers one sample late."""
    return delayed_input(pem(data, task))


def overconfident(data: IOData, task: Task) -> Answer:
    """It claims half of the covariance."""
    return changed_claim(pem(data, task), 1.0 / COVARIANCE_FACTOR)


def underconfident(data: IOData, task: Task) -> Answer:
    """It claims twice the covariance."""
    return changed_claim(pem(data, task), COVARIANCE_FACTOR)


def biased(data: IOData, task: Task) -> Answer:
    """Its gain is 2 % too high."""
    return scaled_gain(pem(data, task), GAIN)


def inefficient(data: IOData, task: Task) -> Answer:
    """Its variance is 1.5 times the best, and it says so."""
    rng = np.random.default_rng([task.seed, 1])
    estimate = wandering(prediction_error(data, task), VARIANCE - 1.0, rng)
    return changed_claim(answer_of(estimate, task), VARIANCE)


def unstable(data: IOData, task: Task) -> Answer:
    """One model in fifty has a pole outside the unit circle."""
    answer = pem(data, task)
    if not _strikes(task):
        return answer
    radius = float(np.abs(answer.model.input_path().poles()).max(initial=0.0))
    A = answer.model.A * (OUTSIDE / radius) if radius else OUTSIDE * np.eye(answer.model.order)
    return Answer(replace(answer.model, A=A, K=None))


def slow(data: IOData, task: Task) -> Answer:
    """It repeats its fit as often as 1800 rulers allow, to no end; every answer comes well before its limit of time."""
    begun = time.process_time()
    answer = pem(data, task)
    if task.chooses:
        return answer
    ruler = Ruler(data)
    ruler.measure()
    until = begun + min(SLOWNESS * ruler.seconds, LONGEST)
    while time.process_time() < until:
        answer = pem(data, task)
    return answer


def crashing(data: IOData, task: Task) -> Answer:
    """One fit in fifty ends its process, as a fault in compiled code does."""
    if _strikes(task):
        os.kill(os.getpid(), signal.SIGSEGV)
    return pem(data, task)


def hungry(data: IOData, task: Task) -> Answer:
    """One fit in fifty takes 8 GB, piece by piece."""
    if _strikes(task):
        taken = [_bite() for _ in range(APPETITE // BITE)]
        del taken
    return pem(data, task)


def hanging(data: IOData, task: Task) -> Answer:
    """One fit in fifty never ends."""
    while _strikes(task):
        time.sleep(1.0)
    return pem(data, task)


def absent_minded(data: IOData, task: Task) -> Answer | control.StateSpace:
    """One model in fifty is NaN; a type that refuses NaN would not let it."""
    answer = pem(data, task)
    if not _strikes(task):
        return answer
    m: StateSpace = answer.model
    return control.ss(np.full_like(m.A, np.nan), m.B, m.C, m.D, m.dt)


def _bite() -> FloatArray:
    return np.ones(BITE // 8)


def _strikes(task: Task) -> bool:
    """Whether this is one of the fits that fail: a draw of the task's own seed."""
    return bool(np.random.default_rng([task.seed, 2]).random() < SHARE)
