"""`hmtb track`: bandwidth and delay that follow a record, and when the arm changed."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.identify import identify
from scenarios.commands.output import draw, optional_folder, print_json, print_tables, progress, say, say_each, say_next
from scenarios.commands.usage import command_line
from scenarios.files.errors import ScenarioError

if TYPE_CHECKING:
    from hmtb_twin import JointLog
    from scenarios.identification.tracking import Tracking
    from sysid import IOData

FILES = ("track.csv", "track.nc", "track.png", "track.svg")
"""Files of --out."""


def track(
    data: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="DATA|SCENARIO")],
    *,
    order: int = 8,
    nk: int = 1,
    calibration: float = 30.0,
    gain: float | None = None,
    drift: float = 1e-3,
    false_alarms: float = 0.1,
    joint: str | None = None,
    input: str = "u",
    output: str = "y",
    dt: float | None = None,
    time: str | None = None,
    test: str | None = None,
    duration: float | None = None,
    seed: int | None = None,
    no_bla: bool = False,
    threads: int | None = None,
    out: Path | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Follow bandwidth and delay through a record, and detect changes.

    Estimates have 95 % intervals. DATA is a log, record or table as for hmtb identify, or a registered scenario or a
    TOML file, which is then simulated. It has one joint, or one input and one output. The estimator goes through the
    record sample by sample and uses no later one. In the first --calibration seconds nothing may change: they give
    structure and threshold.

    The bandwidth is where the gain falls to 0.707 of that at 0 Hz, the delay is the phase delay there. For logs and
    scenarios of the twin the truth of every payload stands beside the estimates, which never see it: that of the
    linearised arm, without friction, and the best linear one under a multisine like the command (some seconds of one
    core for each payload; --no-bla leaves it out).

      hmtb track track-elbow_pitch --gain 1 --out tracked
      hmtb track siso-5-elbow_pitch.nc
      hmtb track robot.csv --input command --output angle --time stamp --calibration 60

    Args:
        data: Log, record, table, scenario or TOML file.
        order: Largest order of the model; the calibration chooses.
        nk: Samples until the output depends on the input.
        calibration: Length of the first part, s.
        gain: Gain at 0 Hz where it is known, 1 for a position servo; that of the model when not given.
        drift: Drift to follow between changes: standard deviation of the bandwidth's relative change in a minute.
        false_alarms: False alarms per hour for which the threshold is set; friction raises somewhat more.
        joint: Joint of a log or record; the excited one when not given.
        input: Input column of a table.
        output: Output column of a table.
        dt: Sampling interval of a table without times, s.
        time: Column of times.
        test: Test of a 1553 record, by name or number.
        duration: Length of the experiment instead of the scenario's own, s.
        seed: Seed of the scenario's noise.
        no_bla: Leave out the best linear truth.
        threads: Threads for the physics; all processors when not given.
        out: Folder for the estimates (track.csv, track.nc) and the figure (track.png, track.svg).
        overwrite: Replace files that exist, without a question.
        json: Print JSON, with the estimates once a second.
    """
    from dataclasses import replace

    from scenarios.files.data_file import log_of, read_parts
    from scenarios.identification.tracking import Tracking, true_stretches
    from sysid.recursive import track as follow

    path = Path(data)
    # A name without ending is a scenario's, unless there is a file of that name.
    is_record = path.suffix != ".toml" and path.exists()
    with optional_folder(out, *FILES, overwrite=overwrite) as folder:
        remarks: list[str] = []
        log: JointLog | None
        if is_record:
            if duration is not None or seed is not None:
                raise ScenarioError("--duration and --seed are for scenarios; leave them out for a record")
            # Tracking takes one record without missing outputs.
            read = partial(
                read_parts,
                path,
                joint=joint,
                input=input,
                output=output,
                dt=dt,
                time=time,
                test=test,
                interpolate=True,
            )
            record, remarks = _read(read, path)
            log = log_of(path)
        elif path.suffix not in ("", ".toml"):
            raise ScenarioError(f"no file {data}; hmtb simulate makes logs of scenarios")
        else:
            log = _simulated(data, duration, seed, threads)
            record = replace(log.iodata(joint), name=log.name)
        with progress("estimates"):
            estimates = follow(
                record, order, nk, calibration=calibration, gain=gain, drift=drift, false_alarms=false_alarms
            )
        tracking = Tracking(record.name, estimates)
        # Runs under control are experiments without a truth.
        if log is not None and "scenario" in log.provenance:
            with progress("true bandwidths"):
                truth = true_stretches(log, joint or log.axes[0], gain=gain, best_linear=not no_bla, threads=threads)
            tracking = replace(tracking, truth=truth)
        files = _write(tracking, folder) if folder else []
    if json:
        print_json({**tracking.record(), "warnings": remarks, "files": files})
        return 0
    print_tables([tracking.table()])
    say_each("", tracking.alarms_in_words())
    say_each("warning: ", remarks)
    say_each("written: ", files)
    if files and is_record:
        joints = () if joint is None else (joint,)
        columns = {"input": (input,), "output": (output,), "joint": joints, "dt": dt, "time": time, "test": test}
        say(f"next: {command_line('hmtb identify', identify, {'data': (path,), **columns})}")
    elif files:
        say_next("simulate", data)
    return 0


def _read(read: "Callable[[], Sequence[IOData]]", path: Path) -> "tuple[IOData, list[str]]":
    """The one record of a file without gaps, and the remarks of its reader."""
    import warnings
    from dataclasses import replace

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        pieces = read()
    if len(pieces) != 1:
        longest = max(pieces, key=len)
        raise ScenarioError(
            f"{path.name}: {len(pieces)} parts between gaps, expected one record without gaps: keep the rows of "
            f"one part in the file, the longest {longest.start:.6g} to {longest.time[-1]:.6g} s after the first row"
        )
    return replace(pieces[0], name=path.stem), [str(warning.message) for warning in caught]


def _simulated(name: str, duration: float | None, seed: int | None, threads: int | None) -> "JointLog":
    """The log of a scenario, simulated now."""
    import hmtb_twin
    from scenarios.experiments.registry import load

    with progress("simulating") as bar:
        result = hmtb_twin.simulate([load(name, duration=duration, seed=seed)], threads=threads, progress=bar)
    if result.failed:
        raise ScenarioError(f"{name} failed: {'; '.join(result.failed.values())}")
    return result.logs[0]


def _write(tracking: "Tracking", folder: Path) -> list[Path]:
    """Write the estimates as CSV and NetCDF, and the figure."""
    from hmtb_twin.files.atomic_write import write_whole
    from hmtb_twin.files.netcdf import Contents, Variable
    from scenarios.datasets.tables import table_text
    from scenarios.identification.tracking_figure import tracking_figure

    table, netcdf, *pictures = (folder / name for name in FILES)
    columns = tracking.columns()
    samples = zip(*(values.tolist() for values in columns.values()), strict=True)
    rows = [dict(zip(columns, sample, strict=True)) for sample in samples]
    write_whole(table, table_text(columns, rows))
    variables = {name: Variable(("sample",), values, {}) for name, values in columns.items()}
    write_whole(netcdf, Contents(variables, {"title": f"Estimates that follow {tracking.name}"}).to_bytes())
    return [table, netcdf, *draw(lambda: tracking_figure(tracking), *pictures)]
