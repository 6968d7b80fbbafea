"""Study of the thesis: campaign, analyses, findings and report [Morris1996]."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.thesis.comparison import Comparison
    from scenarios.thesis.finding import Finding
    from scenarios.thesis.outcome import SeedOutcome
    from scenarios.thesis.study import run_study
    from scenarios.thesis.tally import Tally

_MODULES = {
    "Comparison": "comparison",
    "Finding": "finding",
    "SeedOutcome": "outcome",
    "Tally": "tally",
    "run_study": "study",
}

__all__ = ["Comparison", "Finding", "SeedOutcome", "Tally", "run_study"]


def __getattr__(name: str) -> object:
    # The command line's help does not wait for the laboratory.
    if name not in _MODULES:
        raise AttributeError(f"module 'scenarios.thesis' has no attribute {name!r}")
    return getattr(import_module(f"scenarios.thesis.{_MODULES[name]}"), name)
