"""Notes of the leaderboard: where its rows are not comparable, or not complete."""

from collections.abc import Iterable, Sequence

from scenarios.bench.leaderboard import Leaderboard, LeaderboardRow
from scenarios.bench.leaderboard_words import CONDITIONS, GUIDE
from scenarios.bench.metric import NEVER_JUDGED, Verdict
from scenarios.bench.result import Result
from scenarios.estimators.outcome import MODEL, REFUSED


def notes(board: Leaderboard) -> list[str]:
    """Sentences for a reader who compares rows; none where all rows are alike, complete and of one run."""
    rows = board.rows
    answering = [row for row in rows if row.result.outcomes.get(MODEL)]
    return [
        *_different_settings(rows),
        *_different_runs(rows),
        *_missing_metrics(rows),
        *_rows_without_verdict(rows),
        *_refusals(answering),
        *_unanswered_problems(answering, board.problems),
    ]


def _different_settings(rows: Sequence[LeaderboardRow]) -> list[str]:
    """A note for each setting in which rows differ, with what follows from it."""
    sentences = []
    for condition, consequence in CONDITIONS.items():
        groups = _grouped((_conditions(row.result)[condition], row) for row in rows)
        if len(groups) > 1:
            values = "; ".join(f"{value}: {_names(group)}" for value, group in groups.items())
            sentences.append(f"Rows differ in {condition}, so {consequence}. {values}.")
    return sentences


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


def _different_runs(rows: Sequence[LeaderboardRow]) -> list[str]:
    """A note where speeds were not measured side by side."""
    # Rows run side by side share the mark of their run; one whose file names no run stands alone.
    runs = list(_grouped((row.result.run or f"\n{row.number}", row) for row in rows).values())
    if len(runs) < 2:
        return []
    descriptions = [f"run side by side: {_names(group)}" for group in runs if len(group) > 1]
    alone = [group[0] for group in runs if len(group) == 1]
    if alone:
        descriptions.append(f"each run on its own: {_names(alone)}")
    runs_text = "; ".join(descriptions)
    advice = "Rows are not all of one run, so compare their speeds as multiples of the reference time only."
    return [f"{advice} {runs_text[:1].upper()}{runs_text[1:]}."]


def _missing_metrics(rows: Sequence[LeaderboardRow]) -> list[str]:
    """A note on rows that lack metrics."""
    incomplete = []
    for row in rows:
        count = len(GUIDE.keys() & row.result.metrics)
        if count < len(GUIDE):
            incomplete.append((f"{count} of {len(GUIDE)}", row))
    if not incomplete:
        return []
    groups, computed = _grouped(incomplete), []
    for share, group in groups.items():
        names = "all rows" if len(group) == len(rows) > 1 else _names(group)
        computed.append(f"{share} computed: {names}")
    judging = len(GUIDE) - len(NEVER_JUDGED)
    return [
        f"Rows without all {len(GUIDE)} figures, of which {judging} give verdicts: fewer could pass or fail. "
        f"{'; '.join(computed)}."
    ]


def _rows_without_verdict(rows: Sequence[LeaderboardRow]) -> list[str]:
    """Notes on estimators without any verdict: that none failed does not mean that one passed."""
    sentences = []
    for row in rows:
        outcomes = row.result.outcomes
        if not outcomes.get(MODEL):
            ends = ", ".join(f"{times} × {outcome.replace('_', ' ')}" for outcome, times in outcomes.items() if times)
            sentences.append(f"{row.name} gave no model at all ({ends or 'no request'}): it has not passed anything.")
        elif all(metric.verdict is Verdict.NONE for metric in row.result.metrics.values()):
            sentences.append(f"Nothing of {row.name} could be judged: it has not passed anything.")
    return sentences


def _refusals(answering: Sequence[LeaderboardRow]) -> list[str]:
    """Notes on estimators that refused requests."""
    sentences = []
    groups = _grouped((_refused_requests(row.result), row) for row in answering if row.result.outcomes.get(REFUSED))
    for requests, group in groups.items():
        verb = "is" if len(group) == 1 else "are"
        sentences.append(f"{_names(group)} refused {requests}, and {verb} judged by the others only.")
    return sentences


def _refused_requests(result: Result) -> str:
    requests = f"{result.outcomes[REFUSED]} of {sum(result.outcomes.values())} requests"
    families = ", ".join(f"{times} × {family}" for family, times in result.refused.items() if times)
    return f"{requests} ({families})" if families else requests


def _unanswered_problems(answering: Sequence[LeaderboardRow], problems: Sequence[str]) -> list[str]:
    """Notes on estimators that answered too few records of a problem."""
    sentences = []
    for unanswered, group in _grouped((", ".join(row.unanswered(problems)), row) for row in answering).items():
        if unanswered:
            sentences.append(
                f"{_names(group)} answered too few records of {unanswered} for a verdict: no response error, and all "
                "other numbers are of what was answered."
            )
    return sentences


def _grouped(keyed_rows: Iterable[tuple[str, LeaderboardRow]]) -> dict[str, list[LeaderboardRow]]:
    groups: dict[str, list[LeaderboardRow]] = {}
    for key, row in keyed_rows:
        groups.setdefault(key, []).append(row)
    return groups


def _names(rows: Sequence[LeaderboardRow]) -> str:
    return ", ".join(row.name for row in rows)
