"""Long work: run it in batches here or on a cluster, keep it in a journal from which it resumes, show its progress."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.jobs.cluster import Cluster
    from scenarios.jobs.executor import Executor, LocalProcesses
    from scenarios.jobs.journal import Journal

__all__ = ["Cluster", "Executor", "Journal", "LocalProcesses"]

_MODULES = {"Cluster": "cluster", "Executor": "executor", "Journal": "journal", "LocalProcesses": "executor"}


def __getattr__(name: str) -> object:
    # The command line's help does not wait for NumPy and Dask.
    if name not in _MODULES:
        raise AttributeError(f"module 'scenarios.jobs' has no attribute {name!r}")
    return getattr(import_module(f"scenarios.jobs.{_MODULES[name]}"), name)
