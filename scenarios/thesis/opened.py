"""A study of the thesis as it is opened: its results, and one of its tests with a log to replay."""

from dataclasses import replace
from pathlib import Path

from hmtb_twin import JointLog
from scenarios.experiments.campaign import campaign_scenario
from scenarios.experiments.presentation import Presentation, present_log, present_scenario
from scenarios.experiments.recipe import Recipe
from scenarios.thesis.campaign import EVERY_TEST
from scenarios.thesis.results import read_results, result_tables


def open_study(path: Path, part: str) -> Presentation:
    """Open the folder of a study, or one of its tests: its log, or the test simulated again."""
    record = read_results(path)
    if part:
        if (path / f"{part}.nc").is_file():
            opened_test = present_log(JointLog.load(path / f"{part}.nc"), str(path / f"{part}.nc"))
        else:
            # The noise is drawn from the seed: the simulation repeats the log that was not kept.
            test = campaign_scenario(part, seed=record["seed"], duration=record["duration"])
            opened_test = present_scenario(test, f"{part}.toml")
        return replace(opened_test, place=str(path), part=part, parts=EVERY_TEST)
    *bandwidths, findings = result_tables(record)
    logs_kept = sum((path / f"{name}.nc").is_file() for name in EVERY_TEST)
    seed = [] if record["seed"] is None else ["--seed", str(record["seed"])]
    command = ("hmtb", "thesis", *seed, "--out", str(path))
    code = (
        "from pathlib import Path\n\nfrom scenarios.thesis.results import read_results\n\n"
        f"record = read_results(Path({str(path)!r}))"
    )
    logs = f"logs kept: {logs_kept} of {len(EVERY_TEST)}; others are simulated"
    return Presentation(
        "study",
        str(path),
        Recipe([command], code),
        [findings, *bandwidths],
        [record["answer"], record["certainty"], logs],
        parts=EVERY_TEST,
    )
