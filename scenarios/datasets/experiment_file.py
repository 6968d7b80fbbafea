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
from scenarios.datasets.plan import LICENSE, PlannedExperiment
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
"""Meaning of the bits of the status, as the CF conventions have it."""

PRESSURE = ("MPa", "pressure across each actuator")
"""Unit and meaning of the load of hydraulic drives."""

CONTACT = "sum of the normal forces between replacement unit and worksite, largest since the sample before"
"""Meaning of the contact force."""


def data_contents(spec: DataSetSpec, entry: PlannedExperiment, log: JointLog) -> Contents:
    """Return what an analyst may see of an experiment.

    Args:
        spec: The data set.
        entry: The experiment.
        log: Its log.

    Returns:
        `u` (sample, input) and `y` (sample, output), rad; the flags of the control computer; where the spec asks for
        all channels also the other joints, and force and torque at the wrist.
    """
    studied = [joint_index(name) for name in entry.joints]

    def angles(dim: str, values: np.ndarray, meaning: str, *, role: str = "auxiliary", held: bool = False) -> Variable:
        attributes: dict[str, Attribute] = {"units": "rad", "role": role, "long_name": meaning}
        return Variable(("sample", dim), values, attributes | ({"intersample": "zoh"} if held else {}))

    variables = {
        **_samples(log),
        "input": _names("input", entry.joints, "joints that are commanded"),
        "output": _names("output", entry.joints, "joints that are measured"),
        "u": angles("input", log.commanded[:, studied], "commanded joint angle", role="input", held=True),
        "y": angles("output", log.measured[:, studied], "measured joint angle", role="output"),
        "status": Variable(("sample",), log.status, FLAGS),
    }
    if spec.channels == "all":
        others = [number for number in range(len(JOINTS)) if number not in studied]
        force, torque = (
            {"units": unit, "role": "auxiliary", "long_name": f"{name} at the wrist sensor, in its own frame"}
            for name, unit in (("force", "N"), ("torque", "N m"))
        )
        command = {
            "units": "rad",
            "role": "auxiliary",
            "intersample": "zoh",
            "long_name": "commanded angle of another joint",
        }
        variables |= {
            "joint": _names("joint", [JOINTS[number] for number in others], "joints beside those studied"),
            "component": _names("component", XYZ, "components in the frame of the sensor"),
            "joint_commanded": Variable(("sample", "joint"), log.commanded[:, others], command),
            "joint_measured": angles("joint", log.measured[:, others], "measured angle of another joint"),
            "force": Variable(("sample", "component"), log.wrench[:, :3], force),
            "torque": Variable(("sample", "component"), log.wrench[:, 3:], torque),
        }
    return Contents(variables, _attributes(spec, entry, log))


