"""Output of `hmtb verify`: metrics, bandwidths, reasons and failures of each estimator, and all side by side."""

import math
import shutil
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.bench.consistency import WHERE_IT_FAILS
from scenarios.bench.leaderboard_verdict import INFORMATIVE, Verdict, part_verdict, verdict
from scenarios.bench.metric import Metric, Part, excess
from scenarios.bench.progress import file_name
from scenarios.bench.result import Result
from scenarios.commands.output import print_table, say
from scenarios.estimators.outcome import KINDS, MODEL, REFUSED
from scenarios.files.printable import one_line
from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ, near_1_hz

SHOWN = 5
"""Parts of a metric, and reasons of failures, that are printed; the file has more."""

WIDEST, INDENT = 120, "    "
"""Of lines of text."""

CLOSE = 1.1
"""A median within this factor of its truth is called close."""

METHODS = {
    "pem": "prediction error",
    "least_squares": "least squares",
    "instrumental": "instrumental variables",
    "subspace": "a subspace method",
    "observer": "an observer method",
}
"""Words for `Contestant.method`."""


def show(results: Sequence[Result], out: Path, *, verbose: bool = False) -> None:
    """Print results.

    Args:
        results: Of each estimator.
        out: Folder that they were written to.
        verbose: With everything that verdicts rest on.
    """
    for result in results:
        _show_metrics(result)
        if rows := bandwidth_rows(result.figures):
            show_bandwidths(rows)
            say(_wrapped(answer(rows)))
            say("")
        show_reasons(result.figures.values(), verbose=verbose)
        _show_failures(result)
        say(f"{out / file_name(result.contestant.name)}.json")
        say("")
    if len(results) > 1:
        _show_side_by_side(results)
    for result in results:
        say(f"{result.contestant.name}: {_summary(result)}")


def record(results: Sequence[Result], out: Path) -> dict[str, Any]:
    """Results as JSON: those of one estimator, or of several by name.

    Args:
        results: Of each estimator.
        out: Folder that they were written to.
    """
    entries = {result.contestant.name: _entry(result, out) for result in results}
    if len(results) == 1:
        return entries[results[0].contestant.name]
    first = {"figures": _entry(results[0], out)["figures"]} if results else {}
    return {**first, "passed": all(result.passed for result in results), "estimators": entries}


def _entry(result: Result, out: Path) -> dict[str, Any]:
    rows = bandwidth_rows(result.figures)
    return {
        "figures": {name: _metric(metric) for name, metric in result.figures.items()},
        **({"bandwidth": {"rows": rows, "answer": answer(rows)}} if rows else {}),
        "passed": result.passed,
        "estimator": result.contestant.name,
        **{key: getattr(result, key) for key in ("effort", "seed", "outcomes", "reasons", "seconds", "command")},
        "file": out / f"{file_name(result.contestant.name)}.json",
    }


def _metric(metric: Metric) -> dict[str, Any]:
    keys = ("title", "value", "unit", "expected", "interval", "passed")
    parts = [
        {
            **{key: getattr(part, key) for key in ("label", "value", "expected", "interval")},
            # JSON has no infinity, and null would be a limit that is not known.
            "limits": [str(end) if math.isinf(end) else end for end in part.limits],
            **{key: getattr(part, key) for key in ("passed", "theory", "why", "draws")},
        }
        for part in metric.parts
    ]
    return {
        **{key: getattr(metric, key) for key in keys},
        "verdict": verdict(metric).word,
        "false_alarm": metric.false_alarm,
        "why": metric.why,
        "parts": parts,
    }


def _show_metrics(result: Result) -> None:
    own = result.contestant
    kind = one_line(", ".join(part for part in (own.structure or "", own.method or "", own.version) if part))
    effort, *fewer = result.effort.split(", ", 1)
    bench = ", ".join((f"{effort} bench", *fewer))
    rows = [
        (
            f"{metric.title}, {metric.unit}" if metric.unit else metric.title,
            number(metric.value),
            number(metric.expected),
            limits(metric.interval),
            f"{verdict(metric).sign} {verdict(metric).word}",
        )
        for metric in result.figures.values()
    ]
    title = f"{own.name}{f' ({kind})' if kind else ''}: {bench}, seed {result.seed}"
    print_table(title, ("", "value", "expected", "95 % interval", "verdict"), rows)


