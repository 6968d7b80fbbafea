"""Review of a simulated experiment: clipping, velocity limit, inputs, task, shutdowns, and warnings."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hmtb_twin import JointLog, Status
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.bus.shutdown_intervals import ShutdownInterval, shutdown_intervals
from hmtb_twin.control.data_acquisition import BOARD
from scenarios.experiments.excitation_computer import MISSES_POINTS
from scenarios.experiments.joint_inputs import JointInputs, settled_inputs
from scenarios.experiments.log_review import velocity_limited_share
from scenarios.experiments.preview import deadband_warning
from scenarios.experiments.rpcm import RpcmOutcome, rpcm_outcome
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import ScenarioError
from scenarios.files.printable import counted
from scenarios.files.result_table import ResultTable


@dataclass(frozen=True, eq=False)
class RunReview:
    """Review of one log.

    Attributes:
        clipped: Share of the samples in which a converter clips, between 0 and 1.
        velocity_limited: Share of the samples at a joint's velocity limit, between 0 and 1.
        inputs: How independently several joints are commanded; None with fewer.
        task: Outcome of an operator's task; None without one.
        shutdowns: Stretches without power.
        warnings: Sentences for whoever uses the log.
    """

    clipped: float
    velocity_limited: float
    inputs: JointInputs | None
    task: RpcmOutcome | None
    shutdowns: tuple[ShutdownInterval, ...]
    warnings: tuple[str, ...]

    def shares(self) -> tuple[str, str]:
        """Return the clipped and the velocity-limited share in percent."""
        return f"{100 * self.clipped:.3g} %", f"{100 * self.velocity_limited:.3g} %"


STRAINED = 0.02
"""Share of the samples at the largest torque of a drive from which a log gets a warning."""

COLUMNS = ("log", "length", "converter clips", "command rate-limited")
"""Headings of a table of logs."""


def run_table(
    files: Mapping[Path, Sequence[JointLog]], reviews: Mapping[str, RunReview], failed: Mapping[str, str]
) -> ResultTable:
    """Length and shares of clipped and velocity-limited samples of the logs in each file, and why runs failed.

    Args:
        files: The logs in each file.
        reviews: Review of each log by its name.
        failed: Reasons by name of the run.
    """
    rows = []
    for path, logs in files.items():
        length = f"{sum(len(log) * log.dt for log in logs):g} s"
        if len(logs) > 1:
            length += f" ({len(logs)} tests)"
        # Of a file with several logs the largest shares.
        clipped = max(reviews[log.name].clipped for log in logs)
        limited = max(reviews[log.name].velocity_limited for log in logs)
        rows.append((str(path), length, f"{100 * clipped:.3g} %", f"{100 * limited:.3g} %"))
    rows += [(name, f"failed: {why}", "", "") for name, why in failed.items()]
    return ResultTable(counted(len(files), "file"), COLUMNS, rows)


@dataclass(frozen=True)
class LogSummary:
    """A log in words.

    Attributes:
        row: Name, length, and the shares of samples that a converter clips and that a velocity limit holds; see
            `COLUMNS`.
        facts: What it is of, and the share of ticks with each flag, by name.
        remarks: Task, shutdowns and warnings.
    """

    row: tuple[str, str, str, str]
    facts: tuple[tuple[str, str], ...]
    remarks: tuple[str, ...]


def log_summary(log: JointLog) -> LogSummary:
    """Summarise a log by what stands in it; clipping is known of whole logs that name their scenario.

    Raises:
        ScenarioError: It has no ticks at 50 Hz, or values that are no numbers.
    """
    sample_time = arm_named(log.provenance.get("variant", "nominal")).sample_time
    if abs(log.dt - sample_time) > 1e-9 or not len(log):
        raise ScenarioError(
            f"{log.name}: {len(log)} samples every {log.dt:g} s given, expected some every {sample_time} s"
        )
    for channel in ("commanded", "measured", "true_angles", "wrench", "load_pressure"):
        if not np.isfinite(getattr(log, channel)).all():
            raise ScenarioError(f"{log.name}: values of {channel} are no numbers, expected a log that is complete")
    remarks: list[str] = []
    clipped, limited = "", f"{100 * velocity_limited_share(log):.3g} %"
    if "scenario" in log.provenance:
        scenario = Scenario.from_toml(log.provenance["scenario"], source=f"scenario of {log.name}")
        # Clipping follows from the excitation of the whole run.
        if len(log) == round(scenario.duration / log.dt):
            whole_run = review(log, scenario)
            clipped, limited = whole_run.shares()
            remarks = _remarks(whole_run)
        else:
            remarks = [f"{len(log) * log.dt:g} s of {scenario.duration:g} s were recorded"]
    row = (log.name, f"{len(log) * log.dt:g} s", clipped, limited)
    return LogSummary(row, tuple(_facts(log)), tuple(remarks))


def _remarks(run: RunReview) -> list[str]:
    """Task, shutdowns and warnings of a run, in words."""
    remarks = [str(run.task)] if run.task else []
    remarks += [str(interval) for interval in run.shutdowns]
    return remarks + [f"warning: {warning}" for warning in run.warnings]


def _facts(log: JointLog) -> list[tuple[str, str]]:
    """What a log is of, and the share of ticks with each flag that occurs, by name."""
    about = log.provenance
    facts = [("axes", ", ".join(log.axes)), ("seed", str(log.seed))]
    facts += [(name, about[name]) for name in ("variant", "payload", "pose", "mode") if name in about]
    for flag in Status:
        share = np.mean((log.status & flag) != 0)
        if share:
            flag_name = str(flag.name).lower().replace("_", " ")
            facts.append((f"ticks {flag_name}", f"{100 * share:.3g} %"))
    return facts


def review(log: JointLog, scenario: Scenario) -> RunReview:
    """Review a log."""
    # The excitation computer clips before the flags are set.
    beyond = BOARD.exceeds_range(scenario.requested_volts()).any(axis=1)
    clipped = float(np.mean(beyond | ((log.status & Status.CONVERTER_SATURATED) != 0)))
    inputs = settled_inputs(log.commanded, scenario)
    task = rpcm_outcome(log) if scenario.task == "rpcm" else None
    return RunReview(
        clipped,
        velocity_limited_share(log),
        inputs,
        task,
        shutdown_intervals(log),
        (*_warnings(scenario, clipped, inputs, task), *_torque_warnings(log)),
    )


def _torque_warnings(log: JointLog) -> Iterator[str]:
    """Sentences on drives that gave their largest torque for long: then no linear model describes the joint."""
    arm = arm_named(log.provenance.get("variant", "nominal"))
    effort = np.abs(log.effort)
    for joint, torques in zip(log.joints, effort.T, strict=True):
        largest = arm.actuators[joint].motor.maximum_torque
        share = float(np.mean(torques >= (1.0 - 1e-6) * largest))
        if share > STRAINED:
            yield (
                f"the drive of {joint} gives its largest torque, {largest:.3g} N m, in {100 * share:.2g} % of the "
                "samples: no linear model describes it there; a smaller amplitude, a lighter payload or another pose "
                "avoids it"
            )


def _warnings(
    scenario: Scenario, clipped: float, inputs: JointInputs | None, task: RpcmOutcome | None
) -> Iterator[str]:
    """Sentences for whoever uses the log of a scenario."""
    if clipped > 0:
        yield (
            f"{100 * clipped:.2g} % of the samples stand at an end of a converter's range, whatever the excitation "
            "asked for; a smaller amplitude avoids it"
        )
    if inputs and (independence := inputs.warning()):
        yield independence
    if any(excitation.misses_points for excitation in scenario.excitation):
        yield MISSES_POINTS
    if deadband := deadband_warning(scenario):
        yield deadband
    if task and (contact := task.warning()):
        yield contact
