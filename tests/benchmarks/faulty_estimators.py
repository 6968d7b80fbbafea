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
from scenarios.estimators.state_space_peers import delayed as delayed_model
from scenarios.estimators.task import Task
from scenarios.files.errors import ScenarioError
from sysid import Estimate, IOData, Polynomials, StateSpace
from sysid.models import innovations_form
from sysid.models.delta_method import standard_directions
from sysid.polynomial.polynomial_estimate import Realise
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
    return changed_claim(estimate_answer(estimate, task), VARIANCE)


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


ATTEMPTS = 100
"""Errors that are drawn at most until one leaves a stable model."""


def delayed_input(answer: Answer) -> Answer:
    """The same model and claims, the input one sample late."""
    if answer.polynomials is None:
        return replace(answer, model=delayed_model(answer.model, 1))
    b = np.atleast_2d(answer.polynomials.B)
    late = np.hstack((np.zeros((len(b), 1)), b)).reshape((*answer.polynomials.B.shape[:-1], -1))
    return _with_polynomials(answer, replace(answer.polynomials, B=late))


def scaled_gain(answer: Answer, factor: float) -> Answer:
    """The response from input to output times a factor."""
    if answer.polynomials is None:
        return replace(answer, model=replace(answer.model, B=factor * answer.model.B, D=factor * answer.model.D))
    return _with_polynomials(answer, replace(answer.polynomials, B=factor * answer.polynomials.B))


def changed_claim(answer: Answer, factor: float) -> Answer:
    """All claimed covariances times a factor, intervals with them; the model is left alone."""
    interval = answer.bandwidth_ci95
    if interval is not None:
        hz = answer.model.bandwidth()
        low, high = (_stretched(end, hz, np.sqrt(factor)) for end in interval)
        interval = (low, high)
    return replace(
        answer,
        covariance=None if answer.covariance is None else factor * answer.covariance,
        response_covariance=None if answer.response_covariance is None else factor * answer.response_covariance,
        bandwidth_ci95=interval,
    )


def wandering(estimate: Estimate, share: float, rng: np.random.Generator) -> Estimate:
    """The parameters with a normal error of so large a part of the claimed covariance; the claim is left alone.

    Args:
        estimate: With a covariance.
        share: Covariance of the error, as a multiple of the claimed one.
        rng: For the error.

    Raises:
        ScenarioError: No error leaves a stable model.
    """
    directions, realise = standard_directions(share * estimate.covariance), estimate.realise
    for _ in range(ATTEMPTS):
        theta = estimate.parameters + directions @ rng.standard_normal(len(estimate.parameters))
        model = realise(theta)
        if model.input_path().is_stable():
            polynomials = realise.orders.polynomials(theta) if isinstance(realise, Realise) else None
            return replace(estimate, parameters=theta, model=model, polynomials=polynomials)
    raise ScenarioError(f"{ATTEMPTS} errors drawn, none leaves a stable model")


def _with_polynomials(answer: Answer, polynomials: Polynomials) -> Answer:
    model = innovations_form(polynomials, answer.model.dt, answer.model.innovation_covariance)
    return replace(answer, model=model, polynomials=polynomials)


def _stretched(end: FloatArray, hz: FloatArray, factor: float) -> FloatArray:
    """An end of an interval that is symmetric on a logarithmic scale; NaN where there is no bandwidth."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(hz * (end / hz) ** factor)


def _estimator(name: str, fault: str) -> Estimator:
    target, settings = f"tests.benchmarks.faulty_estimators:{name}", f"wrong on purpose: {fault}"
    return Estimator(name.replace("_", "-"), target, method="pem", settings=settings)


FAULTY = {
    estimator.name: estimator
    for estimator in (
        _estimator("delayed", "its model answers one sample late"),
        _estimator("overconfident", "it claims half of its covariance"),
        _estimator("underconfident", "it claims twice its covariance"),
        _estimator("biased", "its gain is 2 % too high"),
        _estimator("inefficient", "its variance is 1.5 times the best, and it says so"),
        _estimator("unstable", "one model in fifty is unstable"),
        _estimator("slow", "it repeats its fit until 1800 rulers of processor time have gone, where orders are given"),
        _estimator("crashing", "one fit in fifty ends its process"),
        _estimator("hungry", "one fit in fifty takes 8 GB of memory"),
        _estimator("hanging", "one fit in fifty never ends"),
        _estimator("absent_minded", "one model in fifty is NaN"),
    )
}
"""The planted faults by name."""
