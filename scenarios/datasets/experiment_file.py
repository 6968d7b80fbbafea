"""The two files of an experiment: what an analyst may see, and what only the simulation knows."""

from collections.abc import Mapping

import numpy as np

from hmtb_twin import JOINTS, JointLog
from hmtb_twin.joint_log import POSE, WRENCH
from hmtb_twin.modes import joint_index
from hmtb_twin.parameters import SAMPLE_RATE
from scenarios.datasets.netcdf import Attribute, Contents, Variable
from scenarios.datasets.plan import Entry
from scenarios.datasets.spec import DataSetSpec

FORMAT = "hmtb data set 1"
"""Marks the files of this version."""


def data_contents(spec: DataSetSpec, entry: Entry, log: JointLog) -> Contents:
    """What an analyst may see of an experiment.

    Args:
        spec: The data set.
        entry: The experiment.
        log: Its log.

    Returns:
        `u` (sample, input) and `y` (sample, output), rad; the joints beside them, the wrench and the status of the bus.
    """
    chosen = [joint_index(name) for name in entry.joints]
    angle = {"units": "rad"}
    variables = {
        **_samples(log),
        "input": _names("input", entry.joints),
        "output": _names("output", entry.joints),
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
        "status": Variable(
            ("sample",), log.status, {"units": "1", "role": "auxiliary", "long_name": "flags of the tick"}
        ),
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
    wrench = {"units": "N, N m", "role": "auxiliary", "long_name": "wrist force and torque"}
    return {
        "joint": _names("joint", [JOINTS[number] for number in others]),
        "component": _names("component", WRENCH),
        "joint_commanded": Variable(("sample", "joint"), log.commanded[:, others], command),
        "joint_measured": Variable(("sample", "joint"), log.measured[:, others], angle),
        "wrench": Variable(("sample", "component"), log.wrench, wrench),
    }


def signal_contents(spec: DataSetSpec, entry: Entry, log: JointLog) -> Contents:
    """What only the simulation knows of an experiment.

    Args:
        spec: The data set.
        entry: The experiment.
        log: Its log.

    Returns:
        Noise-free angles, hydraulic states, and the way of the command from the excitation computer on.
    """
    angles = {"units": "rad", "role": "truth", "long_name": "joint angle without noise and quantisation"}
    pressure = {"units": "MPa", "role": "truth", "long_name": "pressure across each actuator"}
    names = JOINTS if spec.channels == "all" else entry.joints
    shown = [joint_index(name) for name in names]
    variables = {
        **_samples(log),
        "joint": _names("joint", names),
        "axis": _names("axis", log.axes),
        "true_angles": Variable(("sample", "joint"), log.true_angles[:, shown], angles),
        "load_pressure": Variable(("sample", "joint"), log.load_pressure[:, shown], pressure),
        "volts": Variable(("sample", "axis"), log.volts, {"units": "V", "role": "truth"}),
        "counts": Variable(("sample", "axis"), log.counts, {"units": "1", "role": "truth"}),
    }
    if log.spool is not None and log.supply_pressure is not None:
        variables["spool"] = Variable(("sample", "joint"), log.spool[:, shown], {"units": "1", "role": "truth"})
        variables["supply_pressure"] = Variable(("sample",), log.supply_pressure, {"units": "MPa", "role": "truth"})
    if log.unit_pose is not None and log.contact_force is not None:
        variables["pose"] = _names("pose", POSE)
        variables["unit_pose"] = Variable(("sample", "pose"), log.unit_pose, {"units": "m, 1", "role": "truth"})
        variables["contact_force"] = Variable(("sample",), log.contact_force, {"units": "N", "role": "truth"})
    return Contents(variables, _attributes(spec, entry, log))


def _samples(log: JointLog) -> Mapping[str, Variable]:
    index = {"units": "1", "long_name": "sample number", "sampling_time": f"1/{SAMPLE_RATE} s"}
    return {"sample": Variable(("sample",), np.arange(len(log), dtype=np.int64), index)}


def _names(dim: str, names: "tuple[str, ...] | list[str]") -> Variable:
    return Variable((dim,), np.array(names), {})


def _attributes(spec: DataSetSpec, entry: Entry, log: JointLog) -> Mapping[str, Attribute]:
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
        "license": "CC-BY-4.0",
        **{f"provenance_{key}": value for key, value in log.provenance.items()},
    }
