"""`hmtb dataset grade`: submissions of a class, scored against withheld data sets."""

from collections.abc import Mapping
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
    refused: dict[str, str] = {}
    graded: dict[str, Grade] = {}
    for name, outcome in grades.items():
        if isinstance(outcome, str):  # the reason
            refused[name] = outcome
        else:
            graded[name] = outcome
    # Without a roster there is one data set, whose person has no name.
    missing = sorted(set(read_persons(withheld)) - grades.keys() - {""})
    code = 1 if refused else 0
    if json:
        records = {name: _json_record(graded[name]) for name in graded}
        print_json({"grades": records, "refused": refused, "missing": missing})
        return code
    _print_scores(graded)
    _print_models(graded)
    if missing:
        say_each("nothing from: ", [", ".join(missing)])
    say_each("refused: ", (f"{name}: {why}" for name, why in refused.items()))
    return code


def _print_scores(graded: "Mapping[str, Grade]") -> None:
    if not graded:
        return
    rows = []
    for name, outcome in graded.items():
        method, best = outcome.best_baseline or ("-", None)
        attainable = "-" if outcome.attainable is None else f"{outcome.attainable:.4g}"
        best_score = "-" if best is None else f"{best:.4g}"
        remark = "better than the noise allows: copied?" if outcome.too_good else ""
        rows.append((name, f"{outcome.scores.mean:.4g}", attainable, method, best_score, remark))
    rule = next(iter(graded.values())).scores.scoring
    columns = ("submission", f"{rule.metric} / {rule.unit}", "attainable", "best baseline", "its score", "remark")
    print_table("scores", columns, rows)


def _print_models(graded: "Mapping[str, Grade]") -> None:
    rows = []
    for name, outcome in graded.items():
        for model in outcome.models:
            bandwidths = (f"{model.bandwidth_hz:.4g}", f"{model.true_hz:.4g}", f"{model.error_percent:.3g}")
            stable = "" if model.stable else "no"
            rows.append((name, model.joint, *bandwidths, stable))
    if rows:
        columns = ("submission", "joint", "bandwidth / Hz", "true, small-signal", "error / %", "stable")
        print_table("models", columns, rows)


def _json_record(outcome: "Grade") -> dict[str, object]:
    best = outcome.best_baseline
    scores, rule = outcome.scores, outcome.scores.scoring
    return {
        "data_set": outcome.data_set,
        "metric": rule.metric,
        "unit": rule.unit,
        "score": scores.mean,
        "joints": scores.by_joint,
        "attainable": outcome.attainable,
        "too_good": outcome.too_good,
        "best_baseline": {"method": best[0], "score": best[1]} if best else None,
        "scores": [score._asdict() for score in scores.scores],
        "models": [{**model._asdict(), "error_percent": model.error_percent} for model in outcome.models],
    }
