"""Benchmark data sets: planned by a spec, built, checked, exported, scored, and withheld from classes."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.datasets.data_set import DataRecord, DataSet, load, open_data_set

__all__ = ["DataRecord", "DataSet", "load", "open_data_set"]

_MODULES = {"DataRecord": "data_set", "DataSet": "data_set", "load": "data_set", "open_data_set": "data_set"}


def __getattr__(name: str) -> object:
    # The command line's help does not wait for the laboratory.
    if name not in _MODULES:
        raise AttributeError(f"module 'scenarios.datasets' has no attribute {name!r}")
    return getattr(import_module(f"scenarios.datasets.{_MODULES[name]}"), name)
