"""How predictions are scored: the metric that a data set is compared by."""

from dataclasses import dataclass

from scenarios.errors import ScenarioError
from scenarios.suggest import unknown

METRICS = ("rmse", "nrmse", "fit")
"""Root mean square error; that over the spread of the output in percent; 100 (1 - |error| / |y - mean y|) percent."""

UNITS = {"rad": 1.0, "mrad": 1e3, "deg": 57.29577951308232}
"""Units of a root mean square error, per rad."""

PERCENT = "%"
"""Unit of the other metrics."""


@dataclass(frozen=True)
class Scoring:
    """The primary score of a data set.

    Attributes:
        metric: One of `METRICS`.
        unit: Of the root mean square error, one of `UNITS`, mrad where none is given; of the others %.
        steps: Samples ahead that outputs are known for; 0: simulation, from inputs and the window alone.
    """

    metric: str = "rmse"
    unit: str = ""
    steps: int = 0

    def __post_init__(self) -> None:
        if self.metric not in METRICS:
            raise ScenarioError(f"scoring: {unknown('metric', self.metric, METRICS)}")
        object.__setattr__(self, "unit", self.unit or ("mrad" if self.metric == "rmse" else PERCENT))
        if self.metric != "rmse" and self.unit != PERCENT:
            raise ScenarioError(f"scoring: unit = {self.unit!r} given for {self.metric}, which is in {PERCENT}")
        if self.metric == "rmse" and self.unit not in UNITS:
            raise ScenarioError(f"scoring: {unknown('unit', self.unit, UNITS)}")
        if not 0 <= self.steps <= 10**6:
            raise ScenarioError(f"scoring: steps = {self.steps} given, expected 0 (simulation) or more")
