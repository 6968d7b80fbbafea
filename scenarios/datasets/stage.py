"""Work on a data set after its experiments, in pieces of which each is done once."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Protocol

from scenarios.datasets.plan import DataSetPlan
from scenarios.files.netcdf import Contents


class Stage(Protocol):
    """Makes files from the records that are there, piece by piece.

    The builder writes the files and notes each piece in the manifest, as it does with experiments: a build that goes on
    after a kill makes only the pieces that are missing. A stage writes nothing itself.
    """

    @property
    def name(self) -> str:
        """What it makes, one word: ``"baselines"``."""

    def pieces(self, plan: DataSetPlan) -> Iterable[str]:
        """Names of its pieces of work, the same and in the same order at every call.

        Args:
            plan: The experiments.
        """

    def make(self, plan: DataSetPlan, folder: Path, piece: str) -> Mapping[str, Contents | bytes]:
        """Make the files of a piece.

        Args:
            plan: The experiments.
            folder: Where the records, the index of all experiments and the files of earlier stages and pieces stand.
            piece: Its name.

        Returns:
            Contents of files by place in the folder. Those of NetCDF files are noted with their array hashes.

        Raises:
            ValueError: One of ours (`ScenarioError`, `TwinError`, `SysidError`): the piece cannot be made. The reason
                is noted, the rest goes on. Any other error stops the build.
        """
