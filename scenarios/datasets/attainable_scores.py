"""The best attainable scores: lower bounds of the error of any model on the scored records of a data set."""

import csv
import io
import json
from collections import Counter
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

from hmtb_twin import JointLog, TwinError
from scenarios.datasets.arm_truth import arm_truth
from scenarios.datasets.baselines import software
from scenarios.datasets.best_linear_truth import excitation_class
from scenarios.datasets.data_set import open_data_set
from scenarios.datasets.experiment_file import stored_log
from scenarios.datasets.plan import ATTAINABLE, DataSetPlan, PlannedExperiment, attainable_file
from scenarios.datasets.score import in_metric
from scenarios.datasets.spec import DataSetSpec
from scenarios.experiments.logged_arm import experiment_arm
from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import read_netcdf
from scenarios.truth.attainable import Attainable, attainable
from sysid import SysidError

TABLE = "table"
"""The last piece of the stage, which gathers the scores of all records."""

COLUMNS = (
    "experiment",
    "joint",
    "samples",
    "metric",
    "unit",
    "attainable",
    "attainable_by_chance",
    "best_linear",
    "right_order",
    "small_signal",
    "one_step_attainable",
    "one_step_best_linear",
    "one_step_small_signal",
    "spread_rad",
    "note",
)
"""Columns of the table, in the metric and unit of the data set's score; empty where no floor was searched.

`attainable` is of the horizon that the data set is scored at, where that is several steps the floor of one step, which
is below theirs; the linear systems are those in simulation, but for the ones called `one_step`.
"""


@dataclass(frozen=True)
class AttainableStage:
    """The stage of a build that searches the attainable scores that the spec asks for, and gathers their table."""

    name: str = field(default="attainable", init=False)

    def pieces(self, plan: DataSetPlan) -> Iterable[str]:
        """Return the records to search, of each class of excitation as many as the spec says, then the table."""
        counts = Counter[Hashable]()
        # Every twin has a record of each class, so the first twins have them all.
        twins = min(plan.twins, plan.spec.truth.floors)
        for entry in plan[: twins * (len(plan) // plan.twins)]:
            key = (entry.block, excitation_class(entry))
            counts[key] += entry.part == "test"
            if entry.part == "test" and counts[key] <= plan.spec.truth.floors:
                yield entry.name
        yield TABLE

    def make(self, plan: DataSetPlan, folder: Path, piece: str) -> Mapping[str, bytes]:
        """Search the floors of a record, or gather the table; see `Stage.make`."""
        if piece != TABLE:
            entry = next(entry for entry in plan if entry.name == piece)
            text = json.dumps(_floors(plan.spec, entry, stored_log(folder, entry)), indent=1, allow_nan=False) + "\n"
            return {str(attainable_file(piece)): text.encode()}
        stream = io.StringIO()
        writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
        writer.writeheader()
        # The index lists the experiments in the order of the plan.
        for number, line in enumerate(open_data_set(folder).index):
            if line.part == "test" and line.failed is None:
                writer.writerows(_rows(plan.spec, plan[number], folder))
        return {ATTAINABLE: stream.getvalue().encode()}


def _floors(spec: DataSetSpec, entry: PlannedExperiment, log: JointLog) -> dict[str, Any]:
    """All floors of a scored record by joint, rad and percent, with what they rest on; or why there are none."""
    arm, pose = experiment_arm(entry.experiment), entry.experiment.pose
    joints: dict[str, Any] = {}
    for joint in entry.joints:
        try:
            truth = arm_truth(arm, pose, spec.truth.amplitudes)
            floors = attainable(log, joint, truth=truth, window=spec.window, steps=spec.truth.search_steps or None)
            joints[joint] = _table(floors)
        except (ScenarioError, TwinError, SysidError) as error:
            joints[joint] = {"reason": str(error)}
    return {"experiment": entry.name, "window": spec.window, "software": software(), "joints": joints}


def _table(floors: Attainable) -> dict[str, Any]:
    by_chance = {
        horizon: {name: floors.by_chance(floor.rmse) for name, floor in vars(getattr(floors, horizon)).items()}
        for horizon in ("simulation", "one_step")
    }
    facts = ("samples", "spread", "order", "distortion", "mean_error", "settling", "memory", "parameters")
    return {
        **{name: asdict(getattr(floors, name)) for name in ("simulation", "one_step", "right_order")},
        "by_chance": by_chance,
        **{name: getattr(floors, name) for name in facts},
        "provenance": dict(floors.provenance),
    }


def _rows(spec: DataSetSpec, entry: PlannedExperiment, folder: Path) -> Iterable[dict[str, str]]:
    """The rows of a record, one per joint."""
    path = folder / attainable_file(entry.name)
    floors = json.loads(path.read_bytes())["joints"] if path.is_file() else {}
    # Nothing else is read of the files: a fleet has many.
    measured = read_netcdf(folder / entry.data, only=("y",)).variables["y"].values[spec.window :]
    noise_free = read_netcdf(folder / entry.signals, only=("y_noise_free",)).variables["y_noise_free"].values
    noise = measured - noise_free[spec.window :]
    for column, joint in enumerate(entry.joints):
        yield _row(spec, entry, joint, measured[:, column], noise[:, column], floors.get(joint, {}))


def _row(
    spec: DataSetSpec, entry: PlannedExperiment, joint: str, measured: np.ndarray, noise: np.ndarray, floors: Any
) -> dict[str, str]:
    """A row from the measured angles (N,) and their noise (N,), rad, and the floors that were searched."""
    spread, recorder = float(measured.std()), float(np.sqrt(np.mean(noise**2)))
    # Without noise in the drives the commands determine the noise-free angle.
    certain = not entry.experiment.plant.process_noise
    values = {"attainable": recorder if certain else None, "one_step_attainable": recorder}
    notes = []
    if "reason" in floors:
        notes.append(floors["reason"])
    elif floors:
        simulation, one_step = floors["simulation"], floors["one_step"]
        values |= {
            "attainable": simulation["any_model"]["rmse"],
            "best_linear": simulation["best_linear"]["rmse"],
            "small_signal": simulation["small_signal"]["rmse"],
            "right_order": floors["right_order"]["rmse"],
            "one_step_attainable": one_step["any_model"]["rmse"],
            "one_step_best_linear": one_step["best_linear"]["rmse"],
            "one_step_small_signal": one_step["small_signal"]["rmse"],
        }
    elif not certain:
        notes.append("process noise: the mean response was not searched")
    if spec.scoring.steps and not certain:
        notes.append("process noise: attainable knows what the drives will do; no model does")
    best = values["one_step_attainable"] if spec.scoring.steps else values["attainable"]
    # How small chance can make the error of a model as good as the floor, once in twenty; see `Attainable.by_chance`.
    luck = float(np.sqrt(max(1.0 - chi2.ppf(0.95, 1) / len(measured), 0.0)))
    values |= {"attainable": best, "attainable_by_chance": None if best is None else best * luck}
    scores = {
        name: f"{in_metric(spec.scoring, np.array([rmse]), np.array([spread]))[0]:.11g}"
        for name, rmse in values.items()
        if rmse is not None
    }
    return {
        **dict.fromkeys(COLUMNS, ""),
        "experiment": entry.name,
        "joint": joint,
        "samples": str(len(measured)),
        "metric": spec.scoring.metric,
        "unit": spec.scoring.unit,
        **scores,
        "spread_rad": f"{spread:.11g}",
        "note": "; ".join(notes),
    }
