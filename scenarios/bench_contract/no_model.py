"""An answer that is no model, and why."""

from scenarios.bench_contract.outcome import KINDS
from scenarios.errors import ScenarioError


class NoModelError(ScenarioError):
    """An answer that is no model.

    Attributes:
        kind: Which of `KINDS`.
    """

    def __init__(self, kind: str, why: str) -> None:
        if kind not in KINDS:
            raise ValueError(f"kind {kind!r} given, expected one of {', '.join(KINDS)}")
        super().__init__(why)
        self.kind = kind
