"""The test bench: anyone's estimator on records with known truth, measured by metrics with verdicts."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.bench.measurement import Measurement
    from scenarios.bench.metric import Metric, MetricDefinition
    from scenarios.bench.metrics import ALL_METRICS
    from scenarios.bench.result import Result
    from scenarios.bench.verify import BenchPlan

__all__ = ["ALL_METRICS", "BenchPlan", "Measurement", "Metric", "MetricDefinition", "Result"]

_MODULES = {
    "ALL_METRICS": "metrics",
    "BenchPlan": "verify",
    "Measurement": "measurement",
    "Metric": "metric",
    "MetricDefinition": "metric",
    "Result": "result",
}


def __getattr__(name: str) -> object:
    # imported on first use: the bench takes a second to load
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