def _show_failures(result: Result) -> None:
    requests = sum(result.outcomes.values())
    others = ", ".join(f"{kind} {count}" for kind, count in result.outcomes.items() if kind != MODEL)
    answered = result.outcomes.get(MODEL, 0)
    say(f"{requests} requests, {answered} answered by a stable model{f'; {others}' * bool(others)}")
    for kind in result.outcomes:
        if kind not in (MODEL, REFUSED):
            say(f"  {kind}: {KINDS[kind]}")
    shown = list(result.reasons.items())[:SHOWN]
    for reason, count in shown:
        say(f"  {count} x {one_line(reason)}")
    failures = _failures(result)
    rest, reasons = failures - sum(count for _, count in shown), len(result.reasons) - len(shown)
    if shown and rest > 0:
        complete = sum(result.reasons.values()) >= failures  # a file keeps the commonest reasons only
        kinds = f"{reasons} other reasons" if reasons > 1 else "another reason"
        say(f"  and {rest} more, for {kinds}{': the file has them' if complete else ' or more: the file has some'}")


def _show_side_by_side(results: Sequence[Result]) -> None:
    rows = []
    for name in dict.fromkeys(name for result in results for name in result.figures):
        metrics = [result.figures.get(name) for result in results]
        first = next(metric for metric in metrics if metric is not None)
        cells = ["" if one is None else f"{number(one.value)} {verdict(one).sign}" for one in metrics]
        rows.append((f"{first.title}{f', {first.unit}' if first.unit else ''}", *cells))
    rows.append(("Failures", *(f"{_failures(result)} of {sum(result.outcomes.values())}" for result in results)))
    print_table("Side by side", ("", *(result.contestant.name for result in results)), rows)
    say("  ".join(f"{one.sign} {one.word}" for one in Verdict))
    say("")


def _failures(result: Result) -> int:
    return sum(count for kind, count in result.outcomes.items() if kind not in (MODEL, REFUSED))


def _summary(result: Result) -> str:
    failed = [metric.title.partition(":")[0] for metric in result.figures.values() if metric.passed is False]
    if not failed and not result.passed:
        return "nothing was judged: it gave too few models, or none"
    text = f"fails {_figures(len(failed))}: {', '.join(failed)}" if failed else "fails no figure that it should pass"
    excused = sum(verdict(metric) is Verdict.FAILS_AS_THEORY_SAYS for metric in result.figures.values())
    if not excused:
        return text
    method = METHODS.get(result.contestant.method or "", "such a method")
    return f"{text}; {_figures(excused)} fail{'s' * (excused == 1)} as theory says of {method}"


def _figures(count: int) -> str:
    return f"{count} figure{'s' * (count != 1)}"


def show_reasons(metrics: Iterable[Metric], *, verbose: bool) -> None:
    """Print a block for each metric that does not simply pass.

    Args:
        metrics: The metrics.
        verbose: All metrics, with everything that their verdicts rest on, and all parts that fail.
    """
    explained: dict[str, str] = {}
    for metric in metrics:
        judged = verdict(metric)
        if verbose:
            failed = [part for part in metric.parts if part.passed is False]
            _block(metric, [metric.why], failed, most=len(failed))
            continue
        if judged is Verdict.NONE and metric.name not in INFORMATIVE:
            say(_wrapped(f"{judged.sign} {metric.title}: {metric.why.rpartition('; ')[2]}", INDENT))
        parts = [part for part in metric.parts if part_verdict(part) is judged]
        if judged is Verdict.FAILS:
            measures, *more = metric.why.split("; ")
            _block(metric, [measures, *(text for text in more if text.startswith(WHERE_IT_FAILS))], parts)
        elif judged is Verdict.FAILS_AS_THEORY_SAYS:
            _block(metric, _reasons(metric, parts, explained), parts)
    say("")


