"""Minima of prediction errors that were found before, kept for the searches of other structures.

The search of a structure tries smaller ones on the way, and so does that of its neighbours: a scan of orders on one
record would repeat a fifth of its minimisations.
"""

import hashlib
from collections.abc import Callable, Hashable, Sequence
from threading import Lock
from typing import Generic, TypeVar

from sysid.records.data import IOData

Result = TypeVar("Result")


class RecentResults(Generic[Result]):
    """Results of a deterministic computation by what it depends on; the oldest ones are forgotten.

    Args:
        capacity: Number of results.
    """

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._results: dict[Hashable, Result] = {}
        self._lock = Lock()

    def get(self, key: Hashable, compute: Callable[[], Result]) -> Result:
        """The result of a key, computed now unless it is there; threads may compute the same one twice."""
        result = self._results.get(key)
        if result is None:
            result = compute()
            with self._lock:
                self._results[key] = result
                while len(self._results) > self._capacity:
                    # a dictionary keeps the order of insertion
                    del self._results[next(iter(self._results))]
        return result


def fingerprint(experiments: Sequence[IOData]) -> bytes:
    """Digest of the samples of experiments, their gaps, and where their estimation begins."""
    digest = hashlib.blake2b()
    for experiment in experiments:
        digest.update(repr((experiment.y.shape, experiment.u.shape, experiment.window)).encode())
        digest.update(experiment.y.tobytes())
        digest.update(experiment.u.tobytes())
    return digest.digest()
