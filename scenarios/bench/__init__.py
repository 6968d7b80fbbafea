"""The test bench: anyone's estimator on records with known truth, measured by metrics with verdicts."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.bench.measurement import Measurement
    from scenarios.bench.metric import Metric, MetricDefinition
    from scenarios.bench.metrics import ALL_METRICS
    from scenarios.bench.result import Result
    from scenarios.bench.verify import BenchPlan

__all__ = ["ALL_METRICS", "BenchPlan", "Measurement", "Metric", "MetricDefinition", "Result"]

__getattr__ = lazy_names(__name__, __file__)
