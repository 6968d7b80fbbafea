"""Output of `hmtb verify`: metrics, bandwidths, reasons and failures of each estimator, and all side by side."""

import math
import shutil
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from scenarios.bench.consistency import WHERE_IT_FAILS
from scenarios.bench.leaderboard_words import ORDERS_GIVEN
from scenarios.bench.metric import INFORMATIVE, Metric, Part, Verdict, excess
from scenarios.bench.result import Result
from scenarios.bench.result_table import limits, metric_table, number
from scenarios.bench.run_progress import file_name
from scenarios.commands.output import counted, print_table, say
from scenarios.estimators.outcome import KINDS, MODEL, REFUSED
from scenarios.files.printable import one_line
from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ, near_1_hz

SHOWN = 5
"""Parts of a metric, and reasons of failures, that are printed; the file has more."""

CLOSE = 1.1
"""A median within this factor of its truth is called close."""


def show(results: Sequence[Result], out: Path, *, verbose: bool = False) -> None:
    """Print results."""
    for result in results:
        _show_metrics(result)
        if rows := bandwidth_rows(result.metrics):
            show_bandwidths(rows)
            say(_wrapped(answer(rows)) + "\n")
        show_reasons(result.metrics.values(), verbose=verbose)
        _show_failures(result)
        say(f"{out / file_name(result.estimator.name)}.json\n")
    if len(results) > 1:
        _show_side_by_side(results)
    for result in results:
        say(f"{result.estimator.name}: {_summary(result)}")


def record(results: Sequence[Result], out: Path) -> dict[str, Any]:
    """Results as JSON: those of one estimator, or of several by name."""
    records = {result.estimator.name: _result_record(result, out) for result in results}
    first = next(iter(records.values()))
    if len(results) == 1:
        return first
    passed = all(result.passed for result in results)
    return {"figures": first["figures"], "passed": passed, "estimators": records}


def _result_record(result: Result, out: Path) -> dict[str, Any]:
    record: dict[str, Any] = {"figures": {name: _metric_record(metric) for name, metric in result.metrics.items()}}
    rows = bandwidth_rows(result.metrics)
    if rows:
        record["bandwidth"] = {"rows": rows, "answer": answer(rows)}
    record |= {"passed": result.passed, "estimator": result.estimator.name}
    for key in ("effort", "seed", "outcomes", "reasons", "seconds", "command"):
        record[key] = getattr(result, key)
    record["file"] = out / f"{file_name(result.estimator.name)}.json"
    return record


def _metric_record(metric: Metric) -> dict[str, Any]:
    problems = []
    for problem in metric.parts:
        # JSON has no infinity, and null would be a limit that is not known.
        ends = [_json_number(end) for end in problem.limits]
        problems.append(vars(problem) | {"limits": ends})
    keys = ("title", "value", "unit", "expected", "interval", "passed", "false_alarm", "why")
    values = {key: getattr(metric, key) for key in keys}
    return {**values, "verdict": metric.verdict.word, "parts": problems}


def _json_number(value: float) -> float | str:
    return str(value) if math.isinf(value) else value


def _show_metrics(result: Result) -> None:
    print_table(*metric_table(result))
    say(_wrapped(ORDERS_GIVEN) + "\n")


def _show_failures(result: Result) -> None:
    kinds = "".join(f"; {kind} {count}" for kind, count in result.outcomes.items() if kind != MODEL)
    answered = result.outcomes.get(MODEL, 0)
    requests = counted(sum(result.outcomes.values()), "request")
    say(f"{requests}, {answered} answered by a stable model{kinds}")
    for kind in result.outcomes:
        if kind not in (MODEL, REFUSED):
            say(f"  {kind}: {KINDS[kind]}")
    unlisted = _failures(result)
    for reason, count in list(result.reasons.items())[:SHOWN]:
        say(f"  {count} x {one_line(reason)}")
        unlisted -= count
    if result.reasons and unlisted > 0:
        say(f"  {unlisted} x for other reasons: the result file has the most frequent ones")


def _show_side_by_side(results: Sequence[Result]) -> None:
    # Runs of chosen figures may have others than their neighbours.
    names: dict[str, None] = {}
    for result in results:
        names |= dict.fromkeys(result.metrics)
    rows = []
    for name in names:
        metrics = [result.metrics.get(name) for result in results]
        first = next(metric for metric in metrics if metric is not None)
        title = f"{first.title}, {first.unit}" if first.unit else first.title
        cells = []
        for metric in metrics:
            cells.append("" if metric is None else f"{number(metric.value)} {metric.verdict.sign}")
        rows.append((title, *cells))
    rows.append(("Failures", *(f"{_failures(result)} of {sum(result.outcomes.values())}" for result in results)))
    print_table("Side by side", ("", *(result.estimator.name for result in results)), rows)
    say("  ".join(f"{judgement.sign} {judgement.word}" for judgement in Verdict) + "\n")


def _failures(result: Result) -> int:
    return sum(count for kind, count in result.outcomes.items() if kind not in (MODEL, REFUSED))


def _summary(result: Result) -> str:
    failed = [metric.title.partition(":")[0] for metric in result.metrics.values() if metric.passed is False]
    if not failed and not result.passed:
        return "nothing was judged: it gave too few models, or none"
    summary = "fails no figure that it should pass"
    if failed:
        summary = f"fails {counted(len(failed), 'figure')}: {', '.join(failed)}"
    excused = sum(metric.verdict is Verdict.FAILS_AS_THEORY_SAYS for metric in result.metrics.values())
    if not excused:
        return summary
    verb = "fails" if excused == 1 else "fail"
    method = f" of {result.estimator.method.replace('_', ' ')}" if result.estimator.method else ""
    return f"{summary}; {counted(excused, 'figure')} {verb} as theory says{method}"


