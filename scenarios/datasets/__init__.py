"""Benchmark data sets: planned by a spec, built, checked, exported, scored, and withheld from classes."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.datasets.canonical import canonical_verdict, load_dataset
    from scenarios.datasets.data_set import DataRecord, DataSet, load, open_data_set

__all__ = ["DataRecord", "DataSet", "canonical_verdict", "load", "load_dataset", "open_data_set"]

__getattr__ = lazy_names(__name__, __file__)
