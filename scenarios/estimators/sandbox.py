"""Former names of `scenarios.estimators.runner`, until all callers use the new ones."""

from scenarios.estimators.runner import EstimatorProcess

Sandbox = open_sandbox = EstimatorProcess
