"""The two files of an experiment: what an analyst sees, and what only the simulation knows; written and read."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hmtb_twin import JointLog, simulate
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.bus.joint_log import WRENCH
from hmtb_twin.bus.recorder import delayed
from hmtb_twin.control.experiment import Status
from hmtb_twin.files.netcdf import Attribute, Contents, Variable, read_netcdf
from hmtb_twin.parameters.values import SAMPLE_RATE, SAMPLE_TIME
from hmtb_twin.run.experiment_row import experiment_arm
from scenarios.datasets.data_set import DataSet
from scenarios.datasets.plan import LICENSE, DataSetPlan, PlannedExperiment
from scenarios.datasets.spec import DataSetSpec
from scenarios.datasets.variables import netcdf_variables, provenance_attributes, provenance_of
from scenarios.files.errors import ScenarioError

FORMAT = "hmtb data set 1"
"""Marks the files of this version."""

XYZ = ("x", "y", "z")
"""Components of a vector."""


def data_contents(spec: DataSetSpec, planned: PlannedExperiment, log: JointLog) -> Contents:
    """Return what an analyst may see of an experiment.

    Returns:
        `u` (sample, input) and `y` (sample, output), rad; time, s; flags of the control computer; where the spec asks
        for all channels also the other joints, and force and torque at the wrist.
    """
    studied = [log.joint_index(name) for name in planned.joints]
    values = {
        "sample": np.arange(len(log), dtype=np.int64),
        "t": np.arange(len(log)) / SAMPLE_RATE,
        "input": planned.joints,
        "output": planned.joints,
        "u": log.commanded[:, studied],
        "y": log.measured[:, studied],
        "status": log.status,
    }
    variables = netcdf_variables("data", values)
    variables["status"] = _with_flag_meanings(variables["status"])
    if spec.channels == "all":
        unstudied = [index for index in range(len(log.joints)) if index not in studied]
        values_beside = {
            "joint": [log.joints[index] for index in unstudied],
            "component": XYZ,
            "joint_commanded": log.commanded[:, unstudied],
            "joint_measured": log.measured[:, unstudied],
            # The wrist sensor has its forces first.
            "force": log.wrench[:, :3],
            "torque": log.wrench[:, 3:],
        }
        variables |= netcdf_variables("data", values_beside)
    return Contents(variables, _attributes(spec, planned, log))


def _with_flag_meanings(status: Variable) -> Variable:
    """The flags of the control computer with the meaning of their bits, as the CF conventions have it."""
    # Computed, not in the table of variables, because they follow from `Status`.
    masks = np.array([flag.value for flag in Status], dtype=np.int64)
    meanings = " ".join(str(flag.name).lower() for flag in Status)
    return replace(status, attributes={**status.attributes, "flag_masks": masks, "flag_meanings": meanings})


def signal_contents(spec: DataSetSpec, planned: PlannedExperiment, log: JointLog) -> Contents:
    """Return what only the simulation knows of an experiment.

    Returns:
        Noise-free angles at the ticks and as they reach the record, hydraulic states, and the path of the command from
        the excitation computer on.
    """
    joints = log.joints if spec.channels == "all" else planned.joints
    joint_columns = [log.joint_index(name) for name in joints]
    output_columns = [log.joint_index(name) for name in planned.joints]
    bus = arm_named(planned.experiment.variant).bus
    delays = np.array([bus[name].delay for name in planned.joints], dtype=np.int64)
    sample = np.arange(len(log), dtype=np.int64)
    labels = {"sample": sample, "joint": joints, "output": planned.joints, "axis": log.axes}
    signals = {
        # As late as the record shows it, so that y minus this is the noise alone.
        "y_noise_free": delayed(log.true_angles[:, output_columns], delays),
        "measurement_delay": delays,
        "true_angles": log.true_angles[:, joint_columns],
        "load_pressure": log.load_pressure[:, joint_columns],
        "volts": log.volts,
        "counts": log.counts,
    }
    if log.sent is not None:
        signals["sent"] = log.sent[:, joint_columns]
    if log.spool is not None and log.supply_pressure is not None:
        signals |= {"spool": log.spool[:, joint_columns], "supply_pressure": log.supply_pressure}
    if log.unit_pose is not None and log.contact_force is not None:
        labels |= {"coordinate": XYZ, "quaternion": ("w", "x", "y", "z")}
        signals["unit_position"] = log.unit_pose[:, :3]
        signals["unit_orientation"] = log.unit_pose[:, 3:]
        signals["contact_force"] = log.contact_force
    variables = netcdf_variables("signals", {**labels, **signals})
    if log.provenance.get("drives") == "electric":
        # Logs of electric drives have currents in the place of pressures.
        current = {"units": "A", "role": "truth", "long_name": "current of each motor"}
        variables["load_pressure"] = replace(variables["load_pressure"], attributes=current)
    return Contents(variables, _attributes(spec, planned, log))


def _attributes(spec: DataSetSpec, planned: PlannedExperiment, log: JointLog) -> Mapping[str, Attribute]:
    return {
        "Conventions": "CF-1.11",
        "title": f"{spec.title}: {planned.name}",
        **record_attributes(spec, planned.facts),
        **provenance_attributes(log.provenance),
    }


def record_attributes(spec: DataSetSpec | None, facts: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the attributes of a record state of the data set and of the experiment.

    Args:
        spec: The data set; None: what it says is None.
        facts: The experiment, as the index has it; without its seed, that is None.
    """
    return {
        "format": FORMAT,
        "data_set": spec and spec.label,
        "experiment": facts["name"],
        "part": facts["part"],
        "arm": facts["arm"],
        "initialisation_window": spec and spec.window,
        "sampling_time_numerator": 1,
        "sampling_time_denominator": SAMPLE_RATE,
        "sampling_time_unit": "s",
        "intersample": "zoh",
        "seed": facts.get("seed"),
        "license": LICENSE,
    }


