"""Long work: run it in batches here or on a cluster, keep it in a journal from which it resumes, show its progress."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.jobs.cluster import Cluster
    from scenarios.jobs.executor import Executor, LocalProcesses
    from scenarios.jobs.journal import Journal

__all__ = ["Cluster", "Executor", "Journal", "LocalProcesses"]

__getattr__ = lazy_names(__name__, __file__)
