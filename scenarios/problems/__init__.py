"""Systems with known truth: how to draw their records, what to ask of an estimator, and the best accuracy possible."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.problems.problem import Problem
    from scenarios.problems.registry import names
    from scenarios.problems.trial import Trial

__all__ = ["Problem", "Trial", "names"]

__getattr__ = lazy_names(__name__, __file__)
