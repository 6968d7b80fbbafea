"""Outcome of one request to an estimator: a model with its claims, or the kind of failure and the reason."""

from dataclasses import dataclass

from scenarios.files.errors import ScenarioError
from sysid import Polynomials, StateSpace
from sysid.records.arrays import FloatArray, Locked

MODEL = "model"
REFUSED = "refused"
KINDS = {
    MODEL: "a stable model",
    REFUSED: "the estimator says that it does not do this: not counted",
    "unstable": "a model with a pole on or outside the unit circle",
    "not_finite": "numbers that are NaN or infinite",
    "malformed": "something that is no model of these inputs and outputs",
    "error": "an exception, or an exit code that is not 0",
    "crash": "its process died",
    "hang": "it was stopped at its time limit",
    "memory": "it exceeded its memory limit",
}
"""Kinds of outcomes. All but the first two are failures."""


class NoModelError(ScenarioError):
    """Returned numbers that are no model; its kind is one of `KINDS`, `malformed` or `not_finite`."""

    def __init__(self, why: str, kind: str = "malformed") -> None:
        super().__init__(why)
        self.kind = kind


@dataclass(frozen=True, eq=False, repr=False)
class Answer(Locked):
    """A model, and what its estimator claims about its accuracy.

    Attributes:
        model: Innovation form. There is no noise model where K is zero and the innovation covariance is not given,
            unless polynomials with A = C = D = 1 say that the noise is white.
        polynomials: A, B, C, D, F, where the method has them.
        covariance: Of their parameters in the sequence A, B, C, D, F (p, p); None: not claimed.
        response_covariance: Of real and imaginary part of the response from input to output at the frequencies of the
            task (nf, ny, nu, 2, 2); None: not claimed. It follows from `covariance` where that is given alone.
        bandwidth_ci95: Ends of the 95 % interval of the half-power bandwidth, (ny, nu) each, Hz; None: not claimed.
    """

    model: StateSpace
    polynomials: Polynomials | None = None
    covariance: FloatArray | None = None
    response_covariance: FloatArray | None = None
    bandwidth_ci95: tuple[FloatArray, FloatArray] | None = None


@dataclass(frozen=True, eq=False, repr=False)
class EstimatorOutcome(Locked):
    """Outcome of one request to an estimator.

    Attributes:
        kind: One of `KINDS`.
        why: Reason in one line, where it is no model.
        seconds: Processor time of the estimator, s, without starting its process unless it is a program that is started
            for each request; NaN where not known.
        wall: Time until the answer, s.
        peak_bytes: Largest memory of its processes that was seen, bytes; 0 where not known.
        answer: The model; also an unstable one.
    """

    kind: str
    why: str = ""
    seconds: float = float("nan")
    wall: float = float("nan")
    peak_bytes: int = 0
    answer: Answer | None = None
