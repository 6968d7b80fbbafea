"""Truth about the twin: best linear approximations, attainable errors, maps, and the models that the thesis prints."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.truth.attainable import Attainable
    from scenarios.truth.best_linear import BestLinearTruth
    from scenarios.truth.bla_of_record import BestLinearOfTest
    from scenarios.truth.maps import Density, Maps
    from scenarios.truth.published import PublishedModel, published_model
    from scenarios.truth.truth_summary import TruthSummary

_MODULES = {
    "Attainable": "attainable",
    "BestLinearOfTest": "bla_of_record",
    "BestLinearTruth": "best_linear",
    "Density": "maps",
    "Maps": "maps",
    "PublishedModel": "published",
    "TruthSummary": "truth_summary",
    "published_model": "published",
}

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


def __getattr__(name: str) -> object:
    # The command line's help does not wait for the laboratory.
    if name not in _MODULES:
        raise AttributeError(f"module 'scenarios.truth' has no attribute {name!r}")
    return getattr(import_module(f"scenarios.truth.{_MODULES[name]}"), name)