def show_reasons(metrics: Iterable[Metric], *, verbose: bool) -> None:
    """Print a block for each metric that does not simply pass: the reasons, and the parts furthest beyond their limits.

    Args:
        metrics: The metrics.
        verbose: All metrics, with everything that their verdicts rest on, and all parts that fail.
    """
    explained: set[str] = set()
    for metric in metrics:
        judged = metric.verdict
        problems = [problem for problem in metric.parts if problem.verdict is judged]
        if verbose:
            reasons = [metric.why]
            problems = [problem for problem in metric.parts if problem.passed is False]
        elif judged is Verdict.FAILS:
            measures, *remarks = metric.why.split("; ")
            reasons = [measures, *(remark for remark in remarks if remark.startswith(WHERE_IT_FAILS))]
        elif judged is Verdict.FAILS_AS_THEORY_SAYS:
            whys = [why for why in dict.fromkeys(problem.why for problem in problems) if why]
            reasons = [why for why in whys if why not in explained] or ["for reasons given above"]
            explained.update(whys)
        elif judged is Verdict.NONE and metric.name not in INFORMATIVE:
            reasons, problems = [metric.why.rpartition("; ")[2]], []
        else:
            continue
        say(f"{judged.sign} {metric.title}: {judged.word}")
        for reason in reasons:
            say(_wrapped(reason, "    "))
        _show_problems(problems, judged, verbose=verbose)
    say("")


def _show_problems(problems: Sequence[Part], judged: Verdict, *, verbose: bool) -> None:
    """Print the problems of a metric, those furthest beyond their limits first."""
    listed = sorted(problems, key=excess, reverse=True)
    if not verbose:
        listed = listed[:SHOWN]
    width = max((len(problem.label) for problem in listed), default=0)
    for problem in listed:
        mark = f" {problem.verdict.sign}" if problem.verdict is not judged else ""
        # A problem may fail without a limit, as where too few records have a claim.
        has_no_limit = all(map(math.isinf, problem.limits))
        why = problem.why if has_no_limit else f"limits: {limits(problem.limits)}"
        say(f"    {problem.label:<{width}}  {number(problem.value):>7}  {why}{mark}")
    if len(problems) > len(listed):
        say(f"    and {len(problems) - len(listed)} more: --verbose has them")


def _wrapped(text: str, indent: str = "") -> str:
    """Indented text in lines as wide as the terminal, 120 columns at most."""
    width = min(max(40, shutil.get_terminal_size((120, 24)).columns), 120)
    return textwrap.fill(text, width, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False)


def bandwidth_rows(metrics: Mapping[str, Metric]) -> list[dict[str, Any]]:
    """A row for each joint, excitation and amplitude; none where the run has no bandwidths or no models.

    Returns:
        joint, excitation, mrad; median and range (95 % of the records) of the recovered bandwidth, Hz; small_signal
        and best_linear: the true ones, Hz; near: records whose bandwidth is about 1 Hz; models: records with a model.
    """
    metric = metrics.get("bandwidth")
    if metric is None:
        return []
    recovered = {problem.label: problem for problem in metric.parts}
    classes = metric.curves.get("classes", ())
    rows = []
    for known in sorted(classes, key=lambda row: (row["joint"], row["excitation"], row["mrad"])):
        bandwidth = recovered[f"{known['joint']} {known['excitation']} {known['mrad']:g} mrad"]
        row = {key: known[key] for key in ("joint", "excitation", "mrad")}
        row |= {"median": bandwidth.value, "range": bandwidth.interval}
        for key in ("small_signal", "best_linear"):
            row[key] = math.nan if known[key] is None else float(known[key])
        row |= {key: known[key] for key in ("near", "models")}
        rows.append(row)
    return rows


def show_bandwidths(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print the table of bandwidths."""
    columns = ["joint", "excitation", "amplitude, mrad", "median", "95 % range"]
    columns += ["small signals", "best linear", "near 1 Hz"]
    cells = []
    for row in rows:
        record_class = [row["joint"], row["excitation"], f"{row['mrad']:g}"]
        recovered = [number(row["median"]), limits(row["range"])]
        true = [number(row["small_signal"]), number(row["best_linear"])]
        cells.append([*record_class, *recovered, *true, f"{row['near']} of {row['models']}"])
    print_table("Recovered bandwidths of the arm's joints, Hz, beside the true ones", columns, cells)


def answer(rows: Sequence[Mapping[str, Any]]) -> str:
    """The answer on the thesis' 1 Hz: whether the estimator recovers it, and whether what it recovers is true."""
    low, high = ABOUT_1_HZ
    near, models = (sum(row[key] for row in rows) for key in ("near", "models"))
    medians, true = (sum(near_1_hz(row[key]) for row in rows) for key in ("median", "best_linear"))
    close = sum(1.0 / CLOSE <= row["median"] / row["best_linear"] <= CLOSE for row in rows)
    return (
        f"The bandwidth is about 1 Hz ({low:g} to {high:g} Hz) in {near} of {models} records and in the median of "
        f"{medians} of {len(rows)} rows; the best linear truth is about 1 Hz in {true} rows, and the median lies "
        f"within {100 * (CLOSE - 1):.0f} % of that truth in {close}."
    )
