"""The best attainable score: what no model can go below on the scored records of a data set."""

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
from scenarios.datasets.layout import ATTAINABLE, attainable_file
from scenarios.datasets.plan import DataSetPlan, PlannedExperiment
from scenarios.datasets.score import in_metric
from scenarios.datasets.spec import DataSetSpec
from scenarios.datasets.spec_tables import Scoring
from scenarios.experiments.logged_arm import experiment_arm
from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import read_netcdf
from scenarios.truth.attainable import Attainable, attainable
from sysid import SysidError

TABLE = "table"
"""The last piece of the stage, that gathers the floors of all records."""

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
"""Columns of the table: floors in the metric and unit of the data set's score; empty where one was not searched.

`attainable` is of the horizon that the data set is scored at, where that is several steps the floor of one step, which
is below theirs; the linear systems are those in simulation, but for the ones called `one_step`.
"""


@dataclass(frozen=True)
class AttainableStage:
    """Finds the floors that a spec asks for, a file for each record, and the table of them.

    Attributes:
        name: What it makes.
    """

    name: str = field(default="attainable", init=False)

    def pieces(self, plan: DataSetPlan) -> Iterable[str]:
        """Names of the records whose floors are searched, then the table."""
        return [*searched(plan), TABLE]

    def make(self, plan: DataSetPlan, folder: Path, piece: str) -> Mapping[str, bytes]:
        """Search the floors of a record, or gather all.

        Args:
            plan: The experiments.
            folder: Where the data set stands.
            piece: A record, or `TABLE`.

        Raises:
            ScenarioError: A damaged file.
        """
        if piece != TABLE:
            entry = next(entry for entry in plan if entry.name == piece)
            content = json.dumps(floors(plan.spec, entry, stored_log(folder, entry)), indent=1, allow_nan=False) + "\n"
            return {str(attainable_file(piece)): content.encode()}
        # The index lists the experiments in the order of the plan.
        listed = enumerate(open_data_set(folder).index)
        scored = (plan[number] for number, line in listed if line.part == "test" and line.failed is None)
        rows = [row for entry in scored for row in _rows(plan.spec, entry, folder)]
        return {ATTAINABLE: _csv(rows)}


