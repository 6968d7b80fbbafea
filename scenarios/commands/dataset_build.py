"""`hmtb dataset build`: a data set from its spec."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.build_progress import How, build_progress
from scenarios.commands.output import print_json, say

if TYPE_CHECKING:
    from scenarios.datasets.progress import Progress


def build(
    spec: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SPEC")],
    /,
    *,
    out: Path = Path("."),
    workers: int | None = None,
    rows: int | None = None,
    cluster: str | None = None,
    patience: float = 300.0,
    progress: How = "auto",
    json: bool = False,
) -> int:
    """Build a data set into a folder of its own, or go on with a build that was interrupted.

    Nothing is lost if a build is interrupted, killed or out of disk: the same command goes on from there and ends in
    the same bytes. An experiment that fails is noted with its reason; the rest goes on, and the exit code is 1.

    Args:
        spec: One that comes with the package (hmtb dataset list) or a TOML file.
        out: Folder in which that of the data set is made.
        workers: Threads for the physics, all processors by default; the data do not depend on it.
        rows: Experiments that run side by side at most: fewer need less memory, and less is run again after an
            interruption. The data do not depend on it.
        cluster: Address of a Dask scheduler (tcp://HOST:8786) whose workers run the experiments; they need this
            package, of the same version, and no folder in common. The data do not depend on them.
        patience: How long a scheduler that has gone, or workers that are not there, are waited for, s.
        progress: How stderr shows how far the build is; auto is a bar on a terminal, else a line now and then.
        json: Print JSON.
    """
    from scenarios.datasets.build import build as build_data_set
    from scenarios.datasets.chunk import MOST_ROWS
    from scenarios.datasets.layout import UNFINISHED
    from scenarios.datasets.spec import load_spec
    from scenarios.errors import ScenarioError

    if workers is not None and workers < 1:
        raise ScenarioError(f"workers must be 1 or more, given {workers}")
    executor = None
    if cluster is not None:
        from scenarios.datasets.cluster import ROWS, Cluster

        if workers is not None:
            raise ScenarioError("--workers and --cluster given; expected one: Dask's workers have threads of their own")
        executor, usual = Cluster(cluster, patience=patience, said=_said), ROWS
    else:
        usual = MOST_ROWS
    read = load_spec(spec)
    latest: list[Progress] = []
    with build_progress(read.label, progress) as show:

        def told(now: "Progress") -> None:
            latest[:] = [now]
            show(now)

        try:
            built = build_data_set(
                read, out, workers=workers, rows=usual if rows is None else rows, executor=executor, progress=told
            )
        except KeyboardInterrupt:
            raise KeyboardInterrupt(_kept(latest, out / (read.label + UNFINISHED))) from None
    if json:
        print_json({"path": built.path, "experiments": built.experiments, "failed": built.failed, "hash": built.hash})
    else:
        for name, why in built.failed.items():
            say(f"failed: {name}: {why}")
        say(f"{built.path}: {built.experiments} experiments, {len(built.failed)} failed, hash {built.hash[:12]}")
    return 1 if built.failed else 0


def _said(line: str) -> None:
    """A line on stderr; a bar that is there stays below it."""
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def _kept(latest: "list[Progress]", folder: Path) -> str:
    """What is kept of an interrupted build."""
    if not latest or not folder.is_dir():
        return ""
    (now,) = latest
    done = f"{now.done} of {now.total} experiments" if now.seconds_total else "all experiments"
    return f"{done if now.step != 'check' else 'what was done'} kept in {folder}"
