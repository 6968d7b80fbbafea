"""Anyone's estimator: the protocol, the runner that calls it in its own process, adapters of ours and peers."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.estimators.estimator import Estimator, Limits
    from scenarios.estimators.outcome import Answer, EstimatorOutcome
    from scenarios.estimators.runner import EstimatorProcess
    from scenarios.estimators.task import Task

__all__ = ["Answer", "Estimator", "EstimatorOutcome", "EstimatorProcess", "Limits", "Task"]

__getattr__ = lazy_names(__name__, __file__)
