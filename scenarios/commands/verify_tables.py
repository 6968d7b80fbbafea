"""What `hmtb verify` prints: the figures of each estimator, its failures, and all side by side."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scenarios.bench.journal import file_name
from scenarios.bench.leaderboard_verdict import Verdict, verdict
from scenarios.bench.metric import Metric
from scenarios.bench.result import Result
from scenarios.commands.output import print_table, say
from scenarios.commands.verify_bandwidths import answer, bandwidth_rows, show_bandwidths
from scenarios.commands.verify_numbers import interval, number
from scenarios.commands.verify_reasons import show_reasons, wrapped
from scenarios.estimators.outcome import KINDS, MODEL, REFUSED
from scenarios.files.printable import one_line

SHOWN_REASONS = 5
"""Reasons of failures that are printed; the file has more."""

AS_A_METHOD = {
    "pem": "prediction error",
    "least_squares": "least squares",
    "instrumental": "instrumental variables",
    "subspace": "a subspace method",
    "observer": "an observer method",
}
"""Of which theory speaks, by `Contestant.method`."""


def show(results: Sequence[Result], out: Path, *, verbose: bool = False) -> None:
    """Print results.

    Args:
        results: Of each estimator.
        out: Folder that they were written to.
        verbose: With all that verdicts rest on.
    """
    for result in results:
        _show_figures(result)
        if rows := bandwidth_rows(result.figures):
            show_bandwidths(rows)
            say(wrapped(answer(rows)))
            say("")
        show_reasons(result.figures.values(), verbose=verbose)
        _show_failures(result)
        say(f"{out / file_name(result.contestant.name)}.json")
        say("")
    if len(results) > 1:
        _show_side_by_side(results)
    for result in results:
        say(f"{result.contestant.name}: {_verdict(result)}")


def record(results: Sequence[Result], out: Path) -> dict[str, Any]:
    """Results as JSON: those of one estimator, or of several by name.

    Args:
        results: Of each estimator.
        out: Folder that they were written to.
    """
    if len(results) == 1:
        return _entry(results[0], out)
    first = {"figures": _entry(results[0], out)["figures"]} if results else {}
    return {
        **first,
        "passed": all(result.passed for result in results),
        "estimators": {result.contestant.name: _entry(result, out) for result in results},
    }


def _entry(result: Result, out: Path) -> dict[str, Any]:
    rows = bandwidth_rows(result.figures)
    return {
        "figures": {name: _figure(figure) for name, figure in result.figures.items()},
        **({"bandwidth": {"rows": rows, "answer": answer(rows)}} if rows else {}),
        "passed": result.passed,
        "estimator": result.contestant.name,
        "effort": result.effort,
        "seed": result.seed,
        "outcomes": result.outcomes,
        "reasons": result.reasons,
        "seconds": result.seconds,
        "command": result.command,
        "file": out / f"{file_name(result.contestant.name)}.json",
    }


def _figure(figure: Metric) -> dict[str, Any]:
    return {
        "title": figure.title,
        "value": figure.value,
        "unit": figure.unit,
        "expected": figure.expected,
        "interval": figure.interval,
        "passed": figure.passed,
        "verdict": verdict(figure).word,
        "false_alarm": figure.false_alarm,
        "why": figure.why,
        "parts": [
            {
                "label": part.label,
                "value": part.value,
                "expected": part.expected,
                "interval": part.interval,
                "limits": [_end(end) for end in part.limits],
                "passed": part.passed,
                "theory": part.theory,
                "why": part.why,
                "draws": part.draws,
            }
            for part in figure.parts
        ],
    }


def _end(value: float) -> float | str:
    """An end of an interval; JSON has no infinity, and null would be one that is not known."""
    return str(value) if math.isinf(value) else value


def _show_figures(result: Result) -> None:
    own = result.contestant
    what = one_line(", ".join(part for part in (own.structure or "", own.method or "", own.version) if part))
    effort, *fewer = result.effort.split(", ", 1)
    bench = ", ".join((f"{effort} bench", *fewer))
    title = f"{own.name}{f' ({what})' if what else ''}: {bench}, seed {result.seed}"
    rows = [
        (
            f"{figure.title}, {figure.unit}" if figure.unit else figure.title,
            number(figure.value),
            number(figure.expected),
            interval(figure.interval),
            f"{verdict(figure).sign} {verdict(figure).word}",
        )
        for figure in result.figures.values()
    ]
    print_table(title, ("", "value", "expected", "95 % interval", "verdict"), rows)


def _show_failures(result: Result) -> None:
    asked = sum(result.outcomes.values())
    counted = ", ".join(f"{kind} {count}" for kind, count in result.outcomes.items() if kind != MODEL)
    say(f"{asked} requests, {result.outcomes.get(MODEL, 0)} answered by a stable model{f'; {counted}' * bool(counted)}")
    for kind in result.outcomes:
        if kind not in (MODEL, REFUSED):
            say(f"  {kind}: {KINDS[kind]}")
    listed = list(result.reasons.items())[:SHOWN_REASONS]
    for reason, count in listed:
        say(f"  {count} x {one_line(reason)}")
    failed = sum(count for kind, count in result.outcomes.items() if kind not in (MODEL, REFUSED))
    rest, others = failed - sum(count for _, count in listed), len(result.reasons) - len(listed)
    if listed and rest > 0:
        # a file keeps the commonest reasons only
        all_kept = sum(result.reasons.values()) >= failed
        told = f"{others} other reasons" if others > 1 else "another reason"
        say(f"  and {rest} more, for {told}{': the file has them' if all_kept else ' or more: the file has some'}")


def _show_side_by_side(results: Sequence[Result]) -> None:
    names = list(dict.fromkeys(name for result in results for name in result.figures))
    rows = []
    for name in names:
        figures = [result.figures.get(name) for result in results]
        first = next(figure for figure in figures if figure is not None)
        unit = f", {first.unit}" if first.unit else ""
        cells = ["" if one is None else f"{number(one.value)} {verdict(one).sign}" for one in figures]
        rows.append((f"{first.title}{unit}", *cells))
    failures = [sum(count for kind, count in r.outcomes.items() if kind not in (MODEL, REFUSED)) for r in results]
    asked = [sum(r.outcomes.values()) for r in results]
    rows.append(("Failures", *(f"{count} of {all_}" for count, all_ in zip(failures, asked, strict=True))))
    print_table("Side by side", ("", *(result.contestant.name for result in results)), rows)
    say("  ".join(f"{one.sign} {one.word}" for one in Verdict))
    say("")


def _verdict(result: Result) -> str:
    failed = [figure.title.partition(":")[0] for figure in result.figures.values() if figure.passed is False]
    if not failed and not result.passed:
        return "nothing was judged: it gave too few models, or none"
    told = f"fails {_figures(len(failed))}: {', '.join(failed)}" if failed else "fails no figure that it should pass"
    excused = sum(verdict(figure) is Verdict.FAILS_AS_THEORY_SAYS for figure in result.figures.values())
    if not excused:
        return told
    method = AS_A_METHOD.get(result.contestant.method or "", "such a method")
    return f"{told}; {_figures(excused)} fail{'s' * (excused == 1)} as theory says of {method}"


def _figures(number: int) -> str:
    return f"{number} figure{'s' * (number != 1)}"
