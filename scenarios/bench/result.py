"""The result of one estimator on the test bench, as a file that a table can be made of and a run repeated from."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from scenarios.bench.metric import Metric, Part, all_pass
from scenarios.estimators.contestant import Contestant, Limits
from scenarios.estimators.task import PROTOCOL
from scenarios.files.errors import ScenarioError

FORMAT = 1
"""Version of the file."""


@dataclass(frozen=True)
class Result:
    """What came of a run for one estimator.

    Attributes:
        contestant: The estimator.
        limits: What it could use.
        effort: `quick` or `full`, and how many records at most, where it is not all.
        seed: Of the run.
        command: Command line that makes it again.
        source: SHA-256 of the file that the estimator's function is in, or of the program; empty where there is none.
        versions: Of the packages that matter, by name.
        machine: Processor and number of cores.
        outcomes: How many trials ended how, by kind.
        reasons: The commonest reasons of failures, with how often.
        seconds: Processor time of all its answers, s.
        figures: By name.
        run: Mark that all results of one run share: their speeds were measured side by side.
        protocol: Version of the contract that it was run by.
        refused: How many requests it refused, by kind: family of the problem, and what is asked where that is no fit.
    """

    contestant: Contestant
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
        """Whether no figure fails where theory expects it to pass, and something was judged; see `all_pass`."""
        return all_pass(self.figures)

    def to_json(self) -> str:
        """The text of the file; numbers that are not finite as null, infinities as text."""
        table = {"format": FORMAT, "passed": self.passed, **asdict(self)}
        return json.dumps(_told(table), indent=1, allow_nan=False) + "\n"

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
            table["contestant"] = Contestant(**table["contestant"])
            table["limits"] = Limits(**table["limits"])
            table["figures"] = {name: _figure(entry) for name, entry in table["figures"].items()}
            table["seconds"] = _number(table["seconds"])
            return cls(**table)
        except (TypeError, KeyError, IndexError, AttributeError, ValueError, OverflowError) as error:
            raise ScenarioError(f"{path} is no result of hmtb verify: {error}") from error


def _figure(entry: Mapping[str, Any]) -> Metric:
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


def _told(value: Any) -> Any:
    if hasattr(value, "tolist"):  # NumPy's
        value = value.tolist()
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    if isinstance(value, Mapping):
        return {str(key): _told(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_told(entry) for entry in value]
    return value
