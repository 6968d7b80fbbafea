"""An answer measured against the truth of its problem and against its own record."""

import warnings

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from scenarios.bench_contract.answer import Answer
from scenarios.bench_contract.outcome import MODEL, Outcome
from scenarios.bench_problems.problem import Bound, Problem
from scenarios.bench_trials.claim import Claim, claim_of, layout
from scenarios.bench_trials.measured import Measured
from scenarios.bench_trials.trial import Trial
from scenarios.errors import ScenarioError
from sysid import IOData, StateSpace, SysidError, SysidWarning, resid
from sysid.arrays import FloatArray
from sysid.estimate import Estimate
from sysid.frequency import NORMAL_95

CANCELS = 1e-9
"""States with a Hankel singular value below this part of the largest cancel."""

MALFORMED = "malformed"

NAN = float("nan")


def measure(
    problem: Problem,
    trial: Trial,
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
        # Of a bandwidth that is hardly known, or a predictor that is not stable: the numbers tell it.
        warnings.simplefilter("ignore", SysidWarning)
        try:
            claim = claim_of(answer)
        except ScenarioError as error:
            return failed(MALFORMED, str(error))
        estimate = None if claim is None else claim.estimate(answer, record)
        normalised, parameters, covered = _errors(claim, bound if trial.ask == "fit" else None)
        whiteness, independence = _residual_tests(answer.model, record)
        try:
            return Measured(
                trial,
                MODEL,
                "",
                outcome.seconds,
                ruler_seconds,
                outcome.peak_bytes,
                order=dynamic_order(answer.model),
                response=answer.model.frequency_response(problem.frequencies),
                response_covariance=_response_covariance(answer, estimate, problem.frequencies),
                normalised_error=normalised,
                parameters=parameters,
                covered=covered,
                bandwidth_hz=answer.model.bandwidth(),
                bandwidth_ci95=_bandwidth_interval(answer, estimate),
                whiteness_p=whiteness,
                independence_p=independence,
            )
        except (SysidError, LinAlgError) as error:
            return failed(MALFORMED, f"a model that cannot be evaluated: {error}")


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


def _errors(claim: Claim | None, bound: Bound | None) -> tuple[float, int, int]:
    """Normalised error, number of parameters, and how many of them lie within their intervals."""
    if claim is None:
        return NAN, 0, -1
    count = len(claim.parameters)
    if bound is None or claim.orders != layout(bound.polynomials, len(bound.parameters)):
        return NAN, count, -1
    error = claim.parameters - bound.parameters
    half = NORMAL_95 * np.sqrt(np.maximum(np.diag(claim.covariance), 0.0))
    return normalised_error(error, claim.covariance), count, int((np.abs(error) <= half).sum())


def _response_covariance(answer: Answer, estimate: Estimate | None, frequencies: FloatArray) -> FloatArray | None:
    if answer.response_covariance is not None:
        return answer.response_covariance
    return None if estimate is None else estimate.frequency_response(frequencies).covariance


def _bandwidth_interval(answer: Answer, estimate: Estimate | None) -> FloatArray | None:
    if answer.bandwidth_ci95 is not None:
        return np.stack(answer.bandwidth_ci95)
    return None if estimate is None else np.stack(estimate.bandwidth().ci95)


def _residual_tests(model: StateSpace, record: IOData) -> tuple[float, float]:
    """p-values of whiteness and of independence of past inputs, the least of all; the initial state is fitted.

    Without a model of the noise nothing is claimed of whiteness. What cannot be tested, such as residuals that vanish,
    is NaN.
    """
    try:
        test = resid(model, record)
    except SysidError:
        return NAN, NAN
    whiteness = NAN if model.K is None else float(np.min(test.whiteness_p))
    return whiteness, float(np.min(test.independence_p))
