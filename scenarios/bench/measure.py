"""An answer measured against the truth of its problem and against its own record."""

import warnings

import numpy as np
from scipy.linalg import LinAlgError, LinAlgWarning, cho_factor, cho_solve

from scenarios.bench.measured import Measured
from scenarios.estimators.answer import Answer
from scenarios.estimators.claims import known_parameters, response_and_interval
from scenarios.estimators.no_model import NoModelError
from scenarios.estimators.outcome import MODEL, Outcome
from scenarios.estimators.task import Task
from scenarios.problems.problem import Bound, Periodic, Problem
from scenarios.problems.trial import Trial
from sysid import Estimate, IOData, StateSpace, SysidError, SysidWarning, resid
from sysid.models.frequency_response import NORMAL_95
from sysid.polynomial.orders import make_orders
from sysid.polynomial.polynomial_estimate import Realise
from sysid.records.arrays import FloatArray

CANCELS = 1e-9
"""States with a Hankel singular value below this part of the largest cancel."""

NAN = float("nan")


def measure(
    problem: Problem,
    trial: Trial,
    task: Task,
    bound: Bound | None,
    record: IOData,
    outcome: Outcome,
    *,
    ruler_seconds: float = NAN,
) -> Measured:
    """Measure what came of a trial.

    Args:
        problem: Its problem.
        trial: The trial.
        task: What was asked.
        bound: That of the contestant's structure: the truth in its parameters; None where there is none.
        record: What the estimator was given.
        outcome: What came of it.
        ruler_seconds: Of the fixed problem on the same record; see `Ruler`.
    """

    def failed(kind: str, why: str) -> Measured:
        return Measured(trial, kind, why, outcome.seconds, ruler_seconds, outcome.peak_bytes)

    answer = outcome.answer
    if outcome.kind != MODEL or answer is None:
        return failed(outcome.kind, outcome.why)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        # Of a bandwidth that is hardly known, a predictor that is not stable, poles close to the unit circle: the
        # numbers tell it.
        warnings.simplefilter("ignore", SysidWarning)
        warnings.simplefilter("ignore", LinAlgWarning)
        try:
            claim = _claim(answer, record, task)
            response_covariance, interval = _claims_that_follow(answer, claim, task)
            normalised, parameters, covered = _errors(claim, task, bound if trial.ask == "fit" else None)
            whiteness, independence = _residual_tests(answer, record)
            return Measured(
                trial,
                MODEL,
                "",
                outcome.seconds,
                ruler_seconds,
                outcome.peak_bytes,
                order=dynamic_order(answer.model),
                response=answer.model.frequency_response(problem.frequencies),
                response_covariance=response_covariance,
                normalised_error=normalised,
                parameters=parameters,
                covered=covered,
                bandwidth_hz=answer.model.bandwidth(),
                bandwidth_ci95=None if interval is None else np.stack(interval),
                whiteness_p=whiteness,
                independence_p=independence,
                nonparametric=problem.nonparametric(record) if isinstance(problem, Periodic) else None,
            )
        except NoModelError as error:
            return failed(error.kind, str(error))
        except (SysidError, LinAlgError) as error:
            return failed("malformed", f"a model that cannot be evaluated: {error}")


def dynamic_order(model: StateSpace) -> int:
    """Number of states from input to output, without those that cancel.

    Args:
        model: A stable model.
    """
    return model.input_path().minimal(CANCELS).order


def normalised_error(error: FloatArray, covariance: FloatArray) -> float:
    """The error weighed by its covariance, e' P^-1 e; infinite where the covariance is not positive definite.

    Args:
        error: (p,).
        covariance: (p, p). It is scaled to ones on its diagonal first: parameters differ by orders of magnitude.
    """
    deviations = np.sqrt(np.diag(covariance))
    if not (deviations > 0.0).all():
        return float("inf")
    try:
        factor = cho_factor(covariance / np.outer(deviations, deviations))
    except (LinAlgError, ValueError):
        return float("inf")
    scaled = error / deviations
    return float(scaled @ cho_solve(factor, scaled))


def _claim(answer: Answer, record: IOData, task: Task) -> Estimate | None:
    """The parameters with their claimed covariance; None where none is claimed."""
    if answer.polynomials is None or answer.covariance is None:
        return None
    return known_parameters(answer.covariance, answer.polynomials, answer.model, record, task)


def _claims_that_follow(
    answer: Answer, claim: Estimate | None, task: Task
) -> tuple[FloatArray | None, tuple[FloatArray, FloatArray] | None]:
    """Covariance of the response and interval of the bandwidth, as claimed or as they follow from the parameters'."""
    spread, ends = answer.response_covariance, answer.bandwidth_ci95
    if claim is not None and (spread is None or ends is None):
        follows = response_and_interval(claim, task)
        spread, ends = (follows[0] if spread is None else spread), (follows[1] if ends is None else ends)
    return spread, ends


def _errors(claim: Estimate | None, task: Task, bound: Bound | None) -> tuple[float, int, int]:
    """Normalised error, number of parameters, and how many of them lie within their intervals."""
    if claim is None:
        return NAN, 0, -1
    count = len(claim.parameters)
    if bound is None or not _as_asked(claim, task) or count != len(bound.parameters):
        return NAN, count, -1
    error = claim.parameters - bound.parameters
    half = NORMAL_95 * np.sqrt(np.maximum(np.diag(claim.covariance), 0.0))
    return normalised_error(error, claim.covariance), count, int((np.abs(error) <= half).sum())


def _as_asked(claim: Estimate, task: Task) -> bool:
    """Whether the parameters are those of the orders that were asked, one by one."""
    if task.chooses or task.structure == "ss" or not isinstance(claim.realise, Realise):
        return False
    asked = dict(task.orders)
    orders = make_orders(
        len(claim.realise.orders.nb),
        nb=asked["nb"],
        nk=asked["nk"],
        na=asked.get("na", 0),
        nc=asked.get("nc", 0),
        nd=asked.get("nd", 0),
        nf=asked.get("nf", 0),
    )
    return claim.realise.orders == orders


def _residual_tests(answer: Answer, record: IOData) -> tuple[float, float]:
    """p-values of whiteness and of independence of past inputs, the least of all; the initial state is fitted.

    Without a model of the noise nothing is claimed of whiteness. What cannot be tested, such as residuals that vanish,
    is NaN.
    """
    try:
        test = resid(answer.model, record)
    except SysidError:
        return NAN, NAN
    return float(np.min(test.whiteness_p)) if _models_noise(answer) else NAN, float(np.min(test.independence_p))


def _models_noise(answer: Answer) -> bool:
    """Whether there is a model of the noise: dynamics, a covariance, or polynomials that say that it is white."""
    if answer.model.innovation_covariance is not None or bool(np.any(answer.model.gain)):
        return True
    p = answer.polynomials
    return p is not None and all(not np.any(row[1:]) for row in (p.A, p.C, p.D))
