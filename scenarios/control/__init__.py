"""Model reference control on the twin: identify, run controlled scenarios, score them against a reference."""

from typing import TYPE_CHECKING

from scenarios.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.control.campaign import IdentifiedPair, identification_experiment, identify_pair
    from scenarios.control.joint_controller import Law
    from scenarios.control.runs import Controlled, ScenarioRuns, run_scenarios
    from scenarios.control.score import Score

__all__ = [
    "Controlled",
    "IdentifiedPair",
    "Law",
    "ScenarioRuns",
    "Score",
    "identification_experiment",
    "identify_pair",
    "run_scenarios",
]

__getattr__ = lazy_names(__name__, __file__)
