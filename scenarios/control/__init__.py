"""Model reference control on the twin: identify, run controlled scenarios, score them against a reference."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.control.campaign import identify_pair
    from scenarios.control.runs import run_scenarios
    from scenarios.control.score import score

__all__ = ["identify_pair", "run_scenarios", "score"]

__getattr__ = lazy_names(__name__, __file__)
