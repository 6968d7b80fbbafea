"""The result of one estimator on the test bench: a file that a table can be made of and a run repeated from."""

import json
import math
import os
import platform
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from scenarios.bench.metric import DRAWS, Metric, MetricDefinition, Part, all_pass
from scenarios.estimators.estimator import Estimator, Limits
from scenarios.estimators.task import PROTOCOL
from scenarios.files.errors import ScenarioError
from scenarios.problems.trial import Trial

FORMAT = 1
"""Version of the file."""

MOST_NAMED = 4
"""Metrics that a message names; more are counted."""

EFFORT = re.compile(rf"({'|'.join(DRAWS)})(?:, at most (\d{1, 9}) records? of a problem)?")
CPU = Path("/proc/cpuinfo")


@dataclass(frozen=True)
class Result:
    """Result of a run for one estimator.

    Attributes:
        contestant: The estimator.
        limits: Its limits.
        effort: `quick` or `full`, and the most records of a problem, where it is not all.
        seed: Of the run.
        command: Command line that repeats it.
        source: SHA-256 of the estimator's files; empty where there are none.
        versions: Of the packages that matter, by name.
        machine: Processor and number of cores.
        outcomes: Number of trials by kind of outcome.
        reasons: The most frequent reasons of failures, with their number.
        seconds: Processor time of all its answers, s.
        figures: Metrics by name.
        run: Mark that all results of one run share: their speeds were measured side by side.
        protocol: Version of the estimator protocol.
        refused: Number of refused requests by family of the problem, and by request where that is no fit.
    """

    contestant: Estimator
    limits: Limits
    effort: str
    seed: int
    command: str
    source: str
    versions: Mapping[str, str]
    machine: str
    outcomes: Mapping[str, int]
    reasons: Mapping[str, int]
    seconds: float
    figures: Mapping[str, Metric]
    run: str = ""
    protocol: int = PROTOCOL
    refused: Mapping[str, int] = field(default_factory=dict)

    @property
    def passed(self) -> bool:
        """Whether no metric fails that theory expects to pass, and something was judged; see `all_pass`."""
        return all_pass(self.figures)

    def to_json(self) -> str:
        """The text of the file; NaN as null, infinities as text."""
        table = {"format": FORMAT, "passed": self.passed, **asdict(self)}
        return json.dumps(_plain(table), indent=1, allow_nan=False) + "\n"

    @classmethod
    def read(cls, path: Path) -> "Result":
        """Read a file.

        Raises:
            ScenarioError: It is none, or of another version.
        """
        try:
            table = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            raise ScenarioError(f"cannot read {path}: {error}") from error
        if not isinstance(table, dict) or type(table.get("format")) is not int or table["format"] != FORMAT:
            given = table.get("format") if isinstance(table, dict) else type(table).__name__
            raise ScenarioError(f"{path}: format {given!r} given, expected a result of hmtb verify of format {FORMAT}")
        try:
            table = {key: value for key, value in table.items() if key not in ("format", "passed")}
            table["contestant"] = Estimator(**table["contestant"])
            table["limits"] = Limits(**table["limits"])
            table["figures"] = {name: _metric(entry) for name, entry in table["figures"].items()}
            table["seconds"] = _number(table["seconds"])
            return cls(**table)
        except (TypeError, KeyError, IndexError, AttributeError, ValueError, OverflowError) as error:
            raise ScenarioError(f"{path} is no result of hmtb verify: {error}") from error


def _metric(entry: Mapping[str, Any]) -> Metric:
    values = _numbers(entry, ("value", "expected", "false_alarm"), ("interval",))
    parts = [_numbers(part, ("value", "expected"), ("interval", "limits")) for part in entry["parts"]]
    return Metric(**{**values, "parts": tuple(Part(**part) for part in parts)})


def _numbers(entry: Mapping[str, Any], single: tuple[str, ...], pairs: tuple[str, ...]) -> dict[str, Any]:
    return {
        **entry,
        **{name: _number(entry[name]) for name in single},
        **{name: (_number(entry[name][0]), _number(entry[name][1])) for name in pairs},
    }


def _number(value: float | str | None) -> float:
    return float("nan") if value is None else float(value)


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):  # NumPy's
        value = value.tolist()
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return value


def effort_text(effort: str, records: int | None) -> str:
    """An effort in words, as results have it.

    Args:
        effort: One of `DRAWS`.
        records: Most records of each problem; None: all.
    """
    return effort if records is None else f"{effort}, at most {records} record{'s' * (records > 1)} of a problem"


def trials_within(metric: MetricDefinition, effort: str, records: int | None) -> tuple[Trial, ...]:
    """Trials of a metric with at most so many records of each problem; see `effort_text`."""
    trials = metric.trials(effort)
    return trials if records is None else tuple(trial for trial in trials if trial.draw < records)


def lost_by(result: Result, metrics: Sequence[MetricDefinition], effort: str, records: int | None) -> str:
    """Metrics or records of a result that a run would not have, in words; empty where the run has them all.

    Args:
        result: The result.
        metrics: Of the run.
        effort: Of the run; see `effort_text`.
        records: Of the run.
    """
    by_name = {metric.name: metric for metric in metrics}
    missing = [name for name in result.figures if name not in by_name]
    if missing:
        named = ", ".join(missing) if len(missing) <= MOST_NAMED else f"{len(missing)} of its {len(result.figures)}"
        return f"figures that this run does not make ({named})"
    known = EFFORT.fullmatch(result.effort) if isinstance(result.effort, str) else None  # files may hold anything
    if known is None:
        return ""
    its_records = int(known[2]) if known[2] else None
    for metric in (by_name[name] for name in result.figures):
        if set(trials_within(metric, known[1], its_records)) - set(trials_within(metric, effort, records)):
            return f"records that this run does not ask ({result.effort}; now {effort_text(effort, records)})"
    return ""


def machine() -> str:
    """Processor and number of cores of this machine."""
    try:
        lines = CPU.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    values = {name.strip(): value.strip() for name, _, value in (line.partition(":") for line in lines) if value}
    processor = values.get("model name") or platform.processor() or platform.machine()
    return f"{processor}, {os.cpu_count() or 1} cores"
