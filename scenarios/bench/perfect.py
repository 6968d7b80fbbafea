"""The perfect estimator, which knows the truth: no verdict of the test bench may ever fail it."""

import warnings
from typing import Protocol, runtime_checkable

import numpy as np

from scenarios.estimators.ours import prediction_error
from scenarios.estimators.outcome import MODEL, Answer, EstimatorOutcome
from scenarios.estimators.task import Task
from scenarios.problems.bound import response_covariance
from scenarios.problems.problem import Bound, Problem
from sysid import Polynomials, StateSpace, SysidWarning
from sysid.models.frequency_response import NORMAL_95
from sysid.records.arrays import FloatArray

PERFECT = "bench:perfect"
"""Target of the perfect estimator; it runs in the bench's own process, since no other process sees the truth."""


@runtime_checkable
class Efficient(Protocol):
    """A problem with a perfect estimate for each record."""

    def efficient(self, structure: str, seed: int) -> FloatArray:
        """Its parameters (p,)."""

    def realise(self, structure: str, theta: FloatArray) -> tuple[StateSpace, Polynomials | None]:
        """The model with these parameters, and its polynomials."""


@runtime_checkable
class Scattered(Protocol):
    """A problem without bound, with an estimate as good as any for each record."""

    def scattered(self, seed: int) -> StateSpace:
        """The model."""


def perfect(problem: Problem, task: Task, seed: int) -> EstimatorOutcome:
    """Answer as well as possible.

    The truth with an error of exactly the Cramér-Rao covariance, claiming exactly that; the truth itself where there is
    no noise or no bound. Where the orders are to be chosen, those of the truth; where they are too low, the
    prediction-error fit to the record. An error that makes the model unstable counts as such and is not drawn again:
    the rest of a distribution after redrawing has another covariance.

    Args:
        problem: With its truth.
        task: The task.
        seed: Of the record; the error belongs to it.
    """
    fit = problem.task(task.structure)
    if not task.chooses and (fit is None or dict(task.orders) != dict(fit.orders)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SysidWarning)  # a model that is too small is known not to fit
            answer = Answer(prediction_error(problem.draw(seed), task).model)
    else:
        bound = problem.bound(task.structure)
        if bound is not None and isinstance(problem, Efficient):
            model, polynomials = problem.realise(task.structure, problem.efficient(task.structure, seed))
            answer = _with_claims(bound, model, None if task.structure == "ss" else polynomials)
        elif isinstance(problem, Scattered):
            answer = Answer(problem.scattered(seed))
        else:
            answer = Answer(problem.truth)
    if not answer.model.input_path().is_stable():
        return EstimatorOutcome("unstable", "the error of a perfect estimate makes it unstable", answer=answer)
    return EstimatorOutcome(MODEL, answer=answer)


def _with_claims(bound: Bound, model: StateSpace, polynomials: Polynomials | None) -> Answer:
    hz = model.bandwidth()
    factor = np.exp(NORMAL_95 * bound.bandwidth_deviation)
    return Answer(
        model,
        polynomials,
        None if polynomials is None else bound.covariance,
        response_covariance(bound),
        (hz / factor, np.minimum(hz * factor, 0.5 / model.dt)),
    )
