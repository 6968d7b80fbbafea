"""Truth about the twin: best linear approximations, attainable errors, maps, and the models that the thesis prints."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.truth.attainable import Attainable
    from scenarios.truth.best_linear import BestLinearTruth
    from scenarios.truth.bla_of_test import BestLinearOfTest
    from scenarios.truth.maps import Density, Maps
    from scenarios.truth.published import PublishedModel, published_model
    from scenarios.truth.truth_summary import TruthSummary

__all__ = [
    "Attainable",
    "BestLinearOfTest",
    "BestLinearTruth",
    "Density",
    "Maps",
    "PublishedModel",
    "TruthSummary",
    "published_model",
]

__getattr__ = lazy_names(__name__, __file__)
