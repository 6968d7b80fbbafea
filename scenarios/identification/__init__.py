"""Identification: from records to a model, its bandwidths and fits, and the answer on the thesis' 1 Hz finding."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.identification.bandwidth_study import BandwidthStudy
    from scenarios.identification.identification import Identification, fit_model, identify
    from scenarios.identification.methods import ESTIMATORS
    from scenarios.identification.model_comparison import compare_models
    from scenarios.identification.recovered_bandwidth import RecoveredBandwidth, recover

_MODULES = {
    "ESTIMATORS": "methods",
    "BandwidthStudy": "bandwidth_study",
    "Identification": "identification",
    "RecoveredBandwidth": "recovered_bandwidth",
    "compare_models": "model_comparison",
    "fit_model": "identification",
    "identify": "identification",
    "recover": "recovered_bandwidth",
}

__all__ = [
    "ESTIMATORS",
    "BandwidthStudy",
    "Identification",
    "RecoveredBandwidth",
    "compare_models",
    "fit_model",
    "identify",
    "recover",
]


def __getattr__(name: str) -> object:
    # The command line's help does not wait for the laboratory.
    if name not in _MODULES:
        raise AttributeError(f"module 'scenarios.identification' has no attribute {name!r}")
    return getattr(import_module(f"scenarios.identification.{_MODULES[name]}"), name)
