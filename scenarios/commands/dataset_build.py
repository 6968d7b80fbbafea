"""`hmtb dataset build`: a data set from its spec."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import tyro

from scenarios.commands.output import cluster_executor, print_json, say, say_each, say_next
from scenarios.files.errors import ScenarioError
from scenarios.jobs.progress import How, Progress, show_progress

if TYPE_CHECKING:
    from scenarios.datasets.data_set import DataSet

MOST_REASONS = 20
"""Reasons of failures that are printed."""


def build(
    spec: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SPEC")],
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
    """Build a data set; an interrupted build resumes.

    Nothing is lost if a build is interrupted, killed or out of disk: run the command again, and the data set has the
    same bytes. An experiment that fails is listed with its reason; the others continue, and the exit code is 1.

    With --withhold the data set in --out holds nothing from which its truth can be computed: no truth and no seeds. Its
    scored records hold all inputs, but outputs only for the first samples, from which a model's state is initialised.
    FOLDER keeps the complete data sets for hmtb dataset grade.

      hmtb dataset build class.toml --withhold withheld --students roster.txt --out class

    Args:
        spec: A data set that comes with the package (hmtb dataset list) or a TOML file.
        out: Folder in which the folder of the data set is created.
        withhold: Publish without the truth, and keep the complete data sets and their seeds in this folder.
        students: A data set for each person, with arms, noise and waveforms of its own: a text file, one name per line.
        seed: With --withhold: all seeds follow from it; by default they are drawn from the system's randomness.
        workers: Threads for the physics, all processors by default; the data do not depend on it.
        rows: Most experiments that run side by side: fewer need less memory; the data do not depend on it.
        cluster: Address of a Dask scheduler, tcp://HOST:8786, whose workers run the experiments with this package.
        patience: How long to wait for a lost scheduler or for missing workers, s.
        progress: How stderr shows the progress; auto is a bar on a terminal, else a line now and then.
        json: Print JSON.
    """
    from scenarios.datasets.build import build as build_data_set
    from scenarios.datasets.chunk import CLUSTER_ROWS, MOST_ROWS
    from scenarios.datasets.plan import UNFINISHED
    from scenarios.datasets.spec import load_spec
    from scenarios.datasets.withhold import build_withheld, read_roster

    for option, value in (("--students", students), ("--seed", seed)):
        if value is not None and withhold is None:
            raise ScenarioError(f"{option} given without --withhold FOLDER; the seed of other data sets is in the spec")
    executor = None if cluster is None else cluster_executor(cluster, patience, workers)
    if rows is None:
        rows = MOST_ROWS if executor is None else CLUSTER_ROWS
    plan = load_spec(spec)
    latest: Progress | None = None
    with show_progress(plan.label, progress) as show:

        def update(current: Progress) -> None:
            nonlocal latest
            latest = current
            show(current)

        make = partial(build_data_set, workers=workers, rows=rows, executor=executor, progress=update)
        try:
            if withhold is None:
                outcome = _built(make(plan, out))
            else:
                persons = () if students is None else read_roster(students)
                paths, failed = build_withheld(plan, out, withhold, persons=persons, seed=seed, build=make)
                outcome = _withheld(paths, failed, withhold)
        except KeyboardInterrupt:
            kept = f"finished experiments kept in {withhold}"
            if withhold is None:
                kept = _saved_work(latest, out / (plan.label + UNFINISHED))
            raise KeyboardInterrupt(kept) from None
    if json:
        print_json(outcome.record)
    else:
        _say_failed(outcome.failed)
        say_each("", outcome.lines)
        say_next("dataset", *outcome.following)
    return 1 if outcome.failed else 0


class _Outcome(NamedTuple):
    """Outcome of a build: as JSON, in lines, with the command that goes on from there."""

    record: Mapping[str, object]
    failed: Mapping[str, str]
    lines: Sequence[str]
    following: Sequence[object]


def _built(built: "DataSet") -> _Outcome:
    count, failed = len(built.records()), built.incomplete
    hashes = {"hash": built.hash, "records": built.records_hash}
    record = {"path": built.folder, "experiments": count, "failed": failed, **hashes}
    line = f"{built.folder}: {count} experiments, {len(failed)} failed, records {built.records_hash[:12]}"
    return _Outcome(record, failed, [line], ("check", built.folder))


def _withheld(paths: Sequence[Path], failed: Mapping[str, str], withhold: Path) -> _Outcome:
    record = {"paths": paths, "withheld": withhold, "failed": failed}
    secret = f"{withhold}: keep it secret: it holds the truth and the seeds, and grades submissions"
    return _Outcome(record, failed, [*map(str, paths), secret], ("export", paths[0], "--format", "csv"))


def _say_failed(failed: Mapping[str, str]) -> None:
    """Print each reason of failures once, with the first experiment that it stopped."""
    names: dict[str, list[str]] = {}
    for name, why in failed.items():
        # The laboratory names the experiment too; names of a class come with the label of the data set.
        names.setdefault(why.removeprefix(f"{name.rpartition(': ')[2]}: "), []).append(name)
    reasons = list(names.items())
    for why, same in reasons[:MOST_REASONS]:
        others = f" and {len(same) - 1} more" if len(same) > 1 else ""
        say(f"failed: {same[0]}{others}: {why}")
    if len(reasons) > MOST_REASONS:
        unlisted = sum(len(same) for _, same in reasons[MOST_REASONS:])
        say(f"failed: {unlisted} more, for other reasons; the index has them")


def _saved_work(latest: Progress | None, folder: Path) -> str:
    """Message on the saved work of an interrupted build; empty if there is none."""
    if latest is None or not folder.is_dir():
        return ""
    if latest.step == "check":
        return f"all that was done kept in {folder}"
    done = f"{latest.done} of {latest.total}" if latest.seconds_total else "all"
    return f"{done} experiments kept in {folder}"
