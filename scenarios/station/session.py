"""What the tabs of the station share: the experiment being prepared, and the records made so far."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hmtb_twin import JointLog
from hmtb_twin.files.atomic_write import write_whole
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.scenario import Scenario


@dataclass
class Session:
    """State of the station, which outlives the browsers that show it.

    Attributes:
        folder: Where files are written.
        scenario: The experiment being prepared.
        records: Logs by name: runs, drives and logs that were opened, in the order in which they came.
        shown: Name of the record that other tabs begin with; empty if there is none.
        memory: What single tabs remember from one browser to the next, by their titles.
        waveform: The excitation being prepared; None as long as it is that of the experiment.
        waveform_file: Name of the file that its points come from, if they come from a file.
        arm: The arm that the station operates.
    """

    folder: Path
    scenario: Scenario
    records: dict[str, JointLog] = field(default_factory=dict)
    shown: str = ""
    memory: dict[str, Any] = field(default_factory=dict)
    waveform: Excitation | None = None
    waveform_file: str = "points.txt"
    arm: str = "nominal"
    _watchers: list[Callable[[], None]] = field(default_factory=list)

    def watch(self, changed: Callable[[], None]) -> None:
        """Call a function whenever something of this changes, until `forget_watchers`."""
        self._watchers.append(changed)

    def forget_watchers(self) -> None:
        """Forget all watchers: the browser that they filled has gone."""
        self._watchers.clear()

    def prepare(self, scenario: Scenario) -> None:
        """Take another experiment."""
        self.scenario = scenario
        self.tell()

    def keep(self, log: JointLog) -> str:
        """Keep a log and return its name, with a number behind it if the name was taken."""
        name, number = log.name, 2
        while name in self.records:
            name, number = f"{log.name}-{number}", number + 1
        self.records[name] = log
        self.shown = name
        self.tell()
        return name

    def file_of(self, name: str) -> Path:
        """Write a record into the folder, unless a file there holds it; files with other contents stay.

        Returns:
            The file: NAME.nc, with a number behind the name if that is taken.
        """
        with TemporaryDirectory() as folder:
            content = self.records[name].save(Path(folder) / "log.nc").read_bytes()
        path, number = self.folder / f"{name}.nc", 2
        while path.exists() and not (path.is_file() and path.read_bytes() == content):
            path, number = self.folder / f"{name}-{number}.nc", number + 1
        if not path.exists():
            self.folder.mkdir(parents=True, exist_ok=True)
            write_whole(path, content)
        return path

    def tell(self) -> None:
        """Call all watchers: something that the tabs share has changed."""
        # Of a copy: a watcher may add another one.
        for changed in list(self._watchers):
            changed()
