"""What came of asking an estimator once."""

from dataclasses import dataclass

from scenarios.estimators.answer import Answer
from sysid.records.arrays import Locked

MODEL = "model"
REFUSED = "refused"
KINDS = {
    MODEL: "a stable model",
    REFUSED: "it says that it does not do this: not counted",
    "unstable": "a model with a pole on or outside the unit circle",
    "not_finite": "numbers that are NaN or infinite",
    "malformed": "something that is no model of these inputs and outputs",
    "error": "an error that it raised, or an exit code that is not 0",
    "crash": "its process died",
    "hang": "it was stopped at its limit of time",
    "memory": "it went over its limit of memory",
}
"""What can come of it. All but the first two are failures."""


@dataclass(frozen=True, eq=False, repr=False)
class Outcome(Locked):
    """What came of one request.

    Attributes:
        kind: One of `KINDS`.
        why: In words, where it is no model.
        seconds: Processor time of the estimator, s, without starting its process, but for a program that
            is started anew for each; NaN where not known.
        wall: Time until the answer, s.
        peak_bytes: The most memory that its process had, bytes; 0 where not known.
        answer: The model; also an unstable one.
    """

    kind: str
    why: str = ""
    seconds: float = float("nan")
    wall: float = float("nan")
    peak_bytes: int = 0
    answer: Answer | None = None

    @property
    def failed(self) -> bool:
        """Whether it counts as a failure."""
        return self.kind not in (MODEL, REFUSED)
