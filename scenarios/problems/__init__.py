"""Systems with known truth: how to draw their records, what to ask of an estimator, and the best accuracy possible."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.problems.problem import Bound, Problem
    from scenarios.problems.registry import names
    from scenarios.problems.trial import Trial

__all__ = ["Bound", "Problem", "Trial", "names"]

_MODULES = {"Bound": "problem", "Problem": "problem", "Trial": "trial", "names": "registry"}


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
