"""`hmtb dataset build`: a data set from its spec."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from scenarios.commands.output import print_json, say, say_beside_bar
from scenarios.jobs.progress import How, Progress, show_progress

MOST_REASONS = 20
"""Reasons of failures that are printed."""

if TYPE_CHECKING:
    from scenarios.jobs.executor import Executor


def build(
    spec: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SPEC")],
    /,
    *,
    out: Path = Path("."),
    withhold: Annotated[Path | None, tyro.conf.arg(metavar="FOLDER")] = None,
    students: Annotated[Path | None, tyro.conf.arg(metavar="ROSTER")] = None,
    seed: int | None = None,
    workers: int | None = None,
    rows: int | None = None,
    cluster: str | None = None,
    patience: float = 300.0,
    progress: How = "auto",
    json: bool = False,
) -> int:
    """Build a data set into a folder of its own; an interrupted build resumes with the same command.

    Nothing is lost if a build is interrupted, killed or out of disk: run the command again, and it ends in the same
    bytes. An experiment that fails is listed with its reason; the rest continues, and the exit code is 1.

    With --withhold the data set in --out holds nothing from which its truth can be computed: no truth, no seeds, and of
    scored records only the outputs of the initialisation window. FOLDER keeps the complete data sets for hmtb dataset
    grade.

      hmtb dataset build class.toml --withhold withheld --students roster.txt --out class

    Args:
        spec: A data set that comes with the package (hmtb dataset list) or a TOML file.
        out: Folder in which the folder of the data set is created.
        withhold: Publish without the truth, and keep the complete data sets and their seeds in this folder.
        students: A data set for each person, with arms, noise and waveforms of its own: a text file, one name per line.
        seed: With --withhold: seeds follow from it; by default they are drawn from the system's randomness.
        workers: Threads for the physics, all processors by default; the data do not depend on it.
        rows: Experiments that run side by side at most: fewer need less memory; the data do not depend on it.
        cluster: Address of a Dask scheduler, tcp://HOST:8786, whose workers run the experiments with this package.
        patience: How long to wait for a lost scheduler or for missing workers, s.
        progress: How stderr shows the progress; auto is a bar on a terminal, else a line now and then.
        json: Print JSON.
    """
    from scenarios.datasets.build import build as build_data_set
    from scenarios.datasets.chunk import MOST_ROWS
    from scenarios.datasets.plan import UNFINISHED
    from scenarios.datasets.spec import load_spec
    from scenarios.datasets.withhold import build_withheld, read_roster
    from scenarios.files.errors import ScenarioError

    if workers is not None and workers < 1:
        raise ScenarioError(f"workers must be 1 or more, given {workers}")
    for option, value in (("--students", students), ("--seed", seed)):
        if value is not None and withhold is None:
            raise ScenarioError(f"{option} given without --withhold FOLDER; the seed of other data sets is in the spec")
    executor: Executor[Any] | None = None
    if cluster is not None:
        from scenarios.datasets.chunk import CLUSTER_ROWS
        from scenarios.jobs.cluster import Cluster

        if workers is not None:
            raise ScenarioError("--workers and --cluster given; expected one: Dask's workers have threads of their own")
        executor, usual = Cluster(cluster, patience=patience, report=say_beside_bar), CLUSTER_ROWS
    else:
        usual = MOST_ROWS
    work: dict[str, Any] = {"workers": workers, "rows": usual if rows is None else rows, "executor": executor}
    read = load_spec(spec)
    latest: list[Progress] = []
    with show_progress(read.label, progress) as show:

        def update(now: Progress) -> None:
            latest[:] = [now]
            show(now)

        if withhold is not None:
            persons = () if students is None else read_roster(students)
            try:
                done = build_withheld(read, out, withhold, persons=persons, seed=seed, **work, progress=update)
            except KeyboardInterrupt:
                raise KeyboardInterrupt(f"finished experiments kept in {withhold}") from None
            if json:
                print_json({"paths": done.paths, "withheld": done.withheld, "failed": done.failed})
            else:
                _say_failed(done.failed)
                for folder in done.paths:
                    say(str(folder))
                say(f"{done.withheld}: keep it secret: it holds the truth and the seeds, and grades submissions")
            return 1 if done.failed else 0
        try:
            built = build_data_set(read, out, **work, progress=update)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(_kept(latest, out / (read.label + UNFINISHED))) from None
    if json:
        print_json({"path": built.path, "experiments": built.experiments, "failed": built.failed, "hash": built.hash})
    else:
        _say_failed(built.failed)
        say(f"{built.path}: {built.experiments} experiments, {len(built.failed)} failed, hash {built.hash[:12]}")
    return 1 if built.failed else 0


def _say_failed(failed: Mapping[str, str]) -> None:
    """Print what failed; a reason that many experiments share is printed once."""
    names: dict[str, list[str]] = {}
    for name, why in failed.items():
        # The laboratory names the experiment too; names of a class come with the label of the data set.
        names.setdefault(why.removeprefix(f"{name.rpartition(': ')[2]}: "), []).append(name)
    for why, same in list(names.items())[:MOST_REASONS]:
        say(f"failed: {same[0]}{f' and {len(same) - 1} more' if len(same) > 1 else ''}: {why}")
    if len(names) > MOST_REASONS:
        say(f"failed: {sum(map(len, list(names.values())[MOST_REASONS:]))} more, for other reasons; the index has them")


def _kept(latest: list[Progress], folder: Path) -> str:
    """What an interrupted build has kept."""
    if not latest or not folder.is_dir():
        return ""
    (now,) = latest
    done = f"{now.done} of {now.total} experiments" if now.seconds_total else "all experiments"
    return f"{done if now.step != 'check' else 'what was done'} kept in {folder}"
