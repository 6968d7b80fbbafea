"""How predictions are scored: the metric that a data set is compared by."""

from dataclasses import dataclass

from scenarios.errors import ScenarioError
from scenarios.suggest import unknown

METRICS = ("rmse", "nrmse", "fit")
"""Root mean square error; that over the spread of the output in percent; 100 (1 - |error| / |y - mean y|) percent."""

UNITS = {"rad": 1.0, "mrad": 1e3, "deg": 57.29577951308232}
"""Units of a root mean square error, per rad."""


@dataclass(frozen=True)
class Scoring:
    """The primary score of a data set.

    Attributes:
        metric: One of `METRICS`.
        unit: Of the root mean square error, one of `UNITS`.
        steps: Samples ahead that outputs are known for; 0: simulation, from inputs and the window alone.
    """

    metric: str = "rmse"
    unit: str = "mrad"
    steps: int = 0

    def __post_init__(self) -> None:
        if self.metric not in METRICS:
            raise ScenarioError(f"scoring: {unknown('metric', self.metric, METRICS)}")
        if self.unit not in UNITS:
            raise ScenarioError(f"scoring: {unknown('unit', self.unit, UNITS)}")
        if not 0 <= self.steps <= 10**6:
            raise ScenarioError(f"scoring: steps = {self.steps} given, expected 0 (simulation) or more")
