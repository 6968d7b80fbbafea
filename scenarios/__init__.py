"""The study: excitations, experiments, campaigns, comparison with truth, reports, the command line `hmtb`."""

from scenarios.errors import ScenarioError
from scenarios.registry import load, names
from scenarios.scenario import Excitation, Scenario
from scenarios.waveform import Waveform

__all__ = ["Excitation", "Scenario", "ScenarioError", "Waveform", "load", "names"]
