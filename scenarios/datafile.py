"""Data files: our own logs, CSV from anywhere, .mat; to and from the analyst's record."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import sysid
from scenarios.errors import ScenarioError
from scenarios.suggest import unknown
from sysid import IOData

if TYPE_CHECKING:
    from hmtb_twin import JointLog

SAME_INTERVAL = 1e-3
"""Two sampling intervals that differ by less than this part are one, written with few digits."""


def write_log(log: "JointLog", path: Path) -> Path:
    """Write a log as NetCDF4 (`.nc`, everything) or CSV (`.csv`: time, commanded and measured angles, rad).

    Args:
        log: The log.
        path: File to write; its ending chooses the format.

    Returns:
        The path.

    Raises:
        ScenarioError: Another ending, or the file cannot be written.
    """
    if path.is_dir():
        raise ScenarioError(f"cannot write {str(path)!r}: it is a folder; expected a file or nothing of that name")
    if path.suffix == ".nc":
        try:
            log.save(path)
        except ValueError as error:
            # The text of the NetCDF library's own errors is for its programmers; the system's number is enough.
            number = getattr(error.__cause__, "errno", None)
            why = os.strerror(number) if number else "the file system refuses"
            raise ScenarioError(f"cannot write {str(path)!r}: {why}") from error
    elif path.suffix == ".csv":
        from hmtb_twin import JOINTS

        header = ["time_s", *(f"{name}_commanded" for name in JOINTS), *(f"{name}_measured" for name in JOINTS)]
        time = np.arange(len(log.commanded)) * log.dt
        table = np.column_stack([time, log.commanded, log.measured])
        np.savetxt(path, table, fmt="%.17g", delimiter=",", header=",".join(header), comments="")
    else:
        raise ScenarioError(f"unknown format {path.suffix!r}; there are: .nc, .csv")
    return path


def read_data(
    path: str | Path, *, joint: str | None = None, input: str = "u", output: str = "y", dt: float | None = None
) -> IOData:
    """Read one input and one output from a file.

    Args:
        path: `.nc` (a joint log), `.csv` (with a header or two bare columns), or `.mat` (version 7.2 or older).
        joint: Joint of a joint log, or of a CSV written from one.
        input: Name of the input column or variable.
        output: Name of the output column or variable.
        dt: Sampling interval, s. Needed where the file says none; must agree with it where it does.

    Returns:
        The record.

    Raises:
        ScenarioError: The file is missing, foreign, or lacks what is asked for; no sampling interval, or two that
            contradict each other.
    """
    path = Path(path)
    if not path.is_file():
        raise ScenarioError(f"no data file {str(path)!r}; expected a .nc log, a .csv or a .mat file")
    if dt is not None and not 0 < dt < np.inf:
        raise ScenarioError(f"dt must be above 0 s, given {dt}")
    if path.suffix == ".nc":
        from hmtb_twin import JointLog

        data = JointLog.load(path).iodata(joint)
        if dt is not None and abs(dt - data.dt) > SAME_INTERVAL * data.dt:
            raise ScenarioError(
                f"{path.name}: --dt says a sampling interval of {dt:.6g} s, the log of {data.dt:.6g} s; "
                "expected one (leave out --dt)"
            )
        return data
    if joint is not None:
        from hmtb_twin import JOINTS

        if joint not in JOINTS:
            raise ScenarioError(unknown("joint", joint, JOINTS))
        input, output = f"{joint}_commanded", f"{joint}_measured"
    readers = {".csv": sysid.read_csv, ".mat": sysid.read_mat}
    if path.suffix not in readers:
        raise ScenarioError(f"{str(path)!r}: unknown kind of data file; expected .nc, .csv or .mat")
    try:
        data = readers[path.suffix](path, inputs=(input,), outputs=(output,), dt=dt)
    except sysid.SysidError as error:
        text = str(error)
        for analyst, user in (
            ("dt as given", "--dt"),
            ("or dt in s", "or --dt SECONDS"),
            ("give dt where", "give --dt where"),
        ):
            text = text.replace(analyst, user)
        option = next((o for o, name in (("input", input), ("output", output)) if f"column {name!r};" in text), None)
        raise ScenarioError(text + (f"; choose one by --{option}" if option else "")) from error
    for name, count in ((input, data.nu), (output, data.ny)):
        if count != 1:
            raise ScenarioError(f"{path.name}: {name!r} has {count} columns; expected a vector")
    return data


def excited(path: Path) -> tuple[str, ...]:
    """Joints that the experiment of a joint log excites; none for other files."""
    if path.suffix != ".nc":
        return ()
    from hmtb_twin import JointLog

    return JointLog.load(path).axes
