"""Estimators that are wrong on purpose, each in one way: tests and benchmarks show that the bench catches them.

All are the toolbox's prediction-error fit, to which one thing is done. They are written as anyone writes an estimator:
a function from a record and a task to an answer.
"""

import os
import signal
import time
from dataclasses import replace

import control
import numpy as np

from scenarios.estimators.estimator import Estimator
from scenarios.estimators.ours import pem, prediction_error
from scenarios.estimators.outcome import Answer
from scenarios.estimators.reference_time import Ruler
from scenarios.estimators.returned import estimate_answer
from scenarios.files.errors import ScenarioError
from sysid import StateSpace
from sysid.models import add_delay, innovations_form
from sysid.models.delta_method import standard_directions
from sysid.polynomial.polynomial_estimate import Realise


def delayed(data, task):
    """It counts the delay from zero: its model answers one sample late."""
    answer = pem(data, task)
    if answer.polynomials is None:
        return replace(answer, model=add_delay(answer.model, 1))
    b = np.atleast_2d(answer.polynomials.B)
    late = np.hstack((np.zeros((len(b), 1)), b)).reshape((*answer.polynomials.B.shape[:-1], -1))
    return _with_polynomials(answer, replace(answer.polynomials, B=late))


def overconfident(data, task):
    """It claims half of the covariance."""
    return changed_claim(pem(data, task), 0.5)


def underconfident(data, task):
    """It claims twice the covariance."""
    return changed_claim(pem(data, task), 2.0)


def biased(data, task):
    """Its gain is 2 % too high."""
    answer = pem(data, task)
    if answer.polynomials is None:
        return replace(answer, model=replace(answer.model, B=1.02 * answer.model.B, D=1.02 * answer.model.D))
    return _with_polynomials(answer, replace(answer.polynomials, B=1.02 * answer.polynomials.B))


def inefficient(data, task):
    """Its variance is 1.5 times the best, and it says so."""
    rng, estimate = np.random.default_rng([task.seed, 1]), prediction_error(data, task)
    directions, realise = standard_directions(0.5 * estimate.covariance), estimate.realise
    for _ in range(100):
        theta = estimate.parameters + directions @ rng.standard_normal(len(estimate.parameters))
        model = realise(theta)
        if model.input_path().is_stable():
            polynomials = realise.orders.polynomials(theta) if isinstance(realise, Realise) else None
            wrong = replace(estimate, parameters=theta, model=model, polynomials=polynomials)
            return changed_claim(estimate_answer(wrong, task), 1.5)
    raise ScenarioError("100 errors drawn, none leaves a stable model")


def unstable(data, task):
    """One model in fifty has a pole outside the unit circle."""
    answer = pem(data, task)
    if not _strikes(task):
        return answer
    radius = float(np.abs(answer.model.input_path().poles()).max(initial=0.0))
    A = answer.model.A * (1.05 / radius) if radius else 1.05 * np.eye(answer.model.order)
    return Answer(replace(answer.model, A=A, K=None))


def slow(data, task):
    """It repeats its fit as often as 1800 rulers allow, to no end; every answer comes well before its limit of time."""
    begun = time.process_time()
    answer = pem(data, task)
    if task.chooses:
        return answer
    ruler = Ruler(data)
    ruler.measure()
    # Rulers of processor time, half as many again as are called slow.
    until = begun + min(1800.0 * ruler.seconds, 10.0)
    while time.process_time() < until:
        answer = pem(data, task)
    return answer


def crashing(data, task):
    """One fit in fifty ends its process, as a fault in compiled code does."""
    if _strikes(task):
        os.kill(os.getpid(), signal.SIGSEGV)
    return pem(data, task)


def hungry(data, task):
    """One fit in fifty takes 8 GB, piece by piece."""
    if _strikes(task):
        taken = [np.ones(2**25) for _ in range(2**5)]
        del taken
    return pem(data, task)


def hanging(data, task):
    """One fit in fifty never ends."""
    while _strikes(task):
        time.sleep(1.0)
    return pem(data, task)


def absent_minded(data, task):
    """One model in fifty is NaN; a type that refuses NaN would not let it."""
    answer = pem(data, task)
    if not _strikes(task):
        return answer
    m: StateSpace = answer.model
    return control.ss(np.full_like(m.A, np.nan), m.B, m.C, m.D, m.dt)


def _strikes(task):
    """Whether this is one of the fits that fail: a draw of the task's own seed."""
    return bool(np.random.default_rng([task.seed, 2]).random() < 1.0 / 50.0)


def changed_claim(answer, factor):
    """All claimed covariances times a factor, intervals with them; the model is left alone."""
    interval = answer.bandwidth_ci95
    if interval is not None:
        hz = answer.model.bandwidth()
        # It is symmetric on a logarithmic scale, and NaN where there is no bandwidth.
        with np.errstate(divide="ignore", invalid="ignore"):
            interval = tuple(np.asarray(hz * (end / hz) ** np.sqrt(factor)) for end in interval)
    return replace(
        answer,
        covariance=None if answer.covariance is None else factor * answer.covariance,
        response_covariance=None if answer.response_covariance is None else factor * answer.response_covariance,
        bandwidth_ci95=interval,
    )


def _with_polynomials(answer, polynomials):
    model = innovations_form(polynomials, answer.model.dt, answer.model.innovation_covariance)
    return replace(answer, model=model, polynomials=polynomials)


def _estimator(function):
    name, fault = function.__name__, function.__doc__
    target = f"tests.benchmarks.faulty_estimators:{name}"
    return Estimator(name.replace("_", "-"), target, method="pem", settings=f"wrong on purpose: {fault}")


FAULTS = (delayed, overconfident, underconfident, biased, inefficient, unstable, slow, crashing, hungry, hanging)
FAULTY = {estimator.name: estimator for estimator in map(_estimator, (*FAULTS, absent_minded))}
"""The planted faults by name."""