def experiment_log(data: DataSet, name: str) -> tuple[JointLog | None, str]:
    """Return the log of an experiment, from the files of a data set or simulated again, and where it comes from.

    Returns:
        The log and a sentence; None where truth and seed are withheld, or the spec is of another version.

    Raises:
        ScenarioError: No such experiment, files that are damaged, or a simulation that failed.
    """
    data.record(name)  # refuses an experiment that does not exist or failed
    try:
        plan = DataSetPlan(data.spec)
    except ScenarioError as error:
        return None, f"nothing to replay: this version cannot plan the spec: {error}"
    index = [record.name for record in data.index].index(name)
    if index >= len(plan) or plan[index].name != name:
        raise ScenarioError(f"{data.label}: the spec does not plan {name} where the index lists it")
    planned = plan[index]
    if (data.folder / planned.signals).is_file():
        return stored_log(data.folder, planned), "from the files of the data set"
    if data.spec.withheld:
        return None, "truth and seed are withheld: there is nothing to replay"
    result = simulate([planned.experiment])
    for label, reason in result.failed.items():
        raise ScenarioError(f"{label}: {reason}")
    return result.logs[0], "the truth is not in this copy: simulated again from the spec"


def stored_log(folder: Path, planned: PlannedExperiment) -> JointLog:
    """Put the log of an experiment together again from its two files.

    Returns:
        The log. In a data set whose files hold the studied joints alone, the others stand at their pose, as they do
        where they are not excited; the wrench is zero there.

    Raises:
        ScenarioError: A file is missing or damaged, or the files lack a joint that was excited.
    """
    data, signals = read_netcdf(folder / planned.data), read_netcdf(folder / planned.signals)
    variables = {**data.variables, **signals.variables}
    values = {name: variable.values for name, variable in variables.items()}
    arm = experiment_arm(planned.experiment)
    pose = arm.pose(planned.experiment.pose)
    joints_beside = data.variables["joint"].values if "joint" in data.variables else np.array([], str)
    recorded_joints = {*planned.joints, *joints_beside}
    missing = [axis for axis in planned.experiment.axes if axis not in recorded_joints]
    # Axes of Cartesian modes are no joints: where the files have every joint, they lack nothing.
    if missing and len(recorded_joints) < len(arm.description.joints):
        raise ScenarioError(f"{planned.name}: the files lack the commands that {', '.join(missing)} gave")
    samples = len(values["u"])

    def of_all_joints(*sources: tuple[Iterable[str], str]) -> np.ndarray:
        """Angles or pressures of all joints (N, n) from those that the files have, by joints and variable."""
        columns = np.tile(pose, (samples, 1))
        for joints, variable in sources:
            if indices := [arm.description.joint_index(joint) for joint in joints]:
                columns[:, indices] = values[variable]
        return columns

    def side_by_side(*names: str) -> np.ndarray | None:
        return np.hstack([values[name] for name in names]) if names[0] in values else None

    joints_with_truth = signals.variables["joint"].values
    wrench = side_by_side("force", "torque")
    if wrench is None:
        wrench = np.zeros((samples, len(WRENCH)))
    return JointLog(
        name=planned.name,
        seed=int(data.attributes["seed"]),
        dt=SAMPLE_TIME,
        axes=tuple(map(str, values["axis"])),
        commanded=of_all_joints((planned.joints, "u"), (joints_beside, "joint_commanded")),
        measured=of_all_joints((planned.joints, "y"), (joints_beside, "joint_measured")),
        wrench=wrench,
        true_angles=of_all_joints((joints_with_truth, "true_angles")),
        load_pressure=of_all_joints((joints_with_truth, "load_pressure")),
        volts=values["volts"],
        counts=values["counts"],
        status=values["status"],
        provenance=provenance_of(data.attributes),
        unit_pose=side_by_side("unit_position", "unit_orientation"),
        contact_force=values.get("contact_force"),
        joints=arm.description.joints,
    )
