"""The two files of an experiment: what an analyst sees, and what only the simulation knows; written and read."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from hmtb_twin import JOINTS, JointLog
from hmtb_twin.bus.joint_log import WRENCH
from hmtb_twin.bus.recorder import delayed
from hmtb_twin.control.experiment import Status
from hmtb_twin.control.modes import joint_index
from hmtb_twin.parameters.values import SAMPLE_RATE, SAMPLE_TIME
from hmtb_twin.parameters.variants import variant_named
from scenarios.datasets.layout import LICENSE
from scenarios.datasets.plan import PlannedExperiment
from scenarios.datasets.spec import DataSetSpec
from scenarios.experiments.logged_arm import experiment_arm
from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import Attribute, Contents, Variable, read_netcdf

FORMAT = "hmtb data set 1"
"""Marks the files of this version."""

XYZ = ("x", "y", "z")
"""Components of a vector."""

FLAGS: Mapping[str, Attribute] = {
    "units": "1",
    "role": "auxiliary",
    "long_name": "flags of the control computer",
    "flag_masks": np.array([flag.value for flag in Status], dtype=np.int64),
    "flag_meanings": " ".join(str(flag.name).lower() for flag in Status),
}
"""What the bits of the status mean, as the CF conventions have it."""

LOAD = ("MPa", "pressure across each actuator")
"""Unit and meaning of what hydraulic drives work with."""

CONTACT = "sum of the normal forces between replacement unit and worksite, largest since the sample before"
"""Meaning of the contact force."""


def data_contents(spec: DataSetSpec, entry: PlannedExperiment, log: JointLog) -> Contents:
    """What an analyst may see of an experiment.

    Args:
        spec: The data set.
        entry: The experiment.
        log: Its log.

    Returns:
        `u` (sample, input) and `y` (sample, output), rad; the joints beside them, force and torque at the wrist,
        and the flags of the control computer.
    """
    chosen = [joint_index(name) for name in entry.joints]
    angle = {"units": "rad"}
    variables = {
        **_samples(log),
        "input": _names("input", entry.joints, "joints that are commanded"),
        "output": _names("output", entry.joints, "joints that are measured"),
        "u": Variable(
            ("sample", "input"),
            log.commanded[:, chosen],
            {**angle, "role": "input", "long_name": "commanded joint angle", "intersample": "zoh"},
        ),
        "y": Variable(
            ("sample", "output"),
            log.measured[:, chosen],
            {**angle, "role": "output", "long_name": "measured joint angle"},
        ),
        "status": Variable(("sample",), log.status, FLAGS),
        **(_beside(log, chosen) if spec.channels == "all" else {}),
    }
    return Contents(variables, _attributes(spec, entry, log))


def _beside(log: JointLog, chosen: list[int]) -> Mapping[str, Variable]:
    """What the bus recorded beside the joints chosen."""
    others = [number for number in range(len(JOINTS)) if number not in chosen]
    command = {
        "units": "rad",
        "role": "auxiliary",
        "intersample": "zoh",
        "long_name": "commanded angle of another joint",
    }
    angle = {"units": "rad", "role": "auxiliary", "long_name": "measured angle of another joint"}
    force, torque = (
        {"units": unit, "role": "auxiliary", "long_name": f"{name} at the wrist sensor, in its own frame"}
        for name, unit in (("force", "N"), ("torque", "N m"))
    )
    return {
        "joint": _names("joint", [JOINTS[number] for number in others], "joints beside those studied"),
        "component": _names("component", XYZ, "components in the frame of the sensor"),
        "joint_commanded": Variable(("sample", "joint"), log.commanded[:, others], command),
        "joint_measured": Variable(("sample", "joint"), log.measured[:, others], angle),
        "force": Variable(("sample", "component"), log.wrench[:, :3], force),
        "torque": Variable(("sample", "component"), log.wrench[:, 3:], torque),
    }


def signal_contents(spec: DataSetSpec, entry: PlannedExperiment, log: JointLog) -> Contents:
    """What only the simulation knows of an experiment.

    Args:
        spec: The data set.
        entry: The experiment.
        log: Its log.

    Returns:
        Noise-free angles at the ticks and as they reach the record, hydraulic states, and the way of the command from
        the excitation computer on.
    """
    names = JOINTS if spec.channels == "all" else entry.joints
    shown, outputs = ([joint_index(name) for name in some] for some in (names, entry.joints))
    bus = variant_named(entry.experiment.variant).bus
    late = np.array([bus[name].delay for name in entry.joints], dtype=np.int64)
    # Of electric drives the log has currents in the place of pressures.
    load = ("A", "current of each motor") if log.provenance.get("drives") == "electric" else LOAD
    found = {
        "y_noise_free": (
            ("sample", "output"),
            delayed(log.true_angles[:, outputs], late),
            ("rad", "y without noise and quantisation, as late as y"),
        ),
        "measurement_delay": (("output",), late, ("1", "how late an angle reaches y, samples")),
        "true_angles": (
            ("sample", "joint"),
            log.true_angles[:, shown],
            ("rad", "joint angle at the tick, without noise, quantisation and measurement delay"),
        ),
        "load_pressure": (("sample", "joint"), log.load_pressure[:, shown], load),
        "volts": (("sample", "axis"), log.volts, ("V", "voltage at the hand-controller converter")),
        "counts": (("sample", "axis"), log.counts, ("1", "hand-controller counts")),
    }
    if log.spool is not None and log.supply_pressure is not None:
        found["spool"] = (("sample", "joint"), log.spool[:, shown], ("1", "spool position, part of full stroke"))
        found["supply_pressure"] = (("sample",), log.supply_pressure, ("MPa", "pressure of the supply of all joints"))
    named = {
        "joint": _names("joint", names, "joints"),
        "output": _names("output", entry.joints, "joints that are measured"),
        "axis": _names("axis", log.axes, "what is excited"),
    }
    if log.unit_pose is not None and log.contact_force is not None:
        named["coordinate"] = _names("coordinate", XYZ, "coordinates in the world")
        named["quaternion"] = _names("quaternion", ("w", "x", "y", "z"), "parts of a quaternion")
        place, turn = log.unit_pose[:, :3], log.unit_pose[:, 3:]
        found["unit_position"] = (("sample", "coordinate"), place, ("m", "position of the replacement unit"))
        found["unit_orientation"] = (("sample", "quaternion"), turn, ("1", "orientation of the replacement unit"))
        found["contact_force"] = (("sample",), log.contact_force, ("N", CONTACT))
    variables = {
        name: Variable(dims, values, {"units": unit, "role": "truth", "long_name": text})
        for name, (dims, values, (unit, text)) in found.items()
    }
    return Contents({**_samples(log), **named, **variables}, _attributes(spec, entry, log))


def _samples(log: JointLog) -> Mapping[str, Variable]:
    index = {"units": "1", "long_name": "sample number", "sampling_time": f"1/{SAMPLE_RATE} s"}
    return {"sample": Variable(("sample",), np.arange(len(log), dtype=np.int64), index)}


def _names(dim: str, names: Sequence[str], meaning: str) -> Variable:
    return Variable((dim,), np.array(names), {"long_name": meaning})


def _attributes(spec: DataSetSpec, entry: PlannedExperiment, log: JointLog) -> Mapping[str, Attribute]:
    return {
        "Conventions": "CF-1.11",
        "title": f"{spec.title}: {entry.name}",
        "format": FORMAT,
        "data_set": spec.label,
        "experiment": entry.name,
        "part": entry.part,
        "arm": entry.arm,
        "initialisation_window": spec.window,
        "sampling_time_numerator": 1,
        "sampling_time_denominator": SAMPLE_RATE,
        "sampling_time_unit": "s",
        "intersample": "zoh",
        "seed": log.seed,
        "license": LICENSE,
        **{f"provenance_{key}": value for key, value in log.provenance.items()},
    }


def stored_log(folder: Path, entry: PlannedExperiment) -> JointLog:
    """Put a log together from what an analyst may see and what only the simulation knows.

    Args:
        folder: The data set.
        entry: The experiment.

    Returns:
        The log. Of a data set whose files hold the studied joints alone, the others stand at their pose, as they do
        where they are not excited; of the wrench there is nothing.

    Raises:
        ScenarioError: A file is missing or damaged, or the files lack a joint that was excited.
    """
    data, signals = (read_netcdf(folder / place) for place in (entry.data, entry.signals))
    told = {
        key.removeprefix("provenance_"): str(v) for key, v in data.attributes.items() if key.startswith("provenance_")
    }
    pose = experiment_arm(entry.experiment).pose(entry.experiment.pose)
    count = len(data.variables["u"].values)
    commanded, measured, true, pressure = (np.tile(pose, (count, 1)) for _ in range(4))
    _fill(commanded, entry.joints, data, "u")
    _fill(measured, entry.joints, data, "y")
    known = set(entry.joints)
    if "joint" in data.variables:
        others = [str(name) for name in data.variables["joint"].values]
        _fill(commanded, others, data, "joint_commanded")
        _fill(measured, others, data, "joint_measured")
        known.update(others)
    missing = [axis for axis in entry.experiment.axes if axis not in known]
    if missing and len(known) < len(JOINTS):
        raise ScenarioError(f"{entry.name}: the files lack the commands that {', '.join(missing)} gave")
    shown = [str(name) for name in signals.variables["joint"].values]
    _fill(true, shown, signals, "true_angles")
    _fill(pressure, shown, signals, "load_pressure")
    seen = {name: variable.values for name, variable in {**data.variables, **signals.variables}.items()}
    wrench = _side_by_side(seen, "force", "torque")
    return JointLog(
        name=entry.name,
        seed=int(data.attributes["seed"]),
        dt=SAMPLE_TIME,
        axes=tuple(map(str, signals.variables["axis"].values)),
        commanded=commanded,
        measured=measured,
        wrench=np.zeros((count, len(WRENCH))) if wrench is None else wrench,
        true_angles=true,
        load_pressure=pressure,
        volts=seen["volts"],
        counts=seen["counts"],
        status=seen["status"],
        provenance=told,
        unit_pose=_side_by_side(seen, "unit_position", "unit_orientation"),
        contact_force=seen.get("contact_force"),
    )


def _side_by_side(seen: Mapping[str, np.ndarray], *names: str) -> np.ndarray | None:
    """Arrays that a log has as one; None where they are not in the files."""
    return np.hstack([seen[name] for name in names]) if names[0] in seen else None


def _fill(target: np.ndarray, joints: Sequence[str], contents: Contents, name: str) -> None:
    target[:, [joint_index(joint) for joint in joints]] = contents.variables[name].values
