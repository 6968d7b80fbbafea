"""`hmtb dataset grade`: what students hand in, held against the truth in a key."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import print_json, print_table, progress, say

if TYPE_CHECKING:
    from scenarios.datasets.challenge_grade import Grade, ModelGrade


def grade(
    submission: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SUBMISSION")],
    /,
    *,
    key: Path,
    student: str | None = None,
    json: bool = False,
) -> int:
    """Grade predictions, models and bandwidths against a truth that is kept apart.

    A submission is a folder of predictions as hmtb dataset score reads them, one for each record of the test part, and
    if wanted of bandwidths.csv (columns joint, bandwidth_hz) and models model-JOINT.json, .mat or .nc. A folder that
    holds folders is graded one by one; where each student has a data set, they are named after the students. Nothing of
    a submission is executed. Exits with 1 if one of several submissions is refused, with 2 if the only one is.

      hmtb dataset grade submissions --key class.key

    Args:
        submission: The folder of a submission, or a folder of them.
        key: The key file of the data set.
        student: Whose submission it is, where each has a data set.
        json: Print JSON.
    """
    from scenarios.datasets.challenge_grade import grade as grade_one
    from scenarios.datasets.challenge_grade import grade_all, holds_submissions
    from scenarios.files.errors import ScenarioError

    if not holds_submissions(submission):
        found = grade_one(submission, key, student=student)
        if json:
            print_json(_record(found))
            return 0
        _print(found)
        return 0
    if student is not None:
        raise ScenarioError(f"student {student!r} given; the folders in {submission} are named after the students")
    with progress("grading") as report:
        grades = grade_all(submission, key, progress=report)
    refused = {name: one for name, one in grades.items() if isinstance(one, str)}
    done = {name: one for name, one in grades.items() if not isinstance(one, str)}
    if json:
        print_json({"grades": {name: _record(one) for name, one in done.items()}, "refused": refused})
        return 1 if refused else 0
    if done:
        _print_all(done)
        for remark in dict.fromkeys(remark for one in done.values() for remark in one.remarks):
            say(f"remark: {', '.join(name for name, one in done.items() if remark in one.remarks)}: {remark}")
    for name, why in refused.items():
        say(f"refused: {name}: {why}")
    return 1 if refused else 0


def _print(found: "Grade") -> None:
    rule, unit = found.scores.scoring, found.scores.unit
    rows = [(one.experiment, one.joint, f"{one.value:.6g}") for one in found.scores.scores]
    print_table(f"{found.label}: {rule.metric} / {unit}", ("record", "output", rule.metric), rows)
    if found.models:
        columns = ("model", "joint", "bandwidth / Hz", "true", "error / %", "gain error / %", "poles", "response / %")
        print_table("models", columns, [_cells(one) for one in found.models])
        for one in found.models:
            if not one.stable:
                say(f"{one.source} is unstable")
    for remark in found.remarks:
        say(f"remark: {remark}")
    for name, value in found.baselines.items():
        say(f"baseline {name}: {value:.6g} {unit}")
    if found.floor is not None:
        say(f"best attainable: {found.floor:.6g} {unit}")
    say(f"score: {found.scores.mean:.6g} {unit} ({rule.metric}, mean over all records and outputs)")


def _print_all(grades: "dict[str, Grade]") -> None:
    first = next(iter(grades.values()))
    rule, unit = first.scores.scoring, first.scores.unit
    columns = (
        "submission",
        f"{rule.metric} / {unit}",
        "attainable",
        "best baseline",
        "its score",
        "bandwidth / %",
        "response / %",
    )
    rows = []
    for name, one in grades.items():
        method, value = one.best_baseline or ("-", math.nan)
        rows.append(
            (
                name,
                f"{one.scores.mean:.6g}",
                _number(one.floor),
                method,
                _number(value),
                _largest(one, "bandwidth"),
                _largest(one, "response"),
            )
        )
    print_table("grades; errors of models are the largest of each submission", columns, rows)


def _cells(one: "ModelGrade") -> tuple[str, ...]:
    numbers = (
        one.values["bandwidth_hz"],
        one.truth["bandwidth_hz"],
        *(one.errors.get(name) for name in ("bandwidth", "dc_gain", "poles", "response")),
    )
    return (one.source, one.joint, *map(_number, numbers))


def _largest(one: "Grade", error: str) -> str:
    values = [abs(model.errors[error]) for model in one.models if error in model.errors]
    # A model without a bandwidth has an error that is no number, and no smaller one hides it.
    return _number(math.nan if any(map(math.isnan, values)) else max(values, default=None))


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _record(found: "Grade") -> dict[str, object]:
    best = found.best_baseline
    return {
        "data_set": found.label,
        "metric": found.scores.scoring.metric,
        "unit": found.scores.unit,
        "score": found.scores.mean,
        "joints": found.scores.by_joint,
        "attainable": found.floor,
        "best_baseline": {"method": best[0], "score": best[1]} if best else None,
        "baselines": found.baselines,
        "scores": [vars(one) for one in found.scores.scores],
        "models": [vars(one) for one in found.models],
        "remarks": found.remarks,
    }
