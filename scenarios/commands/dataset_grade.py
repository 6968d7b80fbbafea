"""`hmtb dataset grade`: submissions of a class, scored against withheld data sets."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import print_json, print_table, progress, say_each

if TYPE_CHECKING:
    from scenarios.datasets.grade import Grade


def grade(
    withheld: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="WITHHELD")],
    submissions: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SUBMISSIONS")],
    *,
    json: bool = False,
) -> int:
    """Grade predictions and models against withheld data sets.

    A submission is a folder of predictions as hmtb dataset score reads them, one for each test record, and
    optionally of models model-JOINT.json, as hmtb identify --save writes them or with matrices A, B, C, D and dt;
    without predictions the models are scored. Where each person has a data set, the folders in SUBMISSIONS are named
    after the persons; those without one are listed. A score better than the recorder's noise allows is marked. No code
    of a submission is executed. Exits with 1 if a submission cannot be graded.

      hmtb dataset grade withheld submissions

    Args:
        withheld: Folder that hmtb dataset build --withhold created.
        submissions: A folder of submissions, or one submission.
        json: Print JSON.
    """
    from scenarios.datasets.grade import grade_all
    from scenarios.datasets.withhold import read_persons

    with progress("grading") as report:
        grades = grade_all(withheld, submissions, progress=report)
    refused = {name: one for name, one in grades.items() if isinstance(one, str)}
    graded = {name: one for name, one in grades.items() if not isinstance(one, str)}
    missing = sorted(set(read_persons(withheld)) - grades.keys() - {""})
    code = 1 if refused else 0
    if json:
        print_json(
            {"grades": {name: _record(one) for name, one in graded.items()}, "refused": refused, "missing": missing}
        )
        return code
    if graded:
        rows = []
        for name, one in graded.items():
            method, best = one.best_baseline or ("-", None)
            numbers = ("-" if value is None else f"{value:.4g}" for value in (one.attainable, best))
            remark = "better than the noise allows: copied?" if one.too_good else ""
            rows.append((name, f"{one.scores.mean:.4g}", next(numbers), method, next(numbers), remark))
        rule = next(iter(graded.values())).scores.scoring
        columns = ("submission", f"{rule.metric} / {rule.unit}", "attainable", "best baseline", "its score", "remark")
        print_table("scores", columns, rows)
    models = [
        (name, m.joint, f"{m.bandwidth_hz:.4g}", f"{m.true_hz:.4g}", f"{m.error_percent:.3g}", "" if m.stable else "no")
        for name, one in graded.items()
        for m in one.models
    ]
    if models:
        print_table(
            "models", ("submission", "joint", "bandwidth / Hz", "true, small-signal", "error / %", "stable"), models
        )
    say_each("nothing from: ", [", ".join(missing)] if missing else [])
    say_each("refused: ", (f"{name}: {why}" for name, why in refused.items()))
    return code


def _record(one: "Grade") -> dict[str, object]:
    best = one.best_baseline
    return {
        "data_set": one.data_set,
        "metric": one.scores.scoring.metric,
        "unit": one.scores.scoring.unit,
        "score": one.scores.mean,
        "joints": one.scores.by_joint,
        "attainable": one.attainable,
        "too_good": one.too_good,
        "best_baseline": {"method": best[0], "score": best[1]} if best else None,
        "scores": [score._asdict() for score in one.scores.scores],
        "models": [{**model._asdict(), "error_percent": model.error_percent} for model in one.models],
    }
