"""Former names of `scenarios.estimators.estimator`, until all callers use the new ones."""

from scenarios.estimators.estimator import METHODS, Limits
from scenarios.estimators.estimator import Estimator as Contestant

__all__ = ["METHODS", "Contestant", "Limits"]
