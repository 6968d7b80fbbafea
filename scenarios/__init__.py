"""The applications: experiments, thesis study, test bench for estimators, benchmark data sets, command line `hmtb`."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.datasets.canonical import load_dataset
    from scenarios.experiments.excitation_computer import Excitation
    from scenarios.experiments.registry import load, names
    from scenarios.experiments.scenario import Scenario
    from scenarios.experiments.waveform import Waveform
    from scenarios.files.errors import ScenarioError

__all__ = ["Excitation", "Scenario", "ScenarioError", "Waveform", "load", "load_dataset", "names"]

__getattr__ = lazy_names(__name__, __file__)
