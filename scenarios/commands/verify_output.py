"""Output of `hmtb verify`: metrics, bandwidths, reasons and failures of each estimator, and all side by side."""

import math
import shutil
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from scenarios.bench.bandwidth import bandwidth_classes, one_hertz_answer
from scenarios.bench.consistency import WHERE_IT_FAILS
from scenarios.bench.leaderboard_words import ORDERS_GIVEN
from scenarios.bench.metric import NEVER_JUDGED, Metric, Part, Verdict, excess
from scenarios.bench.result import Result
from scenarios.bench.result_tables import bandwidth_table, limits, metric_table, number, side_by_side
from scenarios.bench.run_progress import file_name
from scenarios.commands.output import print_table, say
from scenarios.estimators.outcome import KINDS, MODEL, REFUSED
from scenarios.files.printable import counted, one_line

SHOWN = 5
"""Parts of a metric, and reasons of failures, that are printed; the file has more."""


def show(results: Sequence[Result], out: Path, *, verbose: bool = False) -> None:
    """Print results."""
    for result in results:
        print_table(*metric_table(result))
        say(_wrapped(ORDERS_GIVEN) + "\n")
        recovered = bandwidth_classes(result.metrics)
        if recovered:
            print_table(*bandwidth_table(recovered))
            say(_wrapped(one_hertz_answer(recovered)) + "\n")
        show_reasons(result.metrics.values(), verbose=verbose)
        _show_failures(result)
        say(f"{out / file_name(result.estimator.name)}.json\n")
    if len(results) > 1:
        print_table(*side_by_side(results))
        say("  ".join(f"{verdict.sign} {verdict.word}" for verdict in Verdict) + "\n")
    for result in results:
        say(f"{result.estimator.name}: {_summary(result)}")


def record(results: Sequence[Result], out: Path) -> dict[str, Any]:
    """Results as JSON: those of one estimator, or of several by name."""
    records = {}
    for result in results:
        file = out / f"{file_name(result.estimator.name)}.json"
        records[result.estimator.name] = {**result.record(), "file": file}
    first = next(iter(records.values()))
    if len(results) == 1:
        return first
    passed = all(result.passed for result in results)
    return {"figures": first["figures"], "passed": passed, "estimators": records}


def _show_failures(result: Result) -> None:
    kinds = "".join(f"; {kind} {count}" for kind, count in result.outcomes.items() if kind != MODEL)
    answered = result.outcomes.get(MODEL, 0)
    requests = counted(sum(result.outcomes.values()), "request")
    say(f"{requests}, {answered} answered by a stable model{kinds}")
    for kind in result.outcomes:
        if kind not in (MODEL, REFUSED):
            say(f"  {kind}: {KINDS[kind]}")
    unlisted = result.failures
    for reason, count in list(result.reasons.items())[:SHOWN]:
        say(f"  {count} x {one_line(reason)}")
        unlisted -= count
    if result.reasons and unlisted > 0:
        say(f"  {unlisted} x for other reasons: the result file has the most frequent ones")


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
        elif judged is Verdict.NONE and metric.name not in NEVER_JUDGED:
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
