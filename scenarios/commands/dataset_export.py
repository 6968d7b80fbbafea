"""`hmtb dataset export`: the records of a data set in formats that other programs read."""

from pathlib import Path
from typing import Annotated

import tyro

from scenarios.commands.output import print_json, progress, say


def export(
    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")],
    /,
    *,
    format: str = "mat",
    out: Path = Path("."),
    json: bool = False,
) -> int:
    """Export the records of a data set as .mat, CSV, Parquet or ASCII files, with the same numbers to the last bit.

    hmtb dataset export hmtb-siso-v1 --format mat,csv --out exported

    Each format becomes a folder of its own, named after the data set. Only the data are exported, never the truth.

    Args:
        folder: The data set.
        format: Formats, separated by commas: mat (MATLAB 5), csv, parquet, ascii (the flat file of the thesis).
        out: Folder in which those of the formats are made.
        json: Print JSON.
    """
    from scenarios.datasets.export import export as export_data_set

    names = [name.strip() for name in format.split(",") if name.strip()]
    with progress("exporting") as report:
        made = export_data_set(folder, out, names, progress=report)
    if json:
        print_json({"folders": made})
    for path in () if json else made:
        say(str(path))
    return 0
