"""Benchmark data sets: planned by a spec, built, checked, exported, scored, and withheld from classes."""

from typing import TYPE_CHECKING

from scenarios.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.datasets.data_set import DataRecord, DataSet, load, open_data_set

__all__ = ["DataRecord", "DataSet", "load", "open_data_set"]

__getattr__ = lazy_names(__name__, __file__)
