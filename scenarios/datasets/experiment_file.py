"""The two files of an experiment: what an analyst sees, and what only the simulation knows; written and read."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hmtb_twin import JOINTS, JointLog, simulate
from hmtb_twin.bus.joint_log import WRENCH
from hmtb_twin.bus.recorder import delayed
from hmtb_twin.control.experiment import Status
from hmtb_twin.control.modes import joint_index
from hmtb_twin.files.netcdf import Attribute, Contents, read_netcdf
from hmtb_twin.parameters.values import SAMPLE_RATE, SAMPLE_TIME
from hmtb_twin.parameters.variants import variant_named
from hmtb_twin.run.experiment_row import experiment_arm
from scenarios.datasets.data_set import DataSet
from scenarios.datasets.plan import LICENSE, DataSetPlan, PlannedExperiment
from scenarios.datasets.spec import DataSetSpec
from scenarios.datasets.variables import described, provenance_of
from scenarios.files.errors import ScenarioError

FORMAT = "hmtb data set 1"
"""Marks the files of this version."""

XYZ = ("x", "y", "z")
"""Components of a vector."""


def data_contents(spec: DataSetSpec, entry: PlannedExperiment, log: JointLog) -> Contents:
    """Return what an analyst may see of an experiment.

    Returns:
        `u` (sample, input) and `y` (sample, output), rad; time, s; flags of the control computer; where the spec asks
        for all channels also the other joints, and force and torque at the wrist.
    """
    studied = [joint_index(name) for name in entry.joints]
    variables = described(
        "data",
        {
            "sample": np.arange(len(log), dtype=np.int64),
            "t": np.arange(len(log)) / SAMPLE_RATE,
            "input": entry.joints,
            "output": entry.joints,
            "u": log.commanded[:, studied],
            "y": log.measured[:, studied],
            "status": log.status,
        },
    )
    # Meaning of the bits, as the CF conventions have it.
    masks, meanings = zip(*((flag.value, str(flag.name).lower()) for flag in Status), strict=True)
    flags: dict[str, Attribute] = {"flag_masks": np.array(masks, dtype=np.int64), "flag_meanings": " ".join(meanings)}
    variables["status"] = replace(variables["status"], attributes={**variables["status"].attributes, **flags})
    if spec.channels == "all":
        others = [number for number in range(len(JOINTS)) if number not in studied]
        variables |= described(
            "data",
            {
                "joint": [JOINTS[number] for number in others],
                "component": XYZ,
                "joint_commanded": log.commanded[:, others],
                "joint_measured": log.measured[:, others],
                "force": log.wrench[:, :3],
                "torque": log.wrench[:, 3:],
            },
        )
    return Contents(variables, _attributes(spec, entry, log))


def signal_contents(spec: DataSetSpec, entry: PlannedExperiment, log: JointLog) -> Contents:
    """Return what only the simulation knows of an experiment.

    Returns:
        Noise-free angles at the ticks and as they reach the record, hydraulic states, and the path of the command from
        the excitation computer on.
    """
    names = JOINTS if spec.channels == "all" else entry.joints
    shown, outputs = ([joint_index(name) for name in some] for some in (names, entry.joints))
    bus = variant_named(entry.experiment.variant).bus
    delays = np.array([bus[name].delay for name in entry.joints], dtype=np.int64)
    labels = {"sample": np.arange(len(log), dtype=np.int64), "joint": names, "output": entry.joints, "axis": log.axes}
    signals = {
        "y_noise_free": delayed(log.true_angles[:, outputs], delays),
        "measurement_delay": delays,
        "true_angles": log.true_angles[:, shown],
        "load_pressure": log.load_pressure[:, shown],
        "volts": log.volts,
        "counts": log.counts,
    }
    if log.sent is not None:
        signals["sent"] = log.sent[:, shown]
    if log.spool is not None and log.supply_pressure is not None:
        signals |= {"spool": log.spool[:, shown], "supply_pressure": log.supply_pressure}
    if log.unit_pose is not None and log.contact_force is not None:
        labels |= {"coordinate": XYZ, "quaternion": ("w", "x", "y", "z")}
        place, turn = log.unit_pose[:, :3], log.unit_pose[:, 3:]
        signals |= {"unit_position": place, "unit_orientation": turn, "contact_force": log.contact_force}
    variables = described("signals", {**labels, **signals})
    if log.provenance.get("drives") == "electric":
        # Logs of electric drives have currents in the place of pressures.
        current = {"units": "A", "role": "truth", "long_name": "current of each motor"}
        variables["load_pressure"] = replace(variables["load_pressure"], attributes=current)
    return Contents(variables, _attributes(spec, entry, log))


def _attributes(spec: DataSetSpec, entry: PlannedExperiment, log: JointLog) -> Mapping[str, Attribute]:
    return {
        "Conventions": "CF-1.11",
        "title": f"{spec.title}: {entry.name}",
        **record_attributes(spec, entry.facts),
        **{f"provenance_{key}": value for key, value in log.provenance.items()},
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
    data.record(name)
    try:
        number, plan = [one.name for one in data.index].index(name), DataSetPlan(data.spec)
    except ScenarioError as error:
        return None, f"nothing to replay: this version cannot plan the spec: {error}"
    if number >= len(plan) or (entry := plan[number]).name != name:
        raise ScenarioError(f"{data.label}: the spec does not plan {name} where the index lists it")
    if (data.folder / entry.signals).is_file():
        return stored_log(data.folder, entry), "from the files of the data set"
    if data.spec.withheld:
        return None, "truth and seed are withheld: there is nothing to replay"
    result = simulate([entry.experiment])
    for label, reason in result.failed.items():
        raise ScenarioError(f"{label}: {reason}")
    return result.logs[0], "the truth is not in this copy: simulated again from the spec"


def stored_log(folder: Path, entry: PlannedExperiment) -> JointLog:
    """Put the log of an experiment together again from its two files.

    Returns:
        The log. In a data set whose files hold the studied joints alone, the others stand at their pose, as they do
        where they are not excited; the wrench is zero there.

    Raises:
        ScenarioError: A file is missing or damaged, or the files lack a joint that was excited.
    """
    data, signals = (read_netcdf(folder / path) for path in (entry.data, entry.signals))
    seen = {name: one.values for name, one in {**data.variables, **signals.variables}.items()}
    pose = experiment_arm(entry.experiment).pose(entry.experiment.pose)
    others = data.variables["joint"].values if "joint" in data.variables else np.array([], str)
    known = {*entry.joints, *others}
    missing = [axis for axis in entry.experiment.axes if axis not in known]
    if missing and len(known) < len(JOINTS):
        raise ScenarioError(f"{entry.name}: the files lack the commands that {', '.join(missing)} gave")

    def filled(*sources: tuple[Iterable[str], str]) -> np.ndarray:
        """Angles or pressures of all joints (N, 7) from those that the files have."""
        values = np.tile(pose, (len(seen["u"]), 1))
        for joints, name in sources:
            if index := [joint_index(joint) for joint in joints]:
                values[:, index] = seen[name]
        return values

    def joined(*names: str) -> np.ndarray | None:
        return np.hstack([seen[name] for name in names]) if names[0] in seen else None

    shown, wrench = signals.variables["joint"].values, joined("force", "torque")
    return JointLog(
        name=entry.name,
        seed=int(data.attributes["seed"]),
        dt=SAMPLE_TIME,
        axes=tuple(map(str, seen["axis"])),
        commanded=filled((entry.joints, "u"), (others, "joint_commanded")),
        measured=filled((entry.joints, "y"), (others, "joint_measured")),
        wrench=np.zeros((len(seen["u"]), len(WRENCH))) if wrench is None else wrench,
        true_angles=filled((shown, "true_angles")),
        load_pressure=filled((shown, "load_pressure")),
        volts=seen["volts"],
        counts=seen["counts"],
        status=seen["status"],
        provenance=provenance_of(data.attributes),
        unit_pose=joined("unit_position", "unit_orientation"),
        contact_force=seen.get("contact_force"),
    )
