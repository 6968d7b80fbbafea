"""What is made of a data set beside its records, and in which order: where every other part of the work hooks in."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from scenarios.datasets.arm_truth import arm_files
from scenarios.datasets.attainable_scores import AttainableStage
from scenarios.datasets.baselines import BaselineStage
from scenarios.datasets.best_linear_truth import BestLinearStage
from scenarios.datasets.metadata import metadata_files
from scenarios.datasets.plan import DataSetPlan, PlannedExperiment
from scenarios.datasets.spec import DataSetSpec
from scenarios.datasets.stage import Stage
from scenarios.files.netcdf import Contents

ArmTruth = Callable[[DataSetPlan, PlannedExperiment], Mapping[str, Contents]]
"""Makes the files of the truth about the arm that an experiment runs on, by place in the folder."""

Papers = Callable[[Path, DataSetSpec, Mapping[str, Any]], Mapping[str, bytes]]
"""Makes the files that say something of a whole data set (its folder, spec and index), by place in the folder; the same
bytes at every call."""

ARM_TRUTH: tuple[ArmTruth, ...] = (arm_files,)
"""Run with the first experiment of every arm, by the process that ran it, while the arm is still loaded; the files
are noted with those of the experiment. Errors of ours (`TwinError`, `ScenarioError`) are noted; the rest goes on."""

STAGES: tuple[Stage, ...] = (BestLinearStage(), AttainableStage(), BaselineStage())
"""Run one after the other when all experiments and the index are there."""

PAPERS: tuple[Papers, ...] = (metadata_files,)
"""Run after the stages, at every build that comes so far. The builder writes the checksums of all files last."""