def signal_contents(spec: DataSetSpec, entry: PlannedExperiment, log: JointLog) -> Contents:
    """Return what only the simulation knows of an experiment.

    Args:
        spec: The data set.
        entry: The experiment.
        log: Its log.

    Returns:
        Noise-free angles at the ticks and as they reach the record, hydraulic states, and the path of the command from
        the excitation computer on.
    """
    names = JOINTS if spec.channels == "all" else entry.joints
    shown, outputs = ([joint_index(name) for name in some] for some in (names, entry.joints))
    bus = variant_named(entry.experiment.variant).bus
    delays = np.array([bus[name].delay for name in entry.joints], dtype=np.int64)
    joint = ("sample", "joint")
    # Logs of electric drives have currents in the place of pressures.
    load = ("A", "current of each motor") if log.provenance.get("drives") == "electric" else PRESSURE
    signals: dict[str, tuple[tuple[str, ...], np.ndarray, tuple[str, str]]] = {
        "y_noise_free": (
            ("sample", "output"),
            delayed(log.true_angles[:, outputs], delays),
            ("rad", "y without noise and quantisation, as late as y"),
        ),
        "measurement_delay": (("output",), delays, ("1", "how late an angle reaches y, samples")),
        "true_angles": (
            joint,
            log.true_angles[:, shown],
            ("rad", "joint angle at the tick, without noise, quantisation and measurement delay"),
        ),
        "load_pressure": (joint, log.load_pressure[:, shown], load),
        "volts": (("sample", "axis"), log.volts, ("V", "voltage at the hand-controller converter")),
        "counts": (("sample", "axis"), log.counts, ("1", "hand-controller counts")),
    }
    if log.spool is not None and log.supply_pressure is not None:
        signals["spool"] = (joint, log.spool[:, shown], ("1", "spool position, part of full stroke"))
        signals["supply_pressure"] = (("sample",), log.supply_pressure, ("MPa", "pressure of the supply of all joints"))
    labels = {
        "joint": _names("joint", names, "joints"),
        "output": _names("output", entry.joints, "joints that are measured"),
        "axis": _names("axis", log.axes, "what is excited"),
    }
    if log.unit_pose is not None and log.contact_force is not None:
        labels["coordinate"] = _names("coordinate", XYZ, "coordinates in the world")
        labels["quaternion"] = _names("quaternion", ("w", "x", "y", "z"), "parts of a quaternion")
        place, turn = log.unit_pose[:, :3], log.unit_pose[:, 3:]
        signals |= {
            "unit_position": (("sample", "coordinate"), place, ("m", "position of the replacement unit")),
            "unit_orientation": (("sample", "quaternion"), turn, ("1", "orientation of the replacement unit")),
            "contact_force": (("sample",), log.contact_force, ("N", CONTACT)),
        }
    variables = {
        name: Variable(dims, values, {"units": unit, "role": "truth", "long_name": meaning})
        for name, (dims, values, (unit, meaning)) in signals.items()
    }
    return Contents({**_samples(log), **labels, **variables}, _attributes(spec, entry, log))


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
    """Put the log of an experiment together again from its two files.

    Args:
        folder: The data set.
        entry: The experiment.

    Returns:
        The log. In a data set whose files hold the studied joints alone, the others stand at their pose, as they do
        where they are not excited; the wrench is zero there.

    Raises:
        ScenarioError: A file is missing or damaged, or the files lack a joint that was excited.
    """
    data, signals = (read_netcdf(folder / path) for path in (entry.data, entry.signals))
    seen = {name: variable.values for name, variable in {**data.variables, **signals.variables}.items()}
    pose = experiment_arm(entry.experiment).pose(entry.experiment.pose)

    def filled(*sources: tuple[Sequence[str], Contents, str]) -> np.ndarray:
        """Angles or pressures of all joints (N, 7) from those that the files have."""
        values = np.tile(pose, (len(seen["u"]), 1))
        for joints, contents, name in sources:
            values[:, [joint_index(joint) for joint in joints]] = contents.variables[name].values
        return values

    others = [str(name) for name in data.variables["joint"].values] if "joint" in data.variables else []
    known = {*entry.joints, *others}
    missing = [axis for axis in entry.experiment.axes if axis not in known]
    if missing and len(known) < len(JOINTS):
        raise ScenarioError(f"{entry.name}: the files lack the commands that {', '.join(missing)} gave")
    shown = [str(name) for name in signals.variables["joint"].values]
    beside = ((others, data, "joint_commanded"),) if others else ()
    measured = ((others, data, "joint_measured"),) if others else ()
    return JointLog(
        name=entry.name,
        seed=int(data.attributes["seed"]),
        dt=SAMPLE_TIME,
        axes=tuple(map(str, signals.variables["axis"].values)),
        commanded=filled((entry.joints, data, "u"), *beside),
        measured=filled((entry.joints, data, "y"), *measured),
        wrench=np.hstack([seen["force"], seen["torque"]])
        if "force" in seen
        else np.zeros((len(seen["u"]), len(WRENCH))),
        true_angles=filled((shown, signals, "true_angles")),
        load_pressure=filled((shown, signals, "load_pressure")),
        volts=seen["volts"],
        counts=seen["counts"],
        status=seen["status"],
        provenance={
            key.removeprefix("provenance_"): str(value)
            for key, value in data.attributes.items()
            if key.startswith("provenance_")
        },
        unit_pose=np.hstack([seen["unit_position"], seen["unit_orientation"]]) if "unit_position" in seen else None,
        contact_force=seen.get("contact_force"),
    )
