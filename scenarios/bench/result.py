"""The result of one estimator on the test bench: a file that a table can be made of and a run repeated from."""

import json
import math
import os
import platform
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from scenarios.bench.bandwidth import bandwidth_classes, one_hertz_answer
from scenarios.bench.metric import Metric, all_pass
from scenarios.estimators.estimator import Estimator, Limits
from scenarios.estimators.outcome import MODEL, REFUSED
from scenarios.estimators.task import PROTOCOL
from scenarios.files.codec import plain_numbers, structure
from scenarios.files.errors import ScenarioError
from scenarios.files.printable import one_line

FORMAT = 1
"""Version of the file."""

IN_FILES = {"estimator": "contestant", "metrics": "figures"}
"""Fields that have other names in files."""

MOST_BYTES = 2**26
"""Result files are far smaller; an endless or foreign file is not read."""

LARGEST = 1e100
"""Larger numbers are read as infinite, and the inverse of smaller ones as 0: axes compute squares and products."""


@dataclass(frozen=True)
class Result:
    """Result of a run for one estimator.

    Attributes:
        estimator: The estimator; `contestant` in files.
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
        metrics: Metrics by name; `figures` in files.
        run: Mark that all results of one run share: their speeds were measured side by side.
        protocol: Version of the estimator protocol.
        refused: Number of refused requests by family of the problem, and by request where that is no fit.
    """

    estimator: Estimator
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
    metrics: Mapping[str, Metric]
    run: str = ""
    protocol: int = PROTOCOL
    refused: Mapping[str, int] = field(default_factory=dict)

    @property
    def passed(self) -> bool:
        """Whether no metric fails that theory expects to pass, and something was judged; see `all_pass`."""
        return all_pass(self.metrics)

    @property
    def failures(self) -> int:
        """Number of requests that ended without a model and were not refused."""
        return sum(count for kind, count in self.outcomes.items() if kind not in (MODEL, REFUSED))

    def record(self) -> dict[str, Any]:
        """Return what `hmtb verify --json` prints of it."""
        record: dict[str, Any] = {"figures": {name: metric.record() for name, metric in self.metrics.items()}}
        recovered = bandwidth_classes(self.metrics)
        if recovered:
            record["bandwidth"] = {"rows": [row.record() for row in recovered], "answer": one_hertz_answer(recovered)}
        record |= {"passed": self.passed, "estimator": self.estimator.name}
        for key in ("effort", "seed", "outcomes", "reasons", "seconds", "command"):
            record[key] = getattr(self, key)
        return record

    def check_counts(self) -> None:
        """Refuse numbers that no run can have: anyone may have written the file.

        Raises:
            ScenarioError: A number of requests or records is negative, or a rate is no probability.
        """
        counts = [*self.outcomes.values(), *self.reasons.values(), *self.refused.values()]
        for metric in self.metrics.values():
            counts += [metric_part.draws for metric_part in metric.parts]
            if not 0.0 <= metric.false_alarm <= 1.0:
                raise ScenarioError(f"false-alarm rate {metric.false_alarm} given, expected 0 to 1")
        if min(counts, default=0) < 0:
            raise ScenarioError("a number of requests or records is below 0")

    def to_json(self) -> str:
        """The text of the file; NaN as null, infinities as text."""
        fields = {IN_FILES.get(key, key): value for key, value in asdict(self).items()}
        contents = plain_numbers({"format": FORMAT, "passed": self.passed, **fields})
        return json.dumps(contents, indent=1, allow_nan=False) + "\n"

    @classmethod
    def read(cls, path: Path) -> "Result":
        """Read a file.

        Raises:
            ScenarioError: It is none, of another version, or damaged.
        """
        foreign = f"{path} is no result of hmtb verify"
        # Reading a pipe or a device might never end.
        if path.exists() and not path.is_file():
            raise ScenarioError(f"{foreign}: it is no ordinary file")
        if path.is_file() and path.stat().st_size > MOST_BYTES:
            raise ScenarioError(f"{foreign}: it has more than {MOST_BYTES} bytes")
        try:
            table = _safe(json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError, RecursionError) as error:
            raise ScenarioError(f"cannot read {path}: {error}") from error
        version = table.get("format") if isinstance(table, dict) else type(table).__name__
        # Python takes True for 1.
        if type(version) is not int or version != FORMAT:
            raise ScenarioError(
                f"{path}: format {version!r} given, expected a result of hmtb verify of format {FORMAT}"
            )
        names = {in_file: name for name, in_file in IN_FILES.items()}
        fields = {names.get(key, key): value for key, value in table.items()}
        # Whether it passed is computed from its metrics, not believed.
        for key in ("format", "passed"):
            fields.pop(key, None)
        try:
            result = structure(cls, fields)
            result.check_counts()
        except ScenarioError as error:
            raise ScenarioError(f"{foreign}: {error}") from error
        # No other estimator sees the truth.
        if result.estimator.is_perfect and result.estimator.name != "perfect":
            raise ScenarioError(f"{path}: {result.estimator.name} answers from the truth, as only 'perfect' may")
        return result


def metrics_of_any(results: Iterable[Result]) -> dict[str, Metric]:
    """All metrics that any result has, as the first result with them has them: runs of chosen figures differ."""
    first: dict[str, Metric] = {}
    for result in results:
        for name, metric in result.metrics.items():
            first.setdefault(name, metric)
    return first


def _safe(value: Any) -> Any:
    """Values of a file that anyone may have written: texts on one line, numbers that figures and sums can hold."""
    if isinstance(value, str):
        return one_line(value)
    if isinstance(value, float) and not 1.0 / LARGEST < abs(value) < LARGEST:
        return math.copysign(math.inf, value) if abs(value) > 1.0 else 0.0 * value  # NaN stays NaN
    # NumPy has no larger whole numbers.
    if isinstance(value, int) and abs(value) >= 2**63:
        raise ValueError(f"a whole number has {len(str(value))} digits, expected a number of 64 bits")
    if isinstance(value, dict):
        return {one_line(key): _safe(item) for key, item in value.items()}
    return [_safe(item) for item in value] if isinstance(value, list) else value


def machine() -> str:
    """Processor and number of cores of this machine."""
    try:
        processors = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        processors = ""
    model = re.search(r"^model name\s*:\s*(.+)$", processors, re.MULTILINE)
    # Some processors, and containers without /proc, tell only their kind.
    processor = model[1].strip() if model else platform.processor() or platform.machine()
    return f"{processor}, {os.cpu_count() or 1} cores"
