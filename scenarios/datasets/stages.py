"""What a data set has beside its records: truth of the arms, stages of work after the experiments, metadata."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Protocol

from scenarios.datasets.arm_truth import arm_files
from scenarios.datasets.attainable_scores import AttainableStage
from scenarios.datasets.baselines import BaselineStage
from scenarios.datasets.best_linear_truth import BestLinearStage
from scenarios.datasets.metadata import metadata_files
from scenarios.datasets.plan import DataSetPlan, PlannedExperiment
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.netcdf import Contents


class Stage(Protocol):
    """Work on the records of a data set, in pieces of which each is done once.

    The builder writes the files and keeps each piece in the journal, as it does with experiments; a stage writes
    nothing itself.
    """

    @property
    def name(self) -> str:
        """Name of the stage, one word: ``"baselines"``."""

    def pieces(self, plan: DataSetPlan) -> Iterable[str]:
        """Names of its pieces of work, the same and in the same order at every call.

        Args:
            plan: The experiments.
        """

    def make(self, plan: DataSetPlan, folder: Path, piece: str) -> Mapping[str, Contents | bytes]:
        """Make the files of a piece.

        Args:
            plan: The experiments.
            folder: Folder of the records, the index and the files of earlier stages and pieces.
            piece: Its name.

        Returns:
            Contents of files by path in the folder.

        Raises:
            ScenarioError: The piece cannot be made; also `TwinError` and `SysidError`. The reason stands in the index,
                and the build continues. Any other error stops it.
        """


ArmTruth = Callable[[DataSetPlan, PlannedExperiment], Mapping[str, Contents]]
"""Makes the truth about the arm that an experiment runs on, by path in the folder."""

MetadataWriter = Callable[[Path, DataSetSpec, Mapping[str, Any]], Mapping[str, bytes]]
"""Makes files about a whole data set from its folder, spec and index, by path in the folder."""

ARM_TRUTH: tuple[ArmTruth, ...] = (arm_files,)
"""Run with the first experiment of every arm, by the process that simulated it, while the arm is still loaded."""

STAGES: tuple[Stage, ...] = (BestLinearStage(), AttainableStage(), BaselineStage())
"""Run one after the other when all experiments and the index are there."""

METADATA: tuple[MetadataWriter, ...] = (metadata_files,)
"""Run after the stages."""
