"""Former place of `Answer`, until all callers use the new one."""

from scenarios.estimators.outcome import Answer

__all__ = ["Answer"]
