"""Former names of `scenarios.estimators.runner`, until all callers use the new ones."""

from scenarios.estimators.runner import EstimatorProcess as Sandbox

open_sandbox = Sandbox

__all__ = ["Sandbox", "open_sandbox"]
