"""A data set as it is opened: what it holds, and one of its records with a log to replay."""

from dataclasses import replace
from pathlib import Path

from scenarios.datasets.data_set import open_data_set
from scenarios.datasets.experiment_file import experiment_log
from scenarios.datasets.spec_tables import PARTS
from scenarios.experiments.opened import Opened, open_log
from scenarios.experiments.recipe import Recipe

MOST_PARTS = 300
"""Records that a menu lists."""


def opened_data_set(path: Path, part: str) -> Opened:
    """Summarise the folder of a data set and, if one is named, one of its experiments."""
    data = open_data_set(path)
    names = [one.name for one in data.index if one.failed is None]
    counts = ", ".join(f"{len(data.records(aim))} to {aim}" for aim in PARTS)
    code = f"from scenarios.datasets import open_data_set\n\ndata = open_data_set({str(path)!r})"
    opened = Opened(
        "data set",
        str(path),
        Recipe([("hmtb", "dataset", "check", str(path))], code + f"\nrecord = data.record({part!r})" * bool(part)),
        (),
        [f"{data.label}: {len(names)} records, {counts}; hash {data.hash}"],
        part,
        names[:MOST_PARTS],
    )
    if len(names) > MOST_PARTS:
        opened = replace(opened, lines=[*opened.lines, f"the menu lists the first {MOST_PARTS} records"])
    if not part:
        return opened
    record = data.record(part)
    about = (
        f"{part}: {record.part}, block {record.block}, {record.arm}, {', '.join(record.joints)}, {len(record)} samples"
    )
    log, origin = experiment_log(data, part)
    own = opened if log is None else open_log(log)
    return replace(
        own,
        kind=opened.kind,
        place=str(path),
        recipe=opened.recipe,
        part=part,
        parts=opened.parts,
        lines=[about, origin, *own.lines],
    )
