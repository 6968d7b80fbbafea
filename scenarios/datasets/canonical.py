"""Data sets of the package from a cache, and their canonical hashes, by which all users have the same records."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

from scenarios.datasets.build import build
from scenarios.datasets.check import examine
from scenarios.datasets.data_set import DataSet, cache_folder, open_data_set
from scenarios.datasets.spec import shipped
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.toml_file import package_table
from scenarios.jobs.progress import Report, show_progress

SHOWN = 3
"""Problems of a damaged copy that are named."""


class Canonical(NamedTuple):
    """Canonical hash, size and build time of a data set in this release.

    Attributes:
        records: Hash of its records, see `DataSet.records_hash`.
        megabytes: Size.
        minutes: Time of a build on two processors.
    """

    records: str
    megabytes: int
    minutes: float


def load_dataset(
    name: str, *, cache: str | Path | None = None, workers: int | None = None, progress: Report | None = None
) -> DataSet:
    """Return a data set of the package: the copy in the cache, checked to the last bit, or one that is built there.

    `canonical_verdict` says whether its records are those that the release names.

    Args:
        name: Name with version, as `hmtb dataset list` prints it.
        cache: Folder of the copies; by default that of the variable HMTB_CACHE, else hmtb-twin in the user's cache.
        workers: Threads for the physics; all processors by default. The bits do not depend on it.
        progress: Called with the progress; without it stderr shows a bar on a terminal, else a line now and then.

    Raises:
        ScenarioError: No such data set, or a copy whose bits have changed.
    """
    if name not in shipped():
        raise ScenarioError(unknown("data set", name, shipped(), listing="hmtb dataset list"))
    if progress is None:
        with show_progress(name) as report:
            return load_dataset(name, cache=cache, workers=workers, progress=report)
    folder = cache_folder() if cache is None else Path(cache)
    if not (folder / name).exists():
        return build(shipped()[name], folder, workers=workers, progress=progress)
    # Against its own hashes alone: a simulation takes longer, and may round otherwise on another processor.
    problems = examine(folder / name, regenerate=0, workers=workers, progress=progress).problems
    if problems:
        and_more = f"; and {len(problems) - SHOWN} more" if len(problems) > SHOWN else ""
        raise ScenarioError(
            f"{folder / name} is damaged: {'; '.join(problems[:SHOWN])}{and_more}. Remove the folder, and it is built "
            "again"
        )
    return open_data_set(folder / name)


@cache
def canonical() -> Mapping[str, Canonical]:
    """Return canonical hash, size and build time of the data sets of this release, by name."""
    return {name: Canonical(**table) for name, table in package_table("canonical.toml").items()}


def canonical_verdict(data_set: DataSet) -> tuple[bool, str]:
    """Return whether the records have the canonical hash of this release, and a line that says so."""
    # Twelve digits tell the hashes of all releases apart, and a reader can compare them.
    records = f"{data_set.label}: records {data_set.records_hash[:12]}"
    release = canonical().get(data_set.label)
    if release is None:
        return True, f"{records}; this release names no canonical hash"
    if data_set.records_hash == release.records:
        return True, f"{records}, the canonical ones of this release"
    reason = "built with other versions, or on another kind of processor: hmtb dataset check tells how near they are"
    return False, f"{records}, not the canonical ones {release.records[:12]} of this release; {reason}"
