"""A data set as the station presents it: what it holds, and one of its records with a log to replay."""

from dataclasses import replace
from pathlib import Path

from scenarios.datasets.data_set import open_data_set
from scenarios.datasets.experiment_file import experiment_log
from scenarios.datasets.record_block import PARTS
from scenarios.experiments.presentation import Presentation, present_log
from scenarios.experiments.recipe import Recipe

MOST_PARTS = 300
"""Records that a menu lists."""


def present_data_set(path: Path, part: str) -> Presentation:
    """Summarise the folder of a data set and, if one is named, one of its experiments."""
    data = open_data_set(path)
    names = [record.name for record in data.index if record.failed is None]
    counts = ", ".join(f"{len(data.records(purpose))} to {purpose}" for purpose in PARTS)
    code = f"from scenarios.datasets import open_data_set\n\ndata = open_data_set({str(path)!r})"
    if part:
        code += f"\nrecord = data.record({part!r})"
    presentation = Presentation(
        "data set",
        str(path),
        Recipe([("hmtb", "dataset", "check", str(path))], code),
        (),
        [f"{data.label}: {len(names)} records, {counts}; hash {data.hash}"],
        part,
        names[:MOST_PARTS],
    )
    if len(names) > MOST_PARTS:
        presentation = replace(
            presentation, lines=[*presentation.lines, f"the menu lists the first {MOST_PARTS} records"]
        )
    if not part:
        return presentation
    record = data.record(part)
    about = (
        f"{part}: {record.part}, block {record.block}, {record.arm}, {', '.join(record.joints)}, {len(record)} samples"
    )
    log, origin = experiment_log(data, part)
    # Without a log there is nothing to replay: the data set is shown, with the reason.
    log_or_data_set = presentation if log is None else present_log(log)
    return replace(
        log_or_data_set,
        kind=presentation.kind,
        place=str(path),
        recipe=presentation.recipe,
        part=part,
        parts=presentation.parts,
        lines=[about, origin, *log_or_data_set.lines],
    )
