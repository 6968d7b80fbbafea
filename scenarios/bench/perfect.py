"""The perfect estimator, which knows the truth: what no verdict of the test bench may ever fail."""

import warnings
from typing import Protocol, runtime_checkable

import numpy as np

import sysid
from scenarios.estimators.answer import Answer
from scenarios.estimators.outcome import MODEL, Outcome
from scenarios.estimators.task import Task
from scenarios.files.errors import ScenarioError
from scenarios.problems.bound import response_covariance
from scenarios.problems.problem import Bound, Problem
from sysid import IOData, Polynomials, StateSpace
from sysid.models.frequency_response import NORMAL_95
from sysid.records.arrays import FloatArray


@runtime_checkable
class Efficient(Protocol):
    """A problem that can tell what a perfect estimate of a record is."""

    def efficient(self, structure: str, seed: int) -> FloatArray:
        """Its parameters (p,)."""

    def realise(self, structure: str, theta: FloatArray) -> tuple[StateSpace, Polynomials | None]:
        """The model with these parameters, and its polynomials."""


@runtime_checkable
class Scattered(Protocol):
    """A problem without bound that can tell an estimate as good as any."""

    def scattered(self, seed: int) -> StateSpace:
        """The model."""


def perfect(problem: Problem, task: Task, seed: int) -> Outcome:
    """Answer as well as can be.

    The truth with an error of exactly the Cramér-Rao covariance, claiming exactly that; the truth itself where there is
    no noise or no bound. Where the orders are to be chosen, those of the truth; where they are too low, the
    prediction-error fit to the record. An error that makes the model unstable is told as such and not drawn again:
    what is left of a distribution after redrawing has another covariance.

    Args:
        problem: With its truth.
        task: What is asked.
        seed: Of the record; the error belongs to it.

    Returns:
        The outcome.
    """
    fit = problem.task(task.structure)
    if not task.chooses and (fit is None or dict(task.orders) != dict(fit.orders)):
        answer = Answer(fitted(problem.draw(seed), task).model)
    else:
        bound = problem.bound(task.structure)
        if bound is not None and isinstance(problem, Efficient):
            model, polynomials = problem.realise(task.structure, problem.efficient(task.structure, seed))
            answer = _claiming(bound, model, None if task.structure == "ss" else polynomials)
        elif isinstance(problem, Scattered):
            answer = Answer(problem.scattered(seed))
        else:
            answer = Answer(problem.truth)
    if not answer.model.input_path().is_stable():
        return Outcome("unstable", "the error of a perfect estimate goes beyond the edge of stability", answer=answer)
    return Outcome(MODEL, answer=answer)


def fitted(data: IOData, task: Task) -> sysid.Estimate:
    """Prediction-error fit with the orders of a task.

    Args:
        data: The record.
        task: Its orders are given.

    Raises:
        ScenarioError: The orders are not given.
    """
    if task.chooses:
        raise ScenarioError(f"a task of structure {task.structure} without orders given, expected orders")
    o = dict(task.orders)
    with warnings.catch_warnings():
        # a model that is too small does not fit, and is known not to
        warnings.simplefilter("ignore", sysid.SysidWarning)
        if task.structure == "arx":
            return sysid.arx(data, o["na"], o["nb"], o["nk"])
        if task.structure == "armax":
            return sysid.armax(data, o["na"], o["nb"], o["nc"], o["nk"])
        if task.structure == "oe":
            return sysid.oe(data, o["nb"], o["nf"], o["nk"])
        if task.structure == "bj":
            return sysid.bj(data, o["nb"], o["nc"], o["nd"], o["nf"], o["nk"])
        start = sysid.n4sid(data, o["order"], direct=False, stable=True)
        return sysid.pem_ss(data, start, direct=False)


def _claiming(bound: Bound, model: StateSpace, polynomials: Polynomials | None) -> Answer:
    hz = model.bandwidth()
    factor = np.exp(NORMAL_95 * bound.bandwidth_deviation)
    return Answer(
        model,
        polynomials,
        None if polynomials is None else bound.covariance,
        response_covariance(bound),
        (hz / factor, np.minimum(hz * factor, 0.5 / model.dt)),
    )
