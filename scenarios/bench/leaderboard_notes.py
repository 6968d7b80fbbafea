"""Notes of the leaderboard: where its rows are not comparable, or not complete."""

from collections.abc import Iterable, Sequence

from scenarios.bench.leaderboard_rows import LeaderboardRow, common_problems
from scenarios.bench.leaderboard_verdict import GUIDE, INFORMATIVE, WORDS, Verdict, verdict
from scenarios.bench.result import Result
from scenarios.estimators.outcome import MODEL, REFUSED


def notes(rows: Sequence[LeaderboardRow]) -> list[str]:
    """Sentences for a reader who compares rows; none where all rows are alike, complete and of one run."""
    sentences = []
    for condition, consequence in WORDS["conditions"].items():
        groups = _grouped((_conditions(row.result)[condition], row) for row in rows)
        if len(groups) > 1:
            values = "; ".join(f"{value}: {_names(group)}" for value, group in groups.items())
            sentences.append(f"Rows differ in {condition}, so {consequence}. {values}.")
    # Rows run side by side share the mark of their run; one whose file names no run stands alone.
    runs = _grouped((row.result.run or f"\n{row.number}", row) for row in rows).values()
    if len(runs) > 1:
        parts = [f"run side by side: {_names(group)}" for group in runs if len(group) > 1]
        alone = [group[0] for group in runs if len(group) == 1]
        parts += [f"each run on its own: {_names(alone)}"] if alone else []
        text = "; ".join(parts)
        sentences.append(
            "Rows are not all of one run, so compare their speeds as multiples of the reference time only. "
            f"{text[:1].upper()}{text[1:]}."
        )
    return sentences + _incomplete(rows)


def _conditions(result: Result) -> dict[str, str]:
    """Settings that two results must share to compare."""
    return {
        "seed": str(result.seed),
        "effort": result.effort,
        "limits": f"{result.limits.seconds:g} s and {result.limits.memory_bytes / 2**20:.0f} MiB",
        "protocol": str(result.protocol),
        "version of the bench": result.versions.get("hmtb-twin", "not stated"),
        "machine": result.machine or "not stated",
    }


def _incomplete(rows: Sequence[LeaderboardRow]) -> list[str]:
    """Gaps of the table: metrics that were not computed, problems that were not answered or not judged."""
    sentences = []
    computed = _grouped((f"{len(GUIDE.keys() & row.result.metrics)} of {len(GUIDE)}", row) for row in rows)
    computed.pop(f"{len(GUIDE)} of {len(GUIDE)}", None)
    if computed:
        parts = [
            f"{number} computed: {'all rows' if len(group) == len(rows) > 1 else _names(group)}"
            for number, group in computed.items()
        ]
        judging = len(GUIDE) - len(INFORMATIVE)
        whole = f"all {len(GUIDE)} figures, of which {judging} give verdicts"
        sentences.append(f"Rows without {whole}: fewer could pass or fail. {'; '.join(parts)}.")
    answering = [row for row in rows if row.result.outcomes.get(MODEL)]
    for row in rows:
        if row not in answering:
            ends = ", ".join(f"{n} × {kind.replace('_', ' ')}" for kind, n in row.result.outcomes.items() if n)
            sentences.append(f"{row.name} gave no model at all ({ends or 'no request'}): it has not passed anything.")
        elif all(verdict(metric) is Verdict.NONE for metric in row.result.metrics.values()):
            sentences.append(f"Nothing of {row.name} could be judged: it has not passed anything.")
    refused = _grouped((_refusals(row), row) for row in answering if row.result.outcomes.get(REFUSED))
    for text, group in refused.items():
        verb = "is" if len(group) == 1 else "are"
        sentences.append(f"{_names(group)} refused {text}, and {verb} judged by the others only.")
    problems = common_problems(rows)
    lacking = _grouped((", ".join(row.unanswered(problems)), row) for row in answering)
    for text, group in lacking.items():
        if text:
            sentences.append(
                f"{_names(group)} answered too few records of {text} for a verdict: no response error, and all other "
                "numbers are of what was answered."
            )
    return sentences


def _refusals(row: LeaderboardRow) -> str:
    outcomes = row.result.outcomes
    kinds = ", ".join(f"{times} × {kind}" for kind, times in row.result.refused.items() if times)
    return f"{outcomes[REFUSED]} of {sum(outcomes.values())} requests{f' ({kinds})' if kinds else ''}"


def _grouped(pairs: Iterable[tuple[str, LeaderboardRow]]) -> dict[str, list[LeaderboardRow]]:
    groups: dict[str, list[LeaderboardRow]] = {}
    for key, row in pairs:
        groups.setdefault(key, []).append(row)
    return groups


def _names(rows: Sequence[LeaderboardRow]) -> str:
    return ", ".join(row.name for row in rows)
