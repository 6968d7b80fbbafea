"""Data sets in the forms of other tools: files, Parquet tables, `nonlinear_benchmarks`, IdentiBench."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.exchange.benchmark_packages import identibench_spec, nonlinear_benchmark
    from scenarios.exchange.exporter import FORMATS, export

__all__ = ["FORMATS", "export", "identibench_spec", "nonlinear_benchmark"]

__getattr__ = lazy_names(__name__, __file__)
