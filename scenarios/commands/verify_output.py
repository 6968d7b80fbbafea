"""Output of `hmtb verify`: metrics, bandwidths, reasons and failures of each estimator, and all side by side."""

import math
import shutil
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from scenarios.bench.consistency import WHERE_IT_FAILS
from scenarios.bench.leaderboard_rows import ORDERS_GIVEN
from scenarios.bench.leaderboard_verdict import INFORMATIVE, Verdict, part_verdict, verdict
from scenarios.bench.metric import Metric, excess
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
    entries = {result.estimator.name: _entry(result, out) for result in results}
    first = next(iter(entries.values()))
    if len(results) == 1:
        return first
    passed = all(result.passed for result in results)
    return {"figures": first["figures"], "passed": passed, "estimators": entries}


def _entry(result: Result, out: Path) -> dict[str, Any]:
    rows = bandwidth_rows(result.metrics)
    return {
        "figures": {name: _metric(metric) for name, metric in result.metrics.items()},
        **({"bandwidth": {"rows": rows, "answer": answer(rows)}} if rows else {}),
        "passed": result.passed,
        "estimator": result.estimator.name,
        **{key: getattr(result, key) for key in ("effort", "seed", "outcomes", "reasons", "seconds", "command")},
        "file": out / f"{file_name(result.estimator.name)}.json",
    }


def _metric(metric: Metric) -> dict[str, Any]:
    parts = [
        # JSON has no infinity, and null would be a limit that is not known.
        vars(part) | {"limits": [str(end) if math.isinf(end) else end for end in part.limits]}
        for part in metric.parts
    ]
    keys = ("title", "value", "unit", "expected", "interval", "passed", "false_alarm", "why")
    return {**{key: getattr(metric, key) for key in keys}, "verdict": verdict(metric).word, "parts": parts}


def _show_metrics(result: Result) -> None:
    print_table(*metric_table(result))
    say(_wrapped(ORDERS_GIVEN) + "\n")


def _show_failures(result: Result) -> None:
    others = "".join(f"; {kind} {count}" for kind, count in result.outcomes.items() if kind != MODEL)
    answered = result.outcomes.get(MODEL, 0)
    requests = counted(sum(result.outcomes.values()), "request")
    say(f"{requests}, {answered} answered by a stable model{others}")
    for kind in result.outcomes:
        if kind not in (MODEL, REFUSED):
            say(f"  {kind}: {KINDS[kind]}")
    rest = _failures(result)
    for reason, count in list(result.reasons.items())[:SHOWN]:
        say(f"  {count} x {one_line(reason)}")
        rest -= count
    if result.reasons and rest > 0:
        say(f"  {rest} x for other reasons: the result file has the most frequent ones")


def _show_side_by_side(results: Sequence[Result]) -> None:
    rows = []
    for name in dict.fromkeys(name for result in results for name in result.metrics):
        metrics = [result.metrics.get(name) for result in results]
        first = next(metric for metric in metrics if metric is not None)
        cells = ["" if one is None else f"{number(one.value)} {verdict(one).sign}" for one in metrics]
        rows.append((f"{first.title}{f', {first.unit}' if first.unit else ''}", *cells))
    rows.append(("Failures", *(f"{_failures(result)} of {sum(result.outcomes.values())}" for result in results)))
    print_table("Side by side", ("", *(result.estimator.name for result in results)), rows)
    say("  ".join(f"{one.sign} {one.word}" for one in Verdict) + "\n")


def _failures(result: Result) -> int:
    return sum(count for kind, count in result.outcomes.items() if kind not in (MODEL, REFUSED))


def _summary(result: Result) -> str:
    failed = [metric.title.partition(":")[0] for metric in result.metrics.values() if metric.passed is False]
    if not failed and not result.passed:
        return "nothing was judged: it gave too few models, or none"
    text = "fails no figure that it should pass"
    if failed:
        text = f"fails {counted(len(failed), 'figure')}: {', '.join(failed)}"
    excused = sum(verdict(metric) is Verdict.FAILS_AS_THEORY_SAYS for metric in result.metrics.values())
    method = f" of {result.estimator.method.replace('_', ' ')}" if result.estimator.method else ""
    return (
        f"{text}; {counted(excused, 'figure')} fail{'s' * (excused == 1)} as theory says{method}" if excused else text
    )


def show_reasons(metrics: Iterable[Metric], *, verbose: bool) -> None:
    """Print a block for each metric that does not simply pass: the reasons, and the parts furthest beyond their limits.

    Args:
        metrics: The metrics.
        verbose: All metrics, with everything that their verdicts rest on, and all parts that fail.
    """
    explained: set[str] = set()
    for metric in metrics:
        judged = verdict(metric)
        parts = [part for part in metric.parts if part_verdict(part) is judged]
        if verbose:
            reasons, parts = [metric.why], [part for part in metric.parts if part.passed is False]
        elif judged is Verdict.FAILS:
            measures, *more = metric.why.split("; ")
            reasons = [measures, *(text for text in more if text.startswith(WHERE_IT_FAILS))]
        elif judged is Verdict.FAILS_AS_THEORY_SAYS:
            whys = [why for why in dict.fromkeys(part.why for part in parts) if why]
            reasons = [why for why in whys if why not in explained] or ["for reasons given above"]
            explained.update(whys)
        elif judged is Verdict.NONE and metric.name not in INFORMATIVE:
            reasons, parts = [metric.why.rpartition("; ")[2]], []
        else:
            continue
        say(f"{judged.sign} {metric.title}: {judged.word}")
        for reason in reasons:
            say(_wrapped(reason, "    "))
        shown = sorted(parts, key=excess, reverse=True)[: None if verbose else SHOWN]
        width = max((len(part.label) for part in shown), default=0)
        for part in shown:
            mark = f" {part_verdict(part).sign}" if part_verdict(part) is not judged else ""
            # A part may fail without a limit, as where too few records have a claim.
            why = part.why if all(map(math.isinf, part.limits)) else f"limits: {limits(part.limits)}"
            say(f"    {part.label:<{width}}  {number(part.value):>7}  {why}{mark}")
        if len(parts) > len(shown):
            say(f"    and {len(parts) - len(shown)} more: --verbose has them")
    say("")


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
    parts = {part.label: part for part in metric.parts}
    rows = []
    for row in sorted(metric.curves.get("classes", ()), key=lambda one: (one["joint"], one["excitation"], one["mrad"])):
        part = parts[f"{row['joint']} {row['excitation']} {row['mrad']:g} mrad"]
        true = {key: math.nan if row[key] is None else float(row[key]) for key in ("small_signal", "best_linear")}
        names = {key: row[key] for key in ("joint", "excitation", "mrad")}
        counts = {key: row[key] for key in ("near", "models")}
        rows.append({**names, "median": part.value, "range": part.interval, **true, **counts})
    return rows


def show_bandwidths(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print the table of bandwidths."""
    names = ("joint", "excitation", "amplitude, mrad", "median", "95 % range")
    columns = (*names, "small signals", "best linear", "near 1 Hz")
    cells = [
        (
            *(row["joint"], row["excitation"], f"{row['mrad']:g}"),
            *(number(row["median"]), limits(row["range"])),
            *(number(row["small_signal"]), number(row["best_linear"])),
            f"{row['near']} of {row['models']}",
        )
        for row in rows
    ]
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
