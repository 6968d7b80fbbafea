"""Data files as inputs and outputs: our own records and logs, tables and .mat files from anywhere."""

import warnings
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Literal

import numpy as np

import sysid
from hmtb_twin import JOINTS, STUDIED_JOINTS, JointLog, TwinError, TwinWarning
from hmtb_twin.bus.joint_log import FORMAT
from hmtb_twin.bus.record import BusRecord
from hmtb_twin.files.atomic_write import check_place
from hmtb_twin.files.netcdf import stated_format
from scenarios.files.errors import ScenarioError
from scenarios.files.record_file import ENDINGS, is_record, read_records, write_record
from sysid import IOData
from sysid.records.importers import SAME_INTERVAL, Choice, experiments_of

KINDS = f"{', '.join(ENDINGS.values())}, .npz, .mcap, .bag, a rosbag2 folder or a table as text (.txt, .dat, ...)"
"""Kinds of data files, for messages."""

Names = str | Sequence[str]
"""One column or several."""


def write_log(log: JointLog, path: Path) -> Path:
    """Write a log as NetCDF4 (`.nc`, everything), or what the bus recorded of it as CSV, ASCII or .mat, by the ending.

    Raises:
        ScenarioError: Another ending, or there is a folder of that name.
        TwinError: The NetCDF file cannot be written.
    """
    if path.suffix not in ENDINGS.values():
        raise ScenarioError(f"unknown format {path.suffix!r}; there are: {', '.join(ENDINGS.values())}")
    # Every other format holds what the bus recorded, and nothing that only a simulation knows.
    if path.suffix != ".nc":
        return write_record(BusRecord.of(log), path)
    check_place(path)
    return log.save(path)


def read_parts(
    path: str | Path,
    *,
    joint: Names | None = None,
    input: Names = "u",
    output: Names = "y",
    dt: float | None = None,
    time: str | None = None,
    time_unit: str | None = None,
    test: str | None = None,
    missing: bool = False,
    interpolate: bool = False,
) -> tuple[IOData, ...]:
    """Read inputs and outputs from a file, cut where inputs were lost and at gaps of the times of a table.

    Args:
        path: `.nc` (a joint log, a bus record, or any variables over time), `.mat`, `.ch10` (a 1553 record), `.asc`
            (our ASCII records), `.npz`, `.mcap`, `.bag` or a rosbag2 folder, or any table as text.
        joint: Joint of a log or record, or of a CSV written from one; or several.
        input: Names of the input columns or variables.
        output: Names of the output columns or variables.
        dt: Sampling interval, s. Needed if the file has none; must agree with it otherwise.
        time: Name of the column or variable of times; `header` or `log` of a log of messages.
        time_unit: Unit of the times: s, ms, us, ns, min, h or days.
        test: Test of a 1553 record, by name or number, if it holds several.
        missing: Whether outputs of a table may be missing (NaN or empty); those of our own records always may.
        interpolate: Whether outputs of a table are interpolated at single lost samples, for what takes one record
            without missing outputs. Otherwise the record is cut there if its parts are long, else they are missing.

    Returns:
        One record, or as many as there are stretches of inputs; lost outputs are declared as missing. A damaged 1553
        record gives all that is good in it and a `TwinWarning` on the rest.

    Raises:
        ScenarioError: The file is missing, foreign, or lacks the columns; no sampling interval, or two that contradict
            each other.
        TwinError: Likewise, of our own logs and records.
    """
    path = Path(path)
    inputs, outputs, joints = _several(input), _several(output), _several(joint or ())
    _check_present(path)
    if dt is not None and not 0 < dt < np.inf:
        raise ScenarioError(f"dt must be above 0 s, given {dt}")
    # A table may be read by its columns or by joint; a .csv does not say what it excites.
    ours = (path.suffix != ".csv" or bool(joints)) and is_record(path)
    if test is not None and not (ours and path.suffix != ".csv"):
        raise ScenarioError(f"{path.name} holds one test; --test is for 1553 records")
    log = log_of(path)
    if (ours or log) and ((inputs, outputs) != (("u",), ("y",)) or time or time_unit):
        raise ScenarioError(
            f"{path.name} is a record of joints: choose one by --joint; --input, --output and --time are for tables"
        )
    # The laboratory does not know the option by which this command chooses a joint: its message gets it here.
    stretches: tuple[IOData, ...] = ()
    try:
        if ours:
            contents = read_records(path)
            if contents.message:
                warnings.warn(contents.message, TwinWarning, stacklevel=2)
            stretches = contents.choose(test, path).parts(joints or None)
        elif log is not None:
            check_complete(log, joints or log.axes, path.name)
            stretches = (log.iodata(joints or None),)
    except TwinError as error:
        if "name the joint" not in str(error):
            raise
        raise TwinError(str(error).replace("name the joint", f"name the joint, as --joint {_example(log)}")) from error
    # A record of ours knows its interval; one that is stated beside it may only confirm it.
    if stretches:
        _check_interval(dt, stretches[0], path)
        return stretches
    # A CSV written from a record of ours has lost its axes, but its columns are named after the joints.
    if joints:
        if (inputs, outputs) != (("u",), ("y",)):
            raise ScenarioError("--joint names joints of our own records; --input and --output are for tables")
        inputs = tuple(f"{name}_commanded" for name in joints)
        outputs = tuple(f"{name}_measured" for name in joints)
    try:
        lost: Literal["interpolated", "missing"] = "interpolated" if interpolate else "missing"
        choice = Choice(inputs, outputs, time, time_unit, dt, missing, cut=True, lost=lost)
        return experiments_of(path, choice)
    except sysid.SysidError as error:
        raise ScenarioError(_for_users(str(error), path, inputs, outputs) + _near_joint(joints)) from error


