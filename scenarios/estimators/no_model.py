"""An answer that is no model, and why."""

from scenarios.files.errors import ScenarioError


class NoModelError(ScenarioError):
    """An answer that is no model.

    Attributes:
        kind: Which of `scenarios.estimators.outcome.KINDS`: `malformed` or `not_finite`.
    """

    def __init__(self, kind: str, why: str) -> None:
        super().__init__(why)
        self.kind = kind
