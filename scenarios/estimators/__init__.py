"""Anyone's estimator: the protocol, the runner that calls it in its own process, adapters of ours and peers."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.estimators.estimator import Estimator, Limits
    from scenarios.estimators.outcome import Answer, EstimatorOutcome
    from scenarios.estimators.runner import EstimatorProcess
    from scenarios.estimators.task import Task

__all__ = ["Answer", "Estimator", "EstimatorOutcome", "EstimatorProcess", "Limits", "Task"]

_MODULES = {
    "Answer": "outcome",
    "Estimator": "estimator",
    "EstimatorOutcome": "outcome",
    "EstimatorProcess": "runner",
    "Limits": "estimator",
    "Task": "task",
}


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
