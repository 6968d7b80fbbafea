"""The study: excitations, experiments, campaigns, comparison with truth, reports, the command line `hmtb`."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.errors import ScenarioError
    from scenarios.excitation_computer import Excitation
    from scenarios.registry import load, names
    from scenarios.scenario import Scenario
    from scenarios.waveform import Waveform

__all__ = ["Excitation", "Scenario", "ScenarioError", "Waveform", "load", "names"]

_ROOMS = {
    "Excitation": "excitation_computer",
    "Scenario": "scenario",
    "ScenarioError": "errors",
    "Waveform": "waveform",
    "load": "registry",
    "names": "registry",
}


def __getattr__(name: str) -> object:
    # Scenarios need the laboratory, which takes a second to load: the command line's help does not wait for it.
    if name not in _ROOMS:
        raise AttributeError(f"module 'scenarios' has no attribute {name!r}")
    return getattr(import_module(f"scenarios.{_ROOMS[name]}"), name)
