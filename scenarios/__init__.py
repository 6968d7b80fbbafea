"""The study: excitations, experiments, campaigns, comparison with truth, reports, the command line `hmtb`."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.experiments.excitation_computer import Excitation
    from scenarios.experiments.registry import load, names
    from scenarios.experiments.scenario import Scenario
    from scenarios.experiments.waveform import Waveform
    from scenarios.files.errors import ScenarioError

__all__ = ["Excitation", "Scenario", "ScenarioError", "Waveform", "load", "names"]

_MODULES = {
    "Excitation": "experiments.excitation_computer",
    "Scenario": "experiments.scenario",
    "ScenarioError": "files.errors",
    "Waveform": "experiments.waveform",
    "load": "experiments.registry",
    "names": "experiments.registry",
}


def __getattr__(name: str) -> object:
    # Scenarios need the laboratory, which takes a second to load: the command line's help does not wait for it.
    if name not in _MODULES:
        raise AttributeError(f"module 'scenarios' has no attribute {name!r}")
    return getattr(import_module(f"scenarios.{_MODULES[name]}"), name)
