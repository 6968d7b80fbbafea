"""What is on disk, and what is registered, recognised by its contents.

All of it runs in the child process of the page: foreign files may hang or crash whoever reads them.
"""

from pathlib import Path

from scenarios.bench.result_tables import open_result
from scenarios.datasets.plan import INDEX, UNFINISHED
from scenarios.datasets.presentation import present_data_set
from scenarios.experiments.presentation import Presentation, present_bus_record, present_log, present_scenario
from scenarios.experiments.registry import load
from scenarios.files.data_file import log_of
from scenarios.files.errors import ScenarioError
from scenarios.files.record_file import ENDINGS, is_record
from scenarios.thesis.opened import open_study
from scenarios.thesis.results import RESULTS

LARGEST = 2**28
"""Largest file that is opened, bytes: a log of an hour has a tenth of it."""

OPENED = (*ENDINGS.values(), ".c10", ".toml", ".json")
"""Endings of files that can be opened."""


def open_place(place: str, part: str = "") -> Presentation:
    """Open a file, a folder or a registered scenario.

    Args:
        place: The path, or the name of the scenario.
        part: Part of a folder, or test of a record of several.

    Raises:
        ScenarioError: There is no such thing, or it is none of those that can be opened.
        TwinError: Likewise, of logs and records of ours.
    """
    path = Path(place).expanduser()
    # A bare word without ending may be the name of a registered scenario.
    if not place or (not path.exists() and (path.suffix in OPENED or path.name != place)):
        raise ScenarioError(f"no file or folder {place!r}; expected its path, or the name of a scenario")
    # A pipe or a device may never end, whatever its name.
    if path.exists() and not path.is_dir() and not (path.is_file() and path.stat().st_size <= LARGEST):
        raise ScenarioError(f"{path}: expected a file of at most {LARGEST // 2**20} MiB")
    if not path.exists() or path.suffix == ".toml":
        return present_scenario(load(place), place)
    # A data set has no index before its build is finished.
    if (path / INDEX).is_file() or path.name.endswith(UNFINISHED):
        return present_data_set(path, part)
    if path.name == RESULTS or (path / RESULTS).is_file():
        folder = path if path.is_dir() else path.parent
        return open_study(folder, part)
    if path.is_file() and path.suffix == ".json":
        return open_result(path)
    # Before bus records: a log has the ending of a record, and holds more.
    if path.is_file() and (log := log_of(path)) is not None:
        return present_log(log, str(path))
    if path.is_file() and (path.suffix == ".nc" or is_record(path)):
        return present_bus_record(path, part)
    raise ScenarioError(
        f"{path}: expected a log or a record of the arm, a result of hmtb verify or a scenario ({', '.join(OPENED)}) "
        "or the folder of a data set or a study; tables from elsewhere are for the tab Identify"
    )


def files_in(folder: Path) -> list[str]:
    """Names of what can be opened in a folder, sorted."""
    if not folder.is_dir():
        return []
    # A name that no terminal shows cannot be chosen from a menu either.
    paths = [path for path in folder.iterdir() if path.name.isprintable()]
    return sorted(path.name for path in paths if _can_be_opened(path))


def _can_be_opened(path: Path) -> bool:
    return path.suffix in OPENED or (path / INDEX).is_file() or (path / RESULTS).is_file()
