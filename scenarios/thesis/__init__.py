"""Study of the thesis: campaign, analyses, findings and report [Morris1996]."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.thesis.comparison import Comparison
    from scenarios.thesis.finding import Finding
    from scenarios.thesis.monte_carlo import SeedOutcome, Tally
    from scenarios.thesis.study import run_study

__all__ = ["Comparison", "Finding", "SeedOutcome", "Tally", "run_study"]

__getattr__ = lazy_names(__name__, __file__)
