"""`hmtb dataset score`: predictions scored by the rule of a data set."""

from pathlib import Path
from typing import Annotated

import tyro

from scenarios.commands.output import print_json, print_table, say


def score(
    predictions: Annotated[tuple[Path, ...], tyro.conf.Positional],
    /,
    *,
    data: Path,
    json: bool = False,
) -> int:
    """Score predicted outputs of the test part of a data set.

    The score is that which the data set states in its spec: metric, unit, and how many steps ahead outputs are
    predicted. Of 0 steps, a simulation, inputs may be used, and outputs of the initialisation window alone; of others
    also outputs that lie so far back. The window is not scored. The overall score is the arithmetic mean over all
    records and outputs of the test part, which must all be there.

    Predictions are a folder, or files, one for each record of the test part. Each is named after the experiment and has
    all samples of the record, as angles in rad: EXPERIMENT.csv, whose first row names the outputs; EXPERIMENT.nc with
    a variable y of samples by outputs and their names in a variable output; EXPERIMENT.mat with a matrix y of samples
    by outputs.

      hmtb dataset score my-predictions --data hmtb-siso-v1

    Args:
        predictions: Folder or files of predictions.
        data: Folder of the data set.
        json: Print JSON.
    """
    from scenarios.datasets.score import score as score_predictions

    found = score_predictions(predictions, data)
    rule = found.scoring
    if json:
        print_json(
            {
                "metric": rule.metric,
                "unit": found.unit,
                "steps": rule.steps,
                "mean": found.mean,
                "joints": found.by_joint,
                "scores": [vars(one) for one in found.scores],
            }
        )
        return 0
    rows = [(one.experiment, one.joint, f"{one.value:.6g}") for one in found.scores]
    print_table(f"{rule.metric} / {found.unit}", ("record", "output", rule.metric), rows)
    for joint, value in found.by_joint.items():
        say(f"{joint}: {value:.6g} {found.unit}, mean over its records")
    how = "in simulation" if rule.steps == 0 else f"{rule.steps} step{'s' if rule.steps > 1 else ''} ahead"
    say(f"score: {found.mean:.6g} {found.unit} ({rule.metric} {how}, mean over all records and outputs)")
    return 0
