"""Experiments: excitations, scenarios and operators, previews of commands and reviews of logs."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.experiments.excitation_computer import Excitation
    from scenarios.experiments.registry import load, names
    from scenarios.experiments.scenario import Scenario
    from scenarios.experiments.waveform import Waveform

__all__ = ["Excitation", "Scenario", "Waveform", "load", "names"]

__getattr__ = lazy_names(__name__, __file__)
