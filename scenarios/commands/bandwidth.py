"""`hmtb bandwidth`: does the 1 Hz finding hold? Recovered against true and published bandwidths."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from scenarios.commands.output import (
    draw,
    optional_folder,
    plain,
    print_json,
    print_tables,
    progress,
    say_each,
    say_next,
)
from scenarios.files.errors import ScenarioError

if TYPE_CHECKING:
    from hmtb_twin import JointLog
    from scenarios.identification.bandwidth_study import BandwidthStudy

JOINTS = ("shoulder_yaw", "shoulder_pitch", "elbow_pitch")
TESTS = (5,)
METHODS = ("arx", "armax", "iv4", "oe", "okid", "oe_high", "spa", "etfe")

FILES = ("bandwidth.csv", "bandwidth.png", "bandwidth.svg")
"""Files of --out."""


def bandwidth(
    *,
    joints: Annotated[tuple[str, ...] | None, tyro.conf.arg(metavar="NAME ...")] = None,
    methods: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = METHODS,
    tests: Annotated[tuple[int, ...] | None, tyro.conf.arg(metavar="1..8 ...")] = None,
    seeds: int | None = None,
    seed: int | None = None,
    variant: Annotated[str | None, tyro.conf.arg(metavar="nominal|published|flight|released")] = None,
    no_friction: bool = False,
    duration: float | None = None,
    data: Annotated[tuple[Path, ...] | None, tyro.conf.arg(metavar="LOG ...")] = None,
    no_bla: bool = False,
    threads: int | None = None,
    out: Path | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Does the 1 Hz finding hold: bandwidths recovered, true, printed.

    For each joint, method, test and seed it prints the recovered bandwidth with its 95 % interval, beside the true
    bandwidth of the arm in two senses, the models that the thesis prints, and 1 Hz; then the answer in words.

    The bandwidth is the frequency at which the gain has fallen by 3 dB from its value at 0 Hz. The small-signal
    truth is the bandwidth of the linearised arm, without friction. The best linear truth is the bandwidth of the linear
    system that is nearest to the arm with friction and velocity limit, when a random-phase multisine commands it as
    strongly as the test does, in the same band (four seconds of one core for each joint and test; --no-bla leaves it
    out).

    Two questions are kept apart: whether a bandwidth is near 1 Hz (0.8 to 1.25 Hz), and whether its interval holds the
    truth. Where the record cannot support a bandwidth, because the command excites no frequency so low or the interval
    is too wide, none is claimed; the record still counts for both questions, with the answer no.

    Methods: armax, oe, okid with the thesis' orders; arx, iv4 with those of its ARMAX; oe_high, an output-error model
    whose order suffices without friction; spa and etfe, without a model. On files of 2 s that
    no hold samples anew their lines lie every 0.5 Hz, too few to show the gain at 0 Hz: only the frequency of the gain
    0.707 is then left.

      hmtb bandwidth                                three joints, PRBS test, one record each
      hmtb bandwidth --seeds 20 --tests 5 6 --out bandwidth
      hmtb bandwidth --variant published --no-friction
      hmtb bandwidth --data siso-5-elbow_pitch.nc --methods oe okid

    Args:
        joints: Joints: shoulder_yaw, shoulder_pitch, elbow_pitch (all when not given).
        methods: Methods, of those above.
        tests: Single-joint tests of the thesis by number; 5, the PRBS of 1 V, when not given.
        seeds: How many records of each test, each with other noise and another binary sequence; 1 when not given.
        seed: The first of the seeds. When not given: one record has the scenarios' own, several have 1, 2, 3, ...
        variant: Which arm; nominal when not given.
        no_friction: Leave dry friction out.
        duration: Length of each test, s; 240, the thesis', when not given. Shorter ones are a preview.
        data: Logs of hmtb simulate (.nc) to use instead, of one joint each; they define the arm.
        no_bla: Leave out the best linear truth.
        threads: Threads for the physics; all processors when not given.
        out: Folder for bandwidth.csv and the figure, bandwidth.png and .svg.
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    # None of them may stand beside --data, which is why their defaults are None and are filled in below.
    of_arm = {
        "joints": joints,
        "tests": tests,
        "seeds": seeds,
        "variant": variant,
        "no_friction": no_friction or None,
        "duration": duration,
    }
    _check_data(data, [name for name, value in of_arm.items() if value is not None])
    from scenarios.experiments.campaign import Condition
    from scenarios.experiments.waveform import check_seed
    from scenarios.identification.bandwidth_study import from_logs, from_simulation

    check_seed(seed or 0)
    joints_studied = JOINTS if joints is None else joints
    tests_studied = TESTS if tests is None else tests
    with optional_folder(out, *FILES, overwrite=overwrite) as folder:
        if data is not None:
            study = from_logs(
                _read(data), methods, best_linear=not no_bla, seed=seed or 0, threads=threads, stage=progress
            )
        else:
            study = from_simulation(
                joints_studied,
                methods,
                tests_studied,
                seeds=_seeds(seed, seeds),
                condition=Condition(variant or "nominal", not no_friction),
                duration=duration,
                best_linear=not no_bla,
                threads=threads,
                stage=progress,
            )
        files = _write(study, folder) if folder else []
    if json:
        print_json({**study.record(), "files": files})
    else:
        _print(study)
        say_each("written: ", files)
        if files:
            say_next("thesis", "--quick", "--out", "thesis-quick")
    # A record that gave no bandwidth at all is a difference that a script must see.
    return 1 if study.failed else 0


def _check_data(data: Sequence[Path] | None, of_arm: Sequence[str]) -> None:
    """Refuse logs beside options that logs decide."""
    if data is None:
        return
    if of_arm:
        contradicting = ", ".join(f"--{name.replace('_', '-')}" for name in of_arm)
        raise ScenarioError(f"--data takes arm and tests from the logs; leave out {contradicting}")
    if not data:
        raise ScenarioError("--data given without a log, expected one or more")


def _seeds(first: int | None, count: int | None) -> tuple[int | None, ...]:
    """Seeds of the records; a single record without --seed keeps the scenario's seed, None."""
    from scenarios.experiments.waveform import seed_range

    if first is None and count in (None, 1):
        return (None,)
    start = 1 if first is None else first
    number_of_seeds = 1 if count is None else count
    return tuple(seed_range(number_of_seeds, start))