def _example(log: JointLog | None) -> str:
    """A joint to name: of the test bed one that the thesis studied, of another arm its last."""
    return STUDIED_JOINTS[-1] if log is None or set(log.joints) == set(JOINTS) else log.joints[-1]


def _near_joint(joints: Sequence[str]) -> str:
    """What a message adds where a table lacks the columns of these joints: a joint of the test bed with a near name."""
    for joint in joints:
        near = get_close_matches(joint, JOINTS, 1)
        if near and joint not in JOINTS:
            return f"; of --joint {joint}: did you mean {near[0]!r}?"
    return ""


def _check_present(path: Path) -> None:
    """Refuse what is not there, and folders that hold no log."""
    if not path.exists():
        raise ScenarioError(f"no data file {str(path)!r}; expected {KINDS}")
    if path.is_dir() and not (path / "metadata.yaml").exists():
        raise ScenarioError(f"{str(path)!r} is a folder, and no rosbag2 folder with a metadata.yaml; expected {KINDS}")


def _several(names: Names) -> tuple[str, ...]:
    return (names,) if isinstance(names, str) else tuple(names)


def _check_interval(dt: float | None, record: IOData, path: Path) -> None:
    """Refuse a stated interval that is not that of a record of ours."""
    if dt is not None and abs(dt - record.dt) > SAME_INTERVAL * record.dt:
        raise ScenarioError(
            f"{path.name}: --dt says a sampling interval of {dt:.6g} s, the log of {record.dt:.6g} s; "
            "expected one (leave out --dt)"
        )


def check_complete(log: JointLog, joints: Sequence[str], name: str) -> None:
    """Refuse a log with missing angles: a simulation loses none, so the file was damaged since.

    Args:
        log: The log.
        joints: The joints to check; other names are ignored.
        name: Name of the log in the message.

    Raises:
        ScenarioError: An angle is no number.
    """
    columns = [log.joint_index(joint) for joint in joints if joint in log.joints]
    for channel in ("commanded", "measured"):
        bad = ~np.isfinite(getattr(log, channel)[:, columns])
        if bad.any():
            sample, column = map(int, np.argwhere(bad)[0])
            joint = log.joints[columns[column]]
            raise ScenarioError(
                f"{name}: {int(bad.sum())} {channel} angles are no numbers, the first that of {joint} "
                f"at sample {sample}; expected a log as hmtb simulate writes it, complete"
            )


def _for_users(message: str, path: Path, inputs: Sequence[str], outputs: Sequence[str]) -> str:
    """Add to a message of the analyst what the command line offers."""
    if "without a header" in message:
        count = len(inputs) + len(outputs)
        return f"{message} in this sequence, {count} in all; --input and --output name them, inputs first"
    if "not a text file" in message and path.suffix not in (".csv", ".txt", ".asc", ".dat"):
        return f"{str(path)!r}: unknown kind of data file; expected {KINDS}"
    for option, names in (("input", inputs), ("output", outputs)):
        if any(f"unknown column {name!r}" in message for name in names):
            remedy = f"choose by --{option}"
            if path.suffix == ".csv" and is_record(path):
                remedy = f"it is a record of joints: choose one by --joint, e.g. --joint {STUDIED_JOINTS[-1]}"
            return message.replace("; there are ", f"; {remedy}; there are ", 1)
    return message


def excited(path: Path, test: str | None = None) -> tuple[str, ...]:
    """Axes that the experiment of a log or record excites; empty for files that do not name them."""
    if is_record(path):
        return read_records(path).choose(test, path).axes
    log = log_of(path)
    return () if log is None else log.axes


def joints_of(record: IOData) -> tuple[str, ...]:
    """Joints of a record from our own files, input by input; none for records from elsewhere."""
    joints = tuple(name.removesuffix(" commanded") for name in record.input_names or ())
    # Of another arm too: our files name the command and the measurement of one joint alike.
    ours = tuple(f"{joint} commanded" for joint in joints) == (record.input_names or ())
    measured = set(record.output_names or ()) <= {f"{joint} measured" for joint in joints}
    return joints if joints and ours and measured else ()


def log_of(path: Path) -> JointLog | None:
    """The log in a file of `hmtb simulate`; None for other files."""
    return JointLog.load(path) if path.suffix == ".nc" and stated_format(path) == FORMAT else None
