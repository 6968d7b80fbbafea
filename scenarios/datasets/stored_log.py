"""The log of an experiment, put together again from the files of a data set."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from hmtb_twin import JOINTS, JointLog
from hmtb_twin.bus.joint_log import WRENCH
from hmtb_twin.control.modes import joint_index
from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.datasets.plan import Entry
from scenarios.experiments.logged_arm import experiment_arm
from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import Contents, read_netcdf


def stored_log(folder: Path, entry: Entry) -> JointLog:
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