def _read(paths: Sequence[Path]) -> "list[JointLog]":
    from hmtb_twin import JointLog
    from scenarios.files.data_file import check_complete

    for path in paths:
        if path.suffix != ".nc":
            raise ScenarioError(f"--data {path} given, expected a log of hmtb simulate, .nc: it knows its arm")
    logs = [JointLog.load(path) for path in paths]
    for path, log in zip(paths, logs, strict=True):
        check_complete(log, log.axes, path.name)  # the name that was typed; a log has another one
    return logs


def _write(study: "BandwidthStudy", folder: Path) -> list[Path]:
    """Write the rows as CSV, and the figure."""
    from hmtb_twin.files.atomic_write import write_whole
    from scenarios.datasets.tables import table_text
    from scenarios.identification.bandwidth_figure import bandwidth_figure

    table, picture, drawing = (folder / name for name in FILES)
    records = []
    for row in study.rows:
        record: dict[str, Any] = {key: plain(value) for key, value in row.record().items()}
        record["orders"] = " ".join(f"{name}={value}" for name, value in row.orders.items())
        # A cell holds one number.
        for key in ("ci95", "ci95_with_distortion_and_order", "bla_ci95", "model_ci95"):
            record[f"{key}_low"], record[f"{key}_high"] = record.pop(key)
        records.append(record)
    write_whole(table, table_text(records[0], records))
    return [table, *draw(lambda: bandwidth_figure(study), picture, drawing)]


def _print(study: "BandwidthStudy") -> None:
    from scenarios.identification.bandwidth_table import bandwidth_table, table_notes

    print_tables(bandwidth_table(study, joint) for joint in study.joints)
    say_each("", table_notes(study))
    say_each("- ", study.answers())
    say_each("failed: ", (f"{name}: {why}" for name, why in study.failed.items()))
