"""`hmtb dataset`: benchmark data sets, built, checked, exported and scored."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import tyro

from scenarios.commands.output import print_json, print_table, progress, say


def build(
    spec: Annotated[str, tyro.conf.Positional],
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

    with progress("building") as report:
        built = build_data_set(load_spec(spec), out, workers=workers, progress=report)
    if json:
        print_json({"path": built.path, "experiments": built.experiments, "failed": built.failed, "hash": built.hash})
    else:
        say(f"{built.path}: {built.experiments} experiments, {len(built.failed)} failed, hash {built.hash[:12]}")
    return 1 if built.failed else 0


def list_(*, json: bool = False) -> int:
    """List the data sets that come with the package.

    Args:
        json: Print JSON.
    """
    from scenarios.datasets.plan import Plan
    from scenarios.datasets.spec import shipped

    plans = {label: Plan(spec) for label, spec in shipped().items()}
    if json:
        print_json(
            {
                "data_sets": [
                    {"label": label, "title": plan.spec.title, "experiments": len(plan), "seconds": plan.seconds}
                    for label, plan in plans.items()
                ]
            }
        )
        return 0
    rows = [(label, str(len(p)), f"{p.seconds / 3600:.3g} h", p.spec.title) for label, p in plans.items()]
    print_table("data sets", ("name", "experiments", "length", "what it is"), rows)
    return 0


DATASET: dict[str, Callable[..., int]] = {"list": list_, "build": build}
"""What can be done with data sets, by the word after `hmtb dataset`."""
