"""Measurements of one trial: the answer against the truth of its problem and against its own record."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, LinAlgWarning

from scenarios.estimators.claims import known_parameters
from scenarios.estimators.outcome import MODEL, Answer, EstimatorOutcome, NoModelError
from scenarios.estimators.task import Task
from scenarios.problems.problem import Problem
from scenarios.problems.trial import Trial
from sysid import Estimate, IOData, StateSpace, SysidError, SysidWarning, resid
from sysid.models.frequency_response import NORMAL_95
from sysid.polynomial.orders import make_orders
from sysid.polynomial.polynomial_estimate import Realise
from sysid.records.arrays import ComplexArray, FloatArray, Locked
from sysid.validation import CramerRaoBound
from sysid.validation.response_errors import normalised_error

NAN = float("nan")


@dataclass(frozen=True, eq=False)
class Measurement(Locked):
    """Measurements of one trial: all that metrics need, and nothing that only its process knows.

    Attributes:
        trial: The trial.
        kind: Kind of its outcome; see `scenarios.estimators.outcome.KINDS`.
        why: Its reason, where it is no model.
        seconds: Processor time, s; NaN where not known.
        ruler_seconds: Processor time of a fixed least-squares problem on the same record in the same run, s: the unit
            in which the times of estimators are compared.
        peak_bytes: Greatest memory use, bytes; 0 where not known.
        order: Of the model from input to output, without states that cancel; -1 where there is no model.
        response: From input to output at the problem's frequencies (nf, ny, nu); None where there is no stable model.
        response_covariance: Claimed (nf, ny, nu, 2, 2), or None.
        normalised_error: error' covariance^-1 error of the parameters, by the claimed covariance; NaN where none is
            claimed or the parameters are not those of the truth's structure.
        parameters: Number of its parameters.
        covered: Number of true parameters within their claimed 95 % intervals; -1 where not claimed.
        bandwidth_hz: (ny, nu); NaN where there is none; None where there is no stable model.
        bandwidth_ci95: (2, ny, nu), or None.
        whiteness_p: p-value of the residuals' whiteness test, the least of all outputs; NaN where not tested.
        independence_p: Of their independence of past inputs, the least of all pairs; NaN where not tested.
        nonparametric: Response of the record without a model, at the same frequencies (nf, ny, nu); None where the
            problem's records are not periodic.
    """

    trial: Trial
    kind: str
    why: str = ""
    seconds: float = NAN
    ruler_seconds: float = NAN
    peak_bytes: int = 0
    order: int = -1
    response: ComplexArray | None = None
    response_covariance: FloatArray | None = None
    normalised_error: float = NAN
    parameters: int = 0
    covered: int = -1
    bandwidth_hz: FloatArray | None = None
    bandwidth_ci95: FloatArray | None = None
    whiteness_p: float = NAN
    independence_p: float = NAN
    nonparametric: ComplexArray | None = None

    def to_table(self) -> dict[str, Any]:
        """As a table of what JSON holds."""
        return {name: _json_value(value) for name, value in vars(self).items()}

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> "Measurement":
        """Read a table of `to_table`."""
        values = {name: _restored(value) for name, value in table.items() if name != "trial"}
        return cls(trial=Trial(**table["trial"]), **values)


Measurements = Sequence[Measurement]


def _json_value(value: Any) -> Any:
    """A field as JSON can hold it; `_restored` is the inverse."""
    if isinstance(value, Trial):
        return vars(value)
    if np.iscomplexobj(value):
        # JSON has no complex numbers.
        return {"complex": np.stack((value.real, value.imag), axis=-1).tolist()}
    return {"real": value.tolist()} if isinstance(value, np.ndarray) else value


def _restored(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    if "complex" in value:
        return np.array(value["complex"], dtype=float).view(complex)[..., 0]
    return np.array(value["real"], dtype=float)


def measure(
    problem: Problem,
    trial: Trial,
    task: Task,
    record: IOData,
    outcome: EstimatorOutcome,
    *,
    ruler_seconds: float = NAN,
) -> Measurement:
    """Measure the outcome of a trial.

    Args:
        problem: Its problem.
        trial: The trial.
        task: The task.
        record: The record that the estimator was given.
        outcome: The estimator's answer, or its failure.
        ruler_seconds: Of the fixed problem on the same record; see `Ruler`.
    """
    seconds, peak_bytes = outcome.seconds, outcome.peak_bytes
    costs = Measurement(trial, MODEL, seconds=seconds, ruler_seconds=ruler_seconds, peak_bytes=peak_bytes)
    answer = outcome.answer
    if outcome.kind != MODEL or answer is None:
        return replace(costs, kind=outcome.kind, why=outcome.why)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        # Warnings of an uncertain bandwidth, of a predictor that is not stable, of poles close to the unit circle: the
        # measurements show each of them.
        warnings.simplefilter("ignore", SysidWarning)
        warnings.simplefilter("ignore", LinAlgWarning)
        try:
            return _measured(costs, answer, problem, task, record)
        except NoModelError as error:
            return replace(costs, kind=error.kind, why=str(error))
        except (SysidError, LinAlgError) as error:
            return replace(costs, kind="malformed", why=f"a model that cannot be evaluated: {error}")


def _measured(costs: Measurement, answer: Answer, problem: Problem, task: Task, record: IOData) -> Measurement:
    """Measurements of a model beside its costs."""
    claim = None
    if answer.polynomials is not None and answer.covariance is not None:
        claim = known_parameters(answer.covariance, answer.polynomials, answer.model, record, task)
    parameters = 0 if claim is None else len(claim.parameters)
    bandwidth_ci95 = None if answer.bandwidth_ci95 is None else np.stack(answer.bandwidth_ci95)
    whiteness_p, independence_p = _residual_tests(answer, record)
    # Models of other orders than the truth's have no true parameters.
    bound = problem.bound(task.structure) if costs.trial.ask == "fit" else None
    error, covered = _parameter_errors(claim, task, bound)
    return replace(
        costs,
        order=dynamic_order(answer.model),
        response=answer.model.frequency_response(problem.frequencies),
        response_covariance=answer.response_covariance,
        normalised_error=error,
        parameters=parameters,
        covered=covered,
        bandwidth_hz=answer.model.bandwidth(),
        bandwidth_ci95=bandwidth_ci95,
        whiteness_p=whiteness_p,
        independence_p=independence_p,
        nonparametric=problem.nonparametric(record),
    )


def dynamic_order(model: StateSpace) -> int:
    """Number of states from input to output of a stable model, without those that cancel."""
    # States with a Hankel singular value below this part of the largest cancel
    return model.input_path().minimal(1e-9).order


def _parameter_errors(claim: Estimate | None, task: Task, bound: CramerRaoBound | None) -> tuple[float, int]:
    """Normalised error of the parameters and how many lie within their intervals; NaN and -1 for other orders.

    The parameters must correspond one by one to those of the orders in the task.
    """
    if claim is None or bound is None or len(claim.parameters) != len(bound.parameters):
        return NAN, -1
    # The coordinates of a state space are the estimator's own.
    if task.chooses or task.structure == "ss" or not isinstance(claim.realise, Realise):
        return NAN, -1
    # Orders that the structure does not name are zero.
    orders = {name: 0 for name in ("na", "nc", "nd", "nf")} | dict(task.orders)
    if claim.realise.orders != make_orders(len(claim.realise.orders.nb), **orders):
        return NAN, -1
    error = claim.parameters - bound.parameters
    half = NORMAL_95 * np.sqrt(np.maximum(np.diag(claim.covariance), 0.0))
    covered = int((np.abs(error) <= half).sum())
    return normalised_error(error, claim.covariance), covered


def _residual_tests(answer: Answer, record: IOData) -> tuple[float, float]:
    """p-values of whiteness and of independence of past inputs, the least of all; the initial state is fitted.

    Whiteness is not tested without a model of the noise: dynamics, a covariance, or polynomials that say that it is
    white. NaN where nothing can be tested, as with residuals of zero.
    """
    try:
        test = resid(answer.model, record)
    except SysidError:
        return NAN, NAN
    whiteness_p = float(np.min(test.whiteness_p)) if _models_noise(answer) else NAN
    return whiteness_p, float(np.min(test.independence_p))


def _models_noise(answer: Answer) -> bool:
    if answer.model.innovation_covariance is not None or bool(np.any(answer.model.gain)):
        return True
    polynomials = answer.polynomials
    if polynomials is None:
        return False
    # Output error: A = C = D = 1 say that the noise is white.
    return not any(np.any(row[1:]) for row in (polynomials.A, polynomials.C, polynomials.D))
