"""`hmtb dataset build`: a data set from its spec."""

from pathlib import Path
from typing import Annotated

import tyro

from scenarios.commands.output import print_json, progress, say


def build(
    spec: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SPEC")],
    /,
    *,
    out: Path = Path("."),
    workers: int | None = None,
    json: bool = False,
) -> int:
    """Build a data set into a folder of its own, or go on with a build that was interrupted.

    Args:
        spec: One that comes with the package (hmtb dataset list) or a TOML file.
        out: Folder in which that of the data set is made.
        workers: Threads for the physics; the data do not depend on it.
        json: Print JSON.
    """
    from scenarios.datasets.build import build as build_data_set
    from scenarios.datasets.spec import load_spec

    with progress("building") as bar:
        built = build_data_set(load_spec(spec), out, workers=workers, progress=lambda p: bar(p.done, p.total, p.step))
    if json:
        print_json({"path": built.path, "experiments": built.experiments, "failed": built.failed, "hash": built.hash})
    else:
        say(f"{built.path}: {built.experiments} experiments, {len(built.failed)} failed, hash {built.hash[:12]}")
    return 1 if built.failed else 0