def searched(plan: DataSetPlan) -> tuple[str, ...]:
    """Names of the records whose floors are searched: of each class of excitation as many as the spec says.

    Args:
        plan: The experiments.
    """
    counts = Counter[Hashable]()
    names = []
    # Every twin has a record of each class, so the first twins have them all.
    twins = min(plan.twins, plan.spec.truth.floors)
    for entry in plan[: twins * (len(plan) // plan.twins)]:
        if entry.part != "test":
            continue
        key = (entry.block, excitation_class(entry))
        counts[key] += 1
        if counts[key] <= plan.spec.truth.floors:
            names.append(entry.name)
    return tuple(names)


def floors(spec: DataSetSpec, entry: PlannedExperiment, log: JointLog) -> dict[str, Any]:
    """All floors of a scored record, with what stands behind them, for each of its joints.

    Args:
        spec: The data set.
        entry: The experiment.
        log: Its log.

    Returns:
        By joint what `scenarios.truth.attainable.Attainable` holds, in rad and percent, with `by_chance`: how small
        chance         can make the error of a model that is as good, once in twenty times; or why there are none.
    """
    arm, pose = experiment_arm(entry.experiment), entry.experiment.pose
    found: dict[str, Any] = {"experiment": entry.name, "window": spec.window, "software": software(), "joints": {}}
    for joint in entry.joints:
        try:
            truth = arm_truth(arm, pose, spec.truth.amplitudes)
            one = attainable(log, joint, truth=truth, window=spec.window, steps=spec.truth.search_steps or None)
        except (ScenarioError, TwinError, SysidError) as error:
            found["joints"][joint] = {"reason": str(error)}
            continue
        found["joints"][joint] = _record(one)
    return found


def _record(found: Attainable) -> dict[str, Any]:
    text = {name: getattr(found, name) for name in ("simulation", "one_step", "right_order")}
    chance = {
        horizon: {name: found.by_chance(floor.rmse) for name, floor in vars(getattr(found, horizon)).items()}
        for horizon in ("simulation", "one_step")
    }
    return {
        **{name: asdict(value) for name, value in text.items()},
        "by_chance": chance,
        **{
            name: getattr(found, name)
            for name in ("samples", "spread", "order", "distortion", "mean_error", "settling", "memory", "parameters")
        },
        "provenance": dict(found.provenance),
    }


@dataclass(frozen=True, eq=False)
class ScoredAngles:
    """The angles of a joint behind the window of a record, rad.

    Attributes:
        measured: As recorded (N,).
        true: Free of the recorder's noise, as late as in the record (N,).
    """

    measured: np.ndarray
    true: np.ndarray

    @property
    def noise(self) -> float:
        """Root mean square of what nobody can foretell who knows the noise-free angle: noise of the recorder."""
        return float(np.sqrt(np.mean((self.measured - self.true) ** 2)))


def scored_angles(folder: Path, entry: PlannedExperiment, window: int) -> Mapping[str, ScoredAngles]:
    """The angles of each joint of a record that are scored; nothing else is read of the files.

    Args:
        folder: The data set.
        entry: The experiment.
        window: Samples that are not scored.

    Raises:
        ScenarioError: A file is missing or damaged.
    """
    measured = read_netcdf(folder / entry.data, only=("y",)).variables["y"].values
    true = read_netcdf(folder / entry.signals, only=("y_noise_free",)).variables["y_noise_free"].values
    return {
        joint: ScoredAngles(measured[window:, column], true[window:, column])
        for column, joint in enumerate(entry.joints)
    }


def by_chance(rmse: float, samples: int) -> float:
    """How small chance can make the error of a model as good as a floor; see `Attainable.by_chance`."""
    return rmse * float(np.sqrt(max(1.0 - chi2.ppf(0.95, 1) / samples, 0.0)))


def _rows(spec: DataSetSpec, entry: PlannedExperiment, folder: Path) -> Iterable[dict[str, str]]:
    place = folder / attainable_file(entry.name)
    kept = json.loads(place.read_bytes())["joints"] if place.is_file() else {}
    for joint, angles in scored_angles(folder, entry, spec.window).items():
        yield _row(spec, entry, angles, joint, kept.get(joint))


def _row(
    spec: DataSetSpec, entry: PlannedExperiment, angles: ScoredAngles, joint: str, kept: Mapping[str, Any] | None
) -> dict[str, str]:
    scored = angles.measured
    spread, recorder = float(scored.std()), angles.noise
    # Without noise in the drives the commands foretell the noise-free angle.
    certain = not entry.experiment.plant.process_noise
    values = {"attainable": recorder if certain else None, "one_step_attainable": recorder}
    note = "" if kept or certain else "process noise: the mean response was not searched"
    if kept and "reason" not in kept:
        simulation, one_step = kept["simulation"], kept["one_step"]
        values |= {
            "attainable": simulation["any_model"]["rmse"],
            "best_linear": simulation["best_linear"]["rmse"],
            "small_signal": simulation["small_signal"]["rmse"],
            "right_order": kept["right_order"]["rmse"],
            "one_step_attainable": one_step["any_model"]["rmse"],
            "one_step_best_linear": one_step["best_linear"]["rmse"],
            "one_step_small_signal": one_step["small_signal"]["rmse"],
        }
    elif kept:
        note = kept["reason"]
    if spec.scoring.steps and not certain:
        note = "; ".join(filter(None, (note, "process noise: attainable knows what the drives will do; no model does")))
    best = values["one_step_attainable"] if spec.scoring.steps else values["attainable"]
    values |= {"attainable": best, "attainable_by_chance": None if best is None else by_chance(best, len(scored))}
    return {
        **dict.fromkeys(COLUMNS, ""),
        "experiment": entry.name,
        "joint": joint,
        "samples": str(len(scored)),
        "metric": spec.scoring.metric,
        "unit": spec.scoring.unit,
        **{name: _written(spec.scoring, value, spread) for name, value in values.items()},
        "spread_rad": f"{spread:.11g}",
        "note": note,
    }


def _written(scoring: Scoring, rmse: float | None, spread: float) -> str:
    if rmse is None:
        return ""
    (value,) = in_metric(scoring, np.array([rmse]), np.array([spread]))
    return f"{value:.11g}"


def _csv(rows: Iterable[Mapping[str, str]]) -> bytes:
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()
