"""`hmtb dataset grade`: submissions of a class, scored against withheld data sets."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import print_json, print_table, progress, say

if TYPE_CHECKING:
    from scenarios.datasets.grade import Grade


def grade(
    withheld: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="WITHHELD")],
    submissions: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SUBMISSIONS")],
    /,
    *,
    json: bool = False,
) -> int:
    """Grade predictions and models against the complete data sets in a withheld folder.

    A submission is a folder of predictions as hmtb dataset score reads them, one for each test record, and if wanted
    of models model-JOINT.json with matrices A, B, C, D and dt; without predictions the models are scored. Where each
    person has a data set, the folders in SUBMISSIONS are named after the persons. Nothing of a submission is executed.
    Exits with 1 if a submission cannot be graded.

      hmtb dataset grade withheld submissions

    Args:
        withheld: Folder that hmtb dataset build --withhold created.
        submissions: A folder of submissions, or one submission.
        json: Print JSON.
    """
    from scenarios.datasets.grade import grade_all

    with progress("grading") as report:
        grades = grade_all(withheld, submissions, progress=report)
    refused = {name: one for name, one in grades.items() if isinstance(one, str)}
    graded = {name: one for name, one in grades.items() if not isinstance(one, str)}
    if json:
        print_json({"grades": {name: _record(one) for name, one in graded.items()}, "refused": refused})
        return 1 if refused else 0
    if graded:
        rule = next(iter(graded.values())).scores.scoring
        columns = ("submission", f"{rule.metric} / {rule.unit}", "attainable", "best baseline", "its score")
        print_table("scores", columns, [_row(name, one) for name, one in graded.items()])
    models = [(name, model) for name, one in graded.items() for model in one.models]
    if models:
        rows = [
            (
                name,
                m.joint,
                f"{m.bandwidth_hz:.4g}",
                f"{m.true_hz:.4g}",
                f"{m.error_percent:.3g}",
                "" if m.stable else "no",
            )
            for name, m in models
        ]
        print_table("models", ("submission", "joint", "bandwidth / Hz", "true", "error / %", "stable"), rows)
    for name, why in refused.items():
        say(f"refused: {name}: {why}")
    return 1 if refused else 0


def _row(name: str, one: "Grade") -> tuple[str, ...]:
    attainable = "-" if one.attainable is None else f"{one.attainable:.4g}"
    method, score = one.best_baseline or ("-", None)
    return (name, f"{one.scores.mean:.6g}", attainable, method, "-" if score is None else f"{score:.4g}")


def _record(one: "Grade") -> dict[str, object]:
    best = one.best_baseline
    return {
        "data_set": one.data_set,
        "metric": one.scores.scoring.metric,
        "unit": one.scores.unit,
        "score": one.scores.mean,
        "joints": one.scores.by_joint,
        "attainable": one.attainable,
        "best_baseline": {"method": best[0], "score": best[1]} if best else None,
        "scores": [vars(score) for score in one.scores.scores],
        "models": [{**vars(model), "error_percent": model.error_percent} for model in one.models],
    }
