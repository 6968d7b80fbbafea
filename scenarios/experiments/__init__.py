"""Experiments: excitations, scenarios, operators and campaigns, previews of commands and reviews of logs."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.experiments.campaign import Campaign, run_campaign
    from scenarios.experiments.excitation_computer import Excitation
    from scenarios.experiments.registry import load, names
    from scenarios.experiments.scenario import Scenario
    from scenarios.experiments.waveform import Waveform

__all__ = ["Campaign", "Excitation", "Scenario", "Waveform", "load", "names", "run_campaign"]

_MODULES = {"Campaign": "campaign", "Excitation": "excitation_computer", "Scenario": "scenario", "Waveform": "waveform"}


def __getattr__(name: str) -> object:
    # Scenarios need the laboratory, which takes a second to load; the registry of their names does not.
    if name not in __all__:
        raise AttributeError(f"module 'scenarios.experiments' has no attribute {name!r}")
    module = _MODULES.get(name, "campaign" if name == "run_campaign" else "registry")
    return getattr(import_module(f"scenarios.experiments.{module}"), name)
