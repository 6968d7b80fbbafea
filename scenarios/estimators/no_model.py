"""Former place of `NoModelError`, until all callers use the new one."""

from scenarios.estimators.outcome import NoModelError

__all__ = ["NoModelError"]
