"""The best attainable scores: lower bounds of the error of any model on the scored records of a data set."""

import json
from collections import Counter
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

from hmtb_twin import JointLog, TwinError
from hmtb_twin.files.netcdf import read_netcdf
from hmtb_twin.run.experiment_row import experiment_arm
from scenarios.datasets.arm_truth import arm_truth
from scenarios.datasets.baselines import software
from scenarios.datasets.best_linear_truth import excitation_class
from scenarios.datasets.data_set import open_data_set
from scenarios.datasets.experiment_file import stored_log
from scenarios.datasets.plan import ATTAINABLE, DataSetPlan, PlannedExperiment
from scenarios.datasets.score import in_metric
from scenarios.datasets.spec import DataSetSpec
from scenarios.datasets.tables import table_text
from scenarios.files.errors import ScenarioError
from scenarios.truth.attainable import attainable
from sysid import SysidError

COLUMNS = (
    *("experiment", "joint", "samples", "metric", "unit", "attainable", "attainable_by_chance"),
    *("best_linear", "right_order", "small_signal"),
    *("one_step_attainable", "one_step_best_linear", "one_step_small_signal", "spread_rad", "note"),
)
"""Columns of the table, in the metric and unit of the data set's score; empty where no floor was searched.

`attainable` is of the horizon that the data set is scored at, where that is several steps the floor of one step, which
is below theirs; the linear systems are those in simulation, but for the ones called `one_step`.
"""


def attainable_pieces(plan: DataSetPlan) -> Iterator[str]:
    """Return the records to search, of each class of excitation as many as the spec says, then the table."""
    counts = Counter[Hashable]()
    # Every twin has a record of each class, so the first twins have them all.
    for twin in range(min(plan.twins, plan.spec.truth.floors)):
        for entry in plan.of_twin(twin):
            key = (entry.block, excitation_class(entry))
            counts[key] += entry.part == "test"
            if entry.part == "test" and counts[key] <= plan.spec.truth.floors:
                yield entry.name
    yield "table"


def attainable_files(plan: DataSetPlan, folder: Path, piece: str) -> Mapping[str, bytes]:
    """Search the floors of a record, or gather the table; a piece of a stage of the build."""
    if piece != "table":
        entry = next(entry for entry in plan if entry.name == piece)
        text = json.dumps(_floors(plan.spec, entry, stored_log(folder, entry)), indent=1, allow_nan=False) + "\n"
        return {entry.attainable: text.encode()}
    # The index lists the experiments in the order of the plan.
    scored = [n for n, one in enumerate(open_data_set(folder).index) if one.part == "test" and one.failed is None]
    rows = (row for number in scored for row in _rows(plan.spec, plan[number], folder))
    return {ATTAINABLE: table_text(COLUMNS, rows).encode()}


def _floors(spec: DataSetSpec, entry: PlannedExperiment, log: JointLog) -> dict[str, Any]:
    """All floors of a scored record by joint, rad and percent, with what they rest on; or why there are none."""
    arm, pose = experiment_arm(entry.experiment), entry.experiment.pose
    facts = ("samples", "spread", "order", "distortion", "mean_error", "settling", "memory", "parameters")
    joints: dict[str, Any] = {}
    for joint in entry.joints:
        try:
            truth = arm_truth(arm, pose, spec.truth.amplitudes)
            floors = attainable(log, joint, truth=truth, window=spec.window, steps=spec.truth.search_steps or None)
            joints[joint] = {
                **{name: asdict(getattr(floors, name)) for name in ("simulation", "one_step", "right_order")},
                "by_chance": {
                    horizon: {name: floors.by_chance(one.rmse) for name, one in vars(getattr(floors, horizon)).items()}
                    for horizon in ("simulation", "one_step")
                },
                **{name: getattr(floors, name) for name in facts},
                "provenance": dict(floors.provenance),
            }
        except (ScenarioError, TwinError, SysidError) as error:
            joints[joint] = {"reason": str(error)}
    return {"experiment": entry.name, "window": spec.window, "software": software(), "joints": joints}


def _rows(spec: DataSetSpec, entry: PlannedExperiment, folder: Path) -> Iterator[dict[str, str]]:
    """Rows of a record, one per joint."""
    path = folder / entry.attainable
    floors = json.loads(path.read_bytes())["joints"] if path.is_file() else {}
    # Nothing else is read of the files: a fleet has many.
    measured = read_netcdf(folder / entry.data, only=("y",)).variables["y"].values[spec.window :]
    noise_free = read_netcdf(folder / entry.signals, only=("y_noise_free",)).variables["y_noise_free"].values
    noise = measured - noise_free[spec.window :]
    # How small chance can make the error of a model as good as the floor, once in twenty; see `Attainable.by_chance`.
    luck = float(np.sqrt(max(1.0 - chi2.ppf(0.95, 1) / len(measured), 0.0)))
    for column, joint in enumerate(entry.joints):
        spread, recorder = float(measured[:, column].std()), float(np.sqrt(np.mean(noise[:, column] ** 2)))
        values, note = _values(spec, entry, recorder, floors.get(joint, {}))
        best = values["one_step_attainable"] if spec.scoring.steps else values["attainable"]
        values |= {"attainable": best, "attainable_by_chance": None if best is None else best * luck}
        scores = {
            name: f"{in_metric(spec.scoring, np.array([rmse]), np.array([spread]))[0]:.11g}"
            for name, rmse in values.items()
            if rmse is not None
        }
        yield {
            "experiment": entry.name,
            "joint": joint,
            "samples": str(len(measured)),
            "metric": spec.scoring.metric,
            "unit": spec.scoring.unit,
            **scores,
            "spread_rad": f"{spread:.11g}",
            "note": note,
        }


def _values(
    spec: DataSetSpec, entry: PlannedExperiment, recorder: float, floors: Mapping[str, Any]
) -> tuple[dict[str, float | None], str]:
    """Errors of a row, rad, from the noise of the recorder and the floors that were searched; and a note."""
    # Without noise in the drives the commands determine the noise-free angle.
    certain = not entry.experiment.plant.process_noise
    values = {"attainable": recorder if certain else None, "one_step_attainable": recorder}
    notes = []
    if "reason" in floors:
        notes.append(floors["reason"])
    elif floors:
        values["right_order"] = floors["right_order"]["rmse"]
        for prefix, horizon in (("", "simulation"), ("one_step_", "one_step")):
            values[f"{prefix}attainable"] = floors[horizon]["any_model"]["rmse"]
            values |= {f"{prefix}{name}": floors[horizon][name]["rmse"] for name in ("best_linear", "small_signal")}
    elif not certain:
        notes.append("process noise: the mean response was not searched")
    if spec.scoring.steps and not certain:
        notes.append("process noise: attainable knows what the drives will do; no model does")
    return values, "; ".join(notes)
