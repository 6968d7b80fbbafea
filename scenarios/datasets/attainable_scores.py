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
from scenarios.datasets.spec import DataSetSpec, Scoring
from scenarios.datasets.tables import table_text
from scenarios.files.errors import ScenarioError
from scenarios.truth.attainable import Attainable, attainable
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
        for planned in plan.of_twin(twin):
            if planned.part != "test":
                continue
            record_class = (planned.block, excitation_class(planned))
            counts[record_class] += 1
            if counts[record_class] <= plan.spec.truth.floors:
                yield planned.name
    yield "table"


def attainable_files(plan: DataSetPlan, folder: Path, piece: str) -> Mapping[str, bytes]:
    """Search the floors of a record, or gather the table; a piece of a stage of the build."""
    if piece != "table":
        planned = next(planned for planned in plan if planned.name == piece)
        floors = _floors(plan.spec, planned, stored_log(folder, planned))
        return {planned.attainable: f"{json.dumps(floors, indent=1, allow_nan=False)}\n".encode()}
    rows: list[dict[str, str]] = []
    # The index lists the experiments in the order of the plan.
    for index, record in enumerate(open_data_set(folder).index):
        if record.part == "test" and record.failed is None:
            rows += _rows(plan.spec, plan[index], folder)
    return {ATTAINABLE: table_text(COLUMNS, rows).encode()}


def _floors(spec: DataSetSpec, planned: PlannedExperiment, log: JointLog) -> dict[str, Any]:
    """All floors of a scored record by joint, rad and percent, with what they rest on; or why there are none."""
    arm, pose = experiment_arm(planned.experiment), planned.experiment.pose
    joints: dict[str, Any] = {}
    for joint in planned.joints:
        try:
            truth = arm_truth(arm, pose, spec.truth.amplitudes)
            steps = spec.truth.search_steps or None
            floors = attainable(log, joint, truth=truth, window=spec.window, steps=steps)
            joints[joint] = _floors_as_json(floors)
        except (ScenarioError, TwinError, SysidError) as error:
            joints[joint] = {"reason": str(error)}
    return {"experiment": planned.name, "window": spec.window, "software": software(), "joints": joints}


def _floors_as_json(floors: Attainable) -> dict[str, Any]:
    """The floors of one joint as they are published."""
    by_chance: dict[str, dict[str, float]] = {}
    for horizon in ("simulation", "one_step"):
        models = vars(getattr(floors, horizon))
        by_chance[horizon] = {name: floors.by_chance(floor.rmse) for name, floor in models.items()}
    facts = ("samples", "spread", "order", "distortion", "mean_error", "settling", "memory", "parameters")
    return {
        **{name: asdict(getattr(floors, name)) for name in ("simulation", "one_step", "right_order")},
        "by_chance": by_chance,
        **{name: getattr(floors, name) for name in facts},
        "provenance": dict(floors.provenance),
    }


def _rows(spec: DataSetSpec, planned: PlannedExperiment, folder: Path) -> Iterator[dict[str, str]]:
    """Rows of attainable scores of a record, one per joint."""
    path = folder / planned.attainable
    # Of each class only as many records were searched as the spec says.
    floors = json.loads(path.read_bytes())["joints"] if path.is_file() else {}
    # Nothing else is read of the files: a fleet has many.
    measured = read_netcdf(folder / planned.data, only=("y",)).variables["y"].values[spec.window :]
    noise_free = read_netcdf(folder / planned.signals, only=("y_noise_free",)).variables["y_noise_free"].values
    noise = measured - noise_free[spec.window :]
    # How small chance can make the error of a model as good as the floor, once in twenty; see `Attainable.by_chance`.
    chance_factor = float(np.sqrt(max(1.0 - chi2.ppf(0.95, 1) / len(measured), 0.0)))
    for column, joint in enumerate(planned.joints):
        spread = float(measured[:, column].std())
        recorder_rmse = float(np.sqrt(np.mean(noise[:, column] ** 2)))
        errors, note = _errors(spec, planned, recorder_rmse, floors.get(joint, {}))
        best = errors["one_step_attainable"] if spec.scoring.steps else errors["attainable"]
        errors["attainable"] = best
        errors["attainable_by_chance"] = None if best is None else best * chance_factor
        yield {
            "experiment": planned.name,
            "joint": joint,
            "samples": str(len(measured)),
            "metric": spec.scoring.metric,
            "unit": spec.scoring.unit,
            **_scores(spec.scoring, errors, spread),
            "spread_rad": f"{spread:.11g}",
            "note": note,
        }


def _scores(scoring: Scoring, errors: Mapping[str, float | None], spread: float) -> dict[str, str]:
    """Errors, rad, as scores in the metric of the data set; those that are not known are left out."""
    scores: dict[str, str] = {}
    for name, rmse in errors.items():
        if rmse is not None:
            score = in_metric(scoring, np.array([rmse]), np.array([spread]))[0]
            # Eleven digits, so that rounding on another machine is no difference.
            scores[name] = f"{score:.11g}"
    return scores


def _errors(
    spec: DataSetSpec, planned: PlannedExperiment, recorder_rmse: float, floors: Mapping[str, Any]
) -> tuple[dict[str, float | None], str]:
    """Errors of a row, rad, from the noise of the recorder and the floors that were searched; and a note."""
    # Without noise in the drives the commands determine the noise-free angle.
    drives_are_noise_free = not planned.experiment.plant.process_noise
    simulation_rmse = recorder_rmse if drives_are_noise_free else None
    errors = {"attainable": simulation_rmse, "one_step_attainable": recorder_rmse}
    notes = []
    if "reason" in floors:
        notes.append(floors["reason"])
    elif floors:
        errors["right_order"] = floors["right_order"]["rmse"]
        for prefix, horizon in (("", "simulation"), ("one_step_", "one_step")):
            errors[f"{prefix}attainable"] = floors[horizon]["any_model"]["rmse"]
            for name in ("best_linear", "small_signal"):
                errors[f"{prefix}{name}"] = floors[horizon][name]["rmse"]
    elif not drives_are_noise_free:
        notes.append("process noise: the mean response was not searched")
    if spec.scoring.steps and not drives_are_noise_free:
        notes.append("process noise: attainable knows what the drives will do; no model does")
    return errors, "; ".join(notes)
