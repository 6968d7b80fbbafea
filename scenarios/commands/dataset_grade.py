"""`hmtb dataset grade`: submissions of a class, scored against withheld data sets."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import print_json, print_tables, progress, say_each

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
    from scenarios.datasets.result_tables import grade_tables
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
        records = {name: outcome.record() for name, outcome in graded.items()}
        print_json({"grades": records, "refused": refused, "missing": missing})
        return code
    print_tables(grade_tables(graded))
    if missing:
        say_each("nothing from: ", [", ".join(missing)])
    say_each("refused: ", (f"{name}: {why}" for name, why in refused.items()))
    return code