def _reasons(metric: Metric, parts: Sequence[Part], explained: dict[str, str]) -> list[str]:
    """Explanations from theory, each of them in full only once."""
    short = metric.title.partition(":")[0]
    reasons = []
    for why in dict.fromkeys(part.why for part in parts if part.why):
        first = explained.setdefault(why, short)
        reasons.append(why if first == short else f"theory says the same as of “{first}”")
    return list(dict.fromkeys(reasons))


def _block(metric: Metric, reasons: Sequence[str], parts: Sequence[Part], *, most: int = SHOWN) -> None:
    judged = verdict(metric)
    say(f"{judged.sign} {metric.title}: {judged.word}")
    for reason in reasons:
        say(_wrapped(INDENT + reason, INDENT))
    shown = sorted(parts, key=lambda part: -excess(part))[:most]
    rows = [(part.label, number(part.value)) for part in shown]
    widths = [max((len(row[place]) for row in rows), default=0) for place in (0, 1)]
    for (label, value), part in zip(rows, shown, strict=True):
        mark = f" {part_verdict(part).sign}" if part_verdict(part) is not judged else ""
        say(_wrapped(f"{INDENT}{label:<{widths[0]}}  {value:>{widths[1]}}  {_limit(part)}{mark}", 2 * INDENT))
    if len(parts) > len(shown):
        say(f"{INDENT}and {len(parts) - len(shown)} more: --verbose has them")


def _limit(part: Part) -> str:
    """Its limit in words, or why it fails without one."""
    low, high = part.limits
    if math.isinf(low) and math.isinf(high):
        return part.why
    both = math.isfinite(low) and math.isfinite(high) and low != high
    return f"limit{'s' * both}: {limits(part.limits)}"


def _wrapped(text: str, indent: str = "") -> str:
    """Text in lines as wide as the terminal; all but the first are indented."""
    width = min(WIDEST, shutil.get_terminal_size((WIDEST, 24)).columns)
    return textwrap.fill(text, max(40, width), subsequent_indent=indent, break_on_hyphens=False)


def bandwidth_rows(metrics: Mapping[str, Metric]) -> list[dict[str, Any]]:
    """A row for each joint, excitation and amplitude; none where the run has no bandwidths or no models.

    Args:
        metrics: Of a result, by name.

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
    """Print the table of bandwidths.

    Args:
        rows: Of `bandwidth_rows`.
    """
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
    """In a sentence: whether the estimator recovers the thesis' 1 Hz, and whether what it recovers is true.

    Args:
        rows: Of `bandwidth_rows`, at least one.
    """
    low, high = ABOUT_1_HZ
    near, models = (sum(row[key] for row in rows) for key in ("near", "models"))
    medians = sum(near_1_hz(row["median"]) for row in rows)
    true = sum(near_1_hz(row["best_linear"]) for row in rows)
    text = (
        f"About 1 Hz ({low:g} to {high:g} Hz) is what it finds in {near} of {models} records and in the median of "
        f"{medians} of {len(rows)} rows; the best linear truth is about 1 Hz in {true} of them"
    )
    apart = {_apart(row): row for row in rows if math.isfinite(_apart(row))}
    if not apart:
        return f"{text}."
    worst = apart[max(apart)]
    close = sum(_apart(row) <= math.log(CLOSE) for row in rows)
    return (
        f"{text}, and its median lies within {100 * (CLOSE - 1):.0f} % of that truth in {close}, furthest from it for "
        f"{worst['joint']} {worst['excitation']} {worst['mrad']:g} mrad: {number(worst['median'])} Hz, where "
        f"{number(worst['best_linear'])} Hz is true."
    )


def _apart(row: Mapping[str, Any]) -> float:
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.abs(np.log(np.divide(row["median"], row["best_linear"]))))


def number(value: float) -> str:
    """A number with four digits; a dash for an unknown one."""
    return "—" if math.isnan(value) else f"{value:.4g}"


def limits(ends: tuple[float, float]) -> str:
    """An interval, or limits, in words; a dash where they are unknown or any value passes."""
    low, high = ends
    if math.isnan(low) or math.isnan(high) or (math.isinf(low) and math.isinf(high)):
        return "—"
    if low == high:
        return number(low)
    if math.isinf(low):
        return f"at most {number(high)}"
    return f"at least {number(low)}" if math.isinf(high) else f"{number(low)} to {number(high)}"
