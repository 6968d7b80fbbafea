"""Results as people see them: numbers and intervals as text, tables of one result and of several."""

from collections.abc import Sequence
from math import isinf, isnan
from pathlib import Path

from scenarios.bench.bandwidth import BandwidthClass
from scenarios.bench.metric import UNLIMITED, Metric, worst_part
from scenarios.bench.result import Result, metrics_of_any
from scenarios.experiments.presentation import Presentation
from scenarios.experiments.recipe import Recipe
from scenarios.files.printable import one_line
from scenarios.files.result_table import ResultTable

UNKNOWN = "–"


def number(value: float) -> str:
    """A number with three digits; below 0.001 and from a million on with two and a power of ten."""
    if isnan(value):
        return UNKNOWN
    if isinf(value):
        return "∞" if value > 0 else "-∞"
    if 1e3 <= abs(value) < 1e6:
        return f"{float(f'{value:.3g}'):.0f}"
    if value == 0 or 1e-3 <= abs(value) < 1e3:
        return f"{value:.3g}"
    return f"{value:.1e}"


def limits(ends: tuple[float, float]) -> str:
    """An interval, or limits of which one may be open."""
    low, high = ends
    if isnan(low) or isnan(high):
        return UNKNOWN
    if isinf(low) and isinf(high):
        return "any"
    if low == high:
        return number(low)
    if isinf(low):
        return f"at most {number(high)}"
    return f"at least {number(low)}" if isinf(high) else f"{number(low)} to {number(high)}"


def metric_table(result: Result) -> ResultTable:
    """The metrics of one result, with their verdicts."""
    estimator = result.estimator
    declared = (estimator.structure, estimator.method, estimator.version)
    description = one_line(", ".join(word for word in declared if word))
    heading = f"{estimator.name} ({description})" if description else estimator.name
    # The effort may say how many records of a problem there are at most: `quick, at most 2 records of a problem`.
    effort, *fewer_records = result.effort.split(", ", 1)
    run = ", ".join((f"{effort} bench", *fewer_records, f"seed {result.seed}"))
    columns = ("", "value", "passes if", "95 % interval", "verdict")
    return ResultTable(f"{heading}: {run}", columns, [_metric_row(metric) for metric in result.metrics.values()])


def _metric_row(metric: Metric) -> tuple[str, ...]:
    # An interval without width is that of a value which chance does not touch.
    interval = UNKNOWN if metric.interval[0] == metric.interval[1] else limits(metric.interval)
    judgement = f"{metric.verdict.sign} {metric.verdict.word}"
    return _title(metric), number(metric.value), _passes_if(metric), interval, judgement


def _passes_if(metric: Metric) -> str:
    """Text of the limits that a metric's shown value is judged by."""
    judged = [part for part in metric.parts if part.passed is not None]
    ends = worst_part(judged).limits if judged else UNLIMITED
    return UNKNOWN if ends == UNLIMITED else limits(ends)


def _title(metric: Metric) -> str:
    return f"{metric.title}, {metric.unit}" if metric.unit else metric.title


def side_by_side(results: Sequence[Result]) -> ResultTable:
    """The value and verdict of each metric for each estimator, and their failures."""
    rows = []
    for name, metric_of_first in metrics_of_any(results).items():
        cells = []
        for result in results:
            other = result.metrics.get(name)
            cells.append("" if other is None else f"{number(other.value)} {other.verdict.sign}")
        rows.append((_title(metric_of_first), *cells))
    rows.append(("Failures", *(f"{result.failures} of {sum(result.outcomes.values())}" for result in results)))
    return ResultTable("Side by side", ("", *(result.estimator.name for result in results)), rows)


def bandwidth_table(recovered: Sequence[BandwidthClass]) -> ResultTable:
    """Bandwidths that an estimator finds, beside the true ones."""
    columns = ["joint", "excitation", "amplitude, mrad", "median", "95 % range"]
    columns += ["small signals", "best linear", "near 1 Hz"]
    rows = []
    for row in recovered:
        record_class = [row.joint, row.excitation, f"{row.mrad:g}"]
        true = [number(row.small_signal), number(row.best_linear)]
        near = f"{row.near} of {row.models}"
        rows.append([*record_class, number(row.median), limits(row.range), *true, near])
    return ResultTable("Recovered bandwidths of the arm's joints, Hz, beside the true ones", columns, rows)


def open_result(path: Path) -> Presentation:
    """Open a file of results."""
    result = Result.read(path)
    code = (
        "from pathlib import Path\n\nfrom scenarios.bench.result import Result\n\n"
        f"result = Result.read(Path({str(path)!r}))"
    )
    answers = ", ".join(f"{times} {outcome}" for outcome, times in result.outcomes.items())
    return Presentation(
        "result of the test bench",
        str(path),
        Recipe([("hmtb", "leaderboard", str(path))], code),
        [metric_table(result)],
        [f"answers: {answers}", f"again: {result.command}"],
    )
