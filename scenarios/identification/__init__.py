"""Identification: from records to a model, its bandwidths and fits, and the answer on the thesis' 1 Hz finding."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.identification.bandwidth_study import BandwidthStudy
    from scenarios.identification.identification import Identification, fit_model, identify
    from scenarios.identification.methods import ESTIMATORS
    from scenarios.identification.model_comparison import compare_models
    from scenarios.identification.recovered_bandwidth import RecoveredBandwidth, recover

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

__getattr__ = lazy_names(__name__, __file__)
